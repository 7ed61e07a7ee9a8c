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

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.faces import Faces, film_faces, net_inflow, poiseuille_inflow
from model.film.matrix import assemble, factorise, substitute
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.slopes import derivatives, force_of, rupture_line
from model.film.turbulence import heat_beyond, resist
from rigdata.arrays import FloatArray

#: Share of the clearance below which there is no film: thinner than an atom in a tenth of a millimetre.
THINNEST = 1e-6
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
        True: by `model.film.turbulence`; `work.gained` is set to the heat beyond that of a laminar film [W]. None: no,
        and without compiling it.

    Returns
    -------
    FilmForces

    Notes
    -----
    Eq. (2) of Dang, Chatterton, Pennacchi, Lubricants 2019, 7, 61; perturbed pressure zero where ruptured.
    """
    min_film = _thickness(grid, work, wedge)
    if not min_film > THINNEST * wedge[0]:
        return FilmForces(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), min_film, -1)
    faces = film_faces(grid, work, wedge, speed)
    if turbulent is not None and turbulent:
        resist(grid, work, speed, faces)
    source = np.empty(len(work.unknown))
    net_inflow(grid, faces.couette, source)
    steps = 1 if solved else _active_set(grid, work, faces, source)
    weight = grid.area
    if steps > 0:
        if sharp:
            assemble(grid, work, faces)
            weight = rupture_line(grid, work, faces, source)
            factorise(work.band)
        derivatives(grid, work, faces)
        if turbulent is not None and turbulent:
            heat_beyond(grid, work, speed)
    force, stiffness, damping = integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, min_film, steps)


@inner
def _thickness(grid: FilmGrid, work: FilmWork, wedge: Wedge) -> float:
    h, low = work.thickness, np.inf
    for i in range(h.shape[0]):
        even = wedge[0] - wedge[1] * grid.cos[i] - wedge[2] * grid.sin[i]
        for j in range(h.shape[1]):
            h[i, j] = even + work.extra[i, j]
            low = min(low, h[i, j])
    return low


@inner
def _active_set(grid: FilmGrid, work: FilmWork, faces: Faces, source: FloatArray) -> int:
    """Solve the complementarity problem; returns the number of factorisations, -2 if it did not settle."""
    p, ruptured, x = work.pressure.reshape(-1), work.ruptured.reshape(-1), work.unknown
    width, line = work.band.shape[1] - 1, grid.steps[0]
    for step in range(1, _MAX_ACTIVE_SET_STEPS + 1):
        assemble(grid, work, faces)
        factorise(work.band)
        for k in range(len(x)):
            n = grid.node[k]
            x[k] = 0.0 if ruptured[n] else source[k]
            if k < width and not ruptured[n]:
                x[k] += faces.conductance[0, n - line] * p[n - line]  # the groove's
        substitute(work.band, x)
        for k in range(len(x)):
            p[grid.node[k]] = x[k]
        if _update_active_set(grid, work, faces, source) == 0:
            return step
    return -2


@inner
def _update_active_set(grid: FilmGrid, work: FilmWork, faces: Faces, source: FloatArray) -> int:
    """Let nodes rupture whose pressure is negative, and the film reform where more flows in than out."""
    p, ruptured, changed = work.pressure.reshape(-1), work.ruptured.reshape(-1), 0
    for k in range(len(source)):
        n, wrong = grid.node[k], work.unknown[k] < 0.0
        if ruptured[n]:
            wrong = source[k] + poiseuille_inflow(p, faces.conductance, grid.steps[0], n) > 0.0
        if wrong:
            ruptured[n] = not ruptured[n]
            changed += 1
    return changed


@inner
def integrate(grid: FilmGrid, work: FilmWork, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Forces and their derivatives; `weight` is the area that a node's perturbed pressure stands for."""
    force = force_of(grid, grid.area, work.unknown.reshape((-1, 1)))[:, 0].copy()
    for j in range(grid.first, grid.steps[0] - 1):
        force[0] += grid.cos[0] * grid.area[0, j] * work.pressure[0, j]
        force[1] += grid.sin[0] * grid.area[0, j] * work.pressure[0, j]
    slopes = force_of(grid, weight, work.slopes)
    return force, slopes[:, :2].copy(), slopes[:, 2:].copy()
