"""The oil film of one pad: Reynolds' equation, Eq. (2), with Swift-Stieber rupture, and its perturbation.

Film thickness of a pad depends on two numbers only. With alpha the angle from the pivot,

    h(alpha) = Cp - a cos(alpha) - b sin(alpha) + extra(alpha, z)
    a = Cp - Cb - eta + x cos(phi) + y sin(phi)          (the journal's approach to the pad)
    b = -x sin(phi) + y cos(phi) + R_P t                 (the wedge)

so every film is solved in (a, b), and one factorisation serves the pressure and its four derivatives with
respect to a, b and their rates. Discretisation: vertex-centred finite volumes on a uniform grid, second order;
the matrix is a symmetric M-matrix, for which the primal-dual active set of the complementarity problem

    p >= 0,   A p - f >= 0,   p (A p - f) = 0

(p = 0 and dp/dn = 0 at the rupture line) ends after finitely many steps. Banded L D L^T, half the film width
where the film is symmetric about mid-length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.matrix import assemble, factorise, substitute
from model.film.mesh import Faces, FilmGrid, FilmWork, Wedge
from model.film.oil_state import face_height
from model.film.slopes import derivatives, poiseuille_inflow, rupture_line
from model.film.turbulence import heat_beyond, resist
from rigdata.arrays import BoolArray, FloatArray

#: A cold start moves the rupture line by one node a step, so that fine meshes need many.
_MAX_ACTIVE_SET_STEPS = 2000


class FilmForces(NamedTuple):
    """What a film does to its pad, in the pad's (radial, tangential) frame.

    Attributes
    ----------
    force : (2,) ndarray
        Integrals of p cos(alpha), p sin(alpha) over the pad [N].
    stiffness : (2, 2) ndarray
        d force / d (a, b), viscosity frozen [N/m].
    damping : (2, 2) ndarray
        d force / d (da/dt, db/dt) [N s/m].
    min_film : float
        [m]
    steps : int
        Active-set steps taken; -1 if the film touched the journal, -2 if the active set did not settle.
    """

    force: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    min_film: float
    steps: int


@compiled
def solve_film(
    grid: FilmGrid,
    work: FilmWork,
    wedge: Wedge,
    speed: float,
    sharp: bool,
    turbulent: bool | None = None,
    solved: bool = False,
) -> FilmForces:
    """Pressure of one film and its derivatives.

    Parameters
    ----------
    grid, work
        Mesh and arrays; `work.viscosity`, `work.density`, `work.extra` are read, `work.ruptured` is the first
        guess of the active set, `work.pressure`, `work.thickness` and the flows are written.
    wedge : tuple of float
        Cp, a, b [m].
    speed : float
        Surface speed of the journal [m/s].
    sharp : bool
        Let the perturbed pressure vanish at the rupture line itself, not at the next node: second order in the
        mesh, for one more factorisation. Newton steps do without.
    solved : bool, optional
        `work` holds this film's pressure: only its derivatives are asked for, sharp.
    turbulent : bool, optional
        True: by `model.film.turbulence`; `work.gained` is set to the heat beyond that of a laminar film [W].

    Returns
    -------
    FilmForces

    Notes
    -----
    Eq. (2) of Dang, Chatterton, Pennacchi, Lubricants 2019, 7, 61; perturbed pressure zero where ruptured.
    """
    min_film = _thickness(grid, work, wedge)
    if not min_film > 0.0:
        return FilmForces(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), min_film, -1)
    gx, gz = conductances(grid, work, wedge)
    powers = None
    if turbulent is not None:
        powers = resist(grid, work, wedge, speed, (gx, gz))
    source = _source(grid, work, wedge, speed)
    steps = 1 if solved else _active_set(grid, work, gx, gz, source)
    weight = grid.area
    if steps > 0:
        if sharp:
            assemble(work.band, gx, gz, work.ruptured, grid.first)
            weight = rupture_line(grid, work, (gx, gz), source)
            factorise(work.band)
        derivatives(grid, work, wedge, (gx, gz), powers)
        if turbulent is not None:
            heat_beyond(grid, work, speed)
    force, stiffness, damping = _integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, min_film, steps)


@inner
def _thickness(grid: FilmGrid, work: FilmWork, wedge: Wedge) -> float:
    h = work.thickness
    low = np.inf
    for i in range(h.shape[0]):
        base = wedge[0] - wedge[1] * grid.cos[i] - wedge[2] * grid.sin[i]
        for j in range(h.shape[1]):
            h[i, j] = base + work.extra[i, j]
            low = min(low, h[i, j])
    return low


@compiled
def conductances(grid: FilmGrid, work: FilmWork, wedge: Wedge) -> Faces:
    """Rho h^3 / (12 mu) times face length over distance, at the faces along and across.

    Gives gx (nt, nz + 1), gz (nt + 1, nz) [kg/s/Pa].
    """
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    gx = np.empty((nt, nz + 1))
    gz = np.empty((nt + 1, nz))
    fluidity = np.empty((nt + 1, nz + 1))
    for i in range(nt + 1):
        for j in range(nz + 1):
            fluidity[i, j] = work.density[i, j] / work.viscosity[i, j]
    for i in range(nt):
        for j in range(nz + 1):
            h = face_height(grid, work, wedge, i, j)
            gx[i, j] = h**3 / 24.0 * (fluidity[i, j] + fluidity[i + 1, j]) * grid.height[j] / grid.dx
    for i in range(nt + 1):
        for j in range(nz):
            h = 0.5 * (work.thickness[i, j] + work.thickness[i, j + 1])
            gz[i, j] = h**3 / 24.0 * (fluidity[i, j] + fluidity[i, j + 1]) * grid.dx / grid.dz[j]
    return gx, gz


@inner
def _source(grid: FilmGrid, work: FilmWork, wedge: Wedge, speed: float) -> FloatArray:
    """Couette inflow minus outflow of each control volume (the right-hand side f of A p = f)."""
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    source = np.zeros((nt + 1, nz + 1))
    for i in range(nt):
        for j in range(nz + 1):
            h = face_height(grid, work, wedge, i, j)
            dragged = work.density[i, j] * work.drag[i, j] + work.density[i + 1, j] * work.drag[i + 1, j]
            couette = 0.25 * speed * h * dragged * grid.height[j]
            work.flow_x[i, j] = couette
            source[i, j] -= couette
            source[i + 1, j] += couette
    return source


@inner
def _active_set(grid: FilmGrid, work: FilmWork, gx: FloatArray, gz: FloatArray, source: FloatArray) -> int:
    """Solve the complementarity problem; returns the number of factorisations, -2 if it did not settle."""
    p, ruptured = work.pressure, work.ruptured
    nt, nz = gx.shape[0], gz.shape[1]
    first = grid.first
    width = nz - first
    for step in range(1, _MAX_ACTIVE_SET_STEPS + 1):
        assemble(work.band, gx, gz, ruptured, first)
        factorise(work.band)
        x = work.unknown
        for i in range(1, nt):
            for j in range(first, nz):
                k = (i - 1) * width + j - first
                x[k] = 0.0 if ruptured[i, j] else source[i, j]
                if i == 1 and not ruptured[i, j]:
                    x[k] += gx[0, j] * p[0, j]  # the groove's
        substitute(work.band, x)
        for i in range(1, nt):
            for j in range(first, nz):
                p[i, j] = x[(i - 1) * width + j - first]
        if _update_active_set(p, ruptured, gx, gz, source, first) == 0:
            return step
    return -2


@inner
def _update_active_set(
    p: FloatArray, ruptured: BoolArray, gx: FloatArray, gz: FloatArray, source: FloatArray, first: int
) -> int:
    nt, nz = gx.shape[0], gz.shape[1]
    changed = 0
    for i in range(1, nt):
        for j in range(first, nz):
            if ruptured[i, j]:
                if (
                    source[i, j] + poiseuille_inflow(p, (gx, gz), i, j) > 0.0
                ):  # more flows in than out: the film reforms here
                    ruptured[i, j] = False
                    changed += 1
            elif p[i, j] < 0.0:
                ruptured[i, j] = True
                changed += 1
    return changed


@inner
def _integrate(grid: FilmGrid, work: FilmWork, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Forces and their derivatives; `weight` is the area that a node's perturbed pressure stands for."""
    force = np.zeros(2)
    stiffness = np.zeros((2, 2))
    damping = np.zeros((2, 2))
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    first = grid.first
    width = nz - first
    total = np.zeros(5)
    for j in range(first, nz):
        force[0] += grid.cos[0] * grid.area[0, j] * work.pressure[0, j]
        force[1] += grid.sin[0] * grid.area[0, j] * work.pressure[0, j]
    for i in range(1, nt):
        for m in range(5):
            total[m] = 0.0
        for j in range(first, nz):
            k = (i - 1) * width + j - first
            total[0] += grid.area[i, j] * work.unknown[k]
            for m in range(4):
                total[m + 1] += weight[i, j] * work.slopes[k, m]
        for m in range(2):
            direction = grid.cos[i] if m == 0 else grid.sin[i]
            force[m] += direction * total[0]
            stiffness[m, 0] += direction * total[1]
            stiffness[m, 1] += direction * total[2]
            damping[m, 0] += direction * total[3]
            damping[m, 1] += direction * total[4]
    return force, stiffness, damping
