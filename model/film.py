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
from numpy.typing import NDArray

from model.kernel import compiled

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: A cold start moves the rupture line by one node a step, so that fine meshes need many.
MAX_ACTIVE_SET_STEPS = 2000


class FilmGrid(NamedTuple):
    """Mesh of one film; `nt` intervals along the arc, `nz` across (half width if symmetric).

    Attributes
    ----------
    angle : (nt + 1,) ndarray
        alpha, from the pivot, positive with rotation [rad].
    z : (nz + 1,) ndarray
        Axial coordinate from mid-length [m].
    cos, sin : (nt + 1,) ndarray
        At the nodes.
    cos_face, sin_face : (nt,) ndarray
        At the faces between nodes.
    dx : float
        Spacing along the arc [m].
    dz : (nz,) ndarray
        Spacing across [m]; finer towards the edges, where the pressure bends most.
    height : (nz + 1,) ndarray
        Axial size of each control volume [m].
    area : (nt + 1, nz + 1) ndarray
        Quadrature weights [m^2]; the mirrored half is counted.
    first : int
        First unknown axial node: 0 at a symmetry plane, 1 where z = -L/2 is an edge.
    """

    angle: FloatArray
    z: FloatArray
    cos: FloatArray
    sin: FloatArray
    cos_face: FloatArray
    sin_face: FloatArray
    dx: float
    dz: FloatArray
    height: FloatArray
    area: FloatArray
    first: int


class FilmWork(NamedTuple):
    """Arrays that one film solution fills (mesh shape (nt + 1, nz + 1) unless said otherwise).

    Attributes
    ----------
    pressure : ndarray
        [Pa]
    ruptured : ndarray of bool
        True where the film is ruptured.
    temperature : ndarray
        [degC]
    viscosity, density : ndarray
        [Pa s], [kg/m^3], frozen for the pressure solution.
    thickness : ndarray
        h [m].
    extra : ndarray
        What is added to h: pad deformation, misalignment [m].
    flow_x : (nt, nz + 1) ndarray
        Mass flow through the faces along the arc [kg/s].
    flow_z : (nt + 1, nz) ndarray
        Mass flow through the faces across [kg/s].
    band : ((nt - 1) * unknowns, unknowns + 1) ndarray
        Factor of the matrix.
    unknown : ((nt - 1) * unknowns,) ndarray
        Pressure at the unknowns.
    slopes : ((nt - 1) * unknowns, 4) ndarray
        Its derivatives by a, b, da/dt, db/dt.
    """

    pressure: FloatArray
    ruptured: BoolArray
    temperature: FloatArray
    viscosity: FloatArray
    density: FloatArray
    thickness: FloatArray
    extra: FloatArray
    flow_x: FloatArray
    flow_z: FloatArray
    band: FloatArray
    unknown: FloatArray
    slopes: FloatArray


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


def film_grid(
    start: float, end: float, radius: float, length: float, shape: tuple[int, int], symmetric: bool
) -> FilmGrid:
    """Lay a mesh over a film.

    Parameters
    ----------
    start, end : float
        Leading and trailing edge, angle from the pivot [rad].
    radius, length : float
        Journal radius and pad length [m].
    shape : tuple of int
        Intervals along the arc and across (half width if `symmetric`); both even.
    symmetric : bool
        The film is mirrored about mid-length.
    """
    nt, nz = shape
    if nt < 4 or nz < 2 or nt % 2 or nz % 2:
        raise ValueError(f"mesh must have even numbers of intervals, at least 4 x 2, got {nt} x {nz}")
    angle = np.linspace(start, end, nt + 1)
    z = 0.5 * length * _graded(nz, symmetric)
    face = 0.5 * (angle[1:] + angle[:-1])
    dx, dz = radius * (end - start) / nt, np.diff(z)
    height = np.zeros(nz + 1)
    height[:-1] += 0.5 * dz
    height[1:] += 0.5 * dz
    across = _parabolic_weights(z)
    # Trapezoids along: the rupture line leaves the profile only once differentiable.
    along = np.full(nt + 1, dx)
    along[[0, -1]] = 0.5 * dx
    area = np.outer(along, across) * (2.0 if symmetric else 1.0)
    return FilmGrid(
        angle,
        z,
        np.cos(angle),
        np.sin(angle),
        np.cos(face),
        np.sin(face),
        dx,
        dz,
        height,
        area,
        0 if symmetric else 1,
    )


#: How much finer the axial mesh is at the edges: the spacing there is 1 - GRADING of the mean.
GRADING = 0.5


def _graded(nz: int, symmetric: bool) -> FloatArray:
    """Node positions in units of half the width: 0 to 1, or -1 to 1."""
    if not symmetric:
        half = _graded(nz // 2, True)
        return np.concatenate([-half[:0:-1], half])
    share = np.arange(nz + 1) / nz
    return share * (1.0 + GRADING - GRADING * share)


def _parabolic_weights(z: FloatArray) -> FloatArray:
    """Simpson's rule for unequal spacing: exact for a parabola through every pair of intervals."""
    weights = np.zeros(len(z))
    for k in range(0, len(z) - 2, 2):
        h0, h1 = z[k + 1] - z[k], z[k + 2] - z[k + 1]
        total = (h0 + h1) / 6.0
        weights[k] += total * (2.0 - h1 / h0)
        weights[k + 1] += total * (h0 + h1) ** 2 / (h0 * h1)
        weights[k + 2] += total * (2.0 - h0 / h1)
    return weights


def film_work(grid: FilmGrid, inlet_temperature: float) -> FilmWork:
    """Allocate the arrays of one film, at rest at the inlet temperature."""
    nt, nz = len(grid.angle) - 1, len(grid.z) - 1
    shape = (nt + 1, nz + 1)
    unknowns = nz - grid.first
    n = (nt - 1) * unknowns
    return FilmWork(
        pressure=np.zeros(shape),
        ruptured=np.zeros(shape, dtype=np.bool_),
        temperature=np.full(shape, inlet_temperature),
        viscosity=np.zeros(shape),
        density=np.zeros(shape),
        thickness=np.zeros(shape),
        extra=np.zeros(shape),
        flow_x=np.zeros((nt, nz + 1)),
        flow_z=np.zeros((nt + 1, nz)),
        band=np.zeros((n, unknowns + 1)),
        unknown=np.zeros(n),
        slopes=np.zeros((n, 4)),
    )


@compiled
def solve_film(
    grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], speed: float, sharp: bool
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

    Returns
    -------
    FilmForces

    Notes
    -----
    Eq. (2) of Dang, Chatterton, Pennacchi, Lubricants 2019, 7, 61; perturbed pressure zero where ruptured.
    """
    clearance, a, b = wedge
    min_film = _thickness(grid, work, clearance, a, b)
    if not min_film > 0.0:
        return FilmForces(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), min_film, -1)
    gx, gz = _conductances(grid, work, clearance, a, b)
    source = _source(grid, work, clearance, a, b, speed)
    steps = _active_set(grid, work, gx, gz, source)
    weight = grid.area
    if steps > 0:
        if sharp:
            diagonal, weight = _rupture_line(grid, work, gx, gz, source)
            _assemble(work.band, gx, gz, work.ruptured, grid.first)
            _add_diagonal(work.band, diagonal, grid.first)
            _factorise(work.band)
        _derivatives(grid, work, wedge, (gx, gz))
    force, stiffness, damping = _integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, min_film, steps)


@compiled
def _thickness(grid: FilmGrid, work: FilmWork, clearance: float, a: float, b: float) -> float:
    h = work.thickness
    low = np.inf
    for i in range(h.shape[0]):
        base = clearance - a * grid.cos[i] - b * grid.sin[i]
        for j in range(h.shape[1]):
            h[i, j] = base + work.extra[i, j]
            low = min(low, h[i, j])
    return low


@compiled
def _conductances(
    grid: FilmGrid, work: FilmWork, clearance: float, a: float, b: float
) -> tuple[FloatArray, FloatArray]:
    """Rho h^3 / (12 mu) times face length over distance, at the faces along and across."""
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    gx = np.empty((nt, nz + 1))
    gz = np.empty((nt + 1, nz))
    fluidity = work.density / work.viscosity
    for i in range(nt):
        base = clearance - a * grid.cos_face[i] - b * grid.sin_face[i]
        for j in range(nz + 1):
            h = base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])
            gx[i, j] = h**3 / 24.0 * (fluidity[i, j] + fluidity[i + 1, j]) * grid.height[j] / grid.dx
    for i in range(nt + 1):
        for j in range(nz):
            h = 0.5 * (work.thickness[i, j] + work.thickness[i, j + 1])
            gz[i, j] = h**3 / 24.0 * (fluidity[i, j] + fluidity[i, j + 1]) * grid.dx / grid.dz[j]
    return gx, gz


@compiled
def _source(grid: FilmGrid, work: FilmWork, clearance: float, a: float, b: float, speed: float) -> FloatArray:
    """Couette inflow minus outflow of each control volume (the right-hand side f of A p = f)."""
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    source = np.zeros((nt + 1, nz + 1))
    for i in range(nt):
        base = clearance - a * grid.cos_face[i] - b * grid.sin_face[i]
        for j in range(nz + 1):
            h = base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])
            couette = 0.25 * speed * h * (work.density[i, j] + work.density[i + 1, j]) * grid.height[j]
            work.flow_x[i, j] = couette
            source[i, j] -= couette
            source[i + 1, j] += couette
    return source


@compiled
def _active_set(grid: FilmGrid, work: FilmWork, gx: FloatArray, gz: FloatArray, source: FloatArray) -> int:
    """Solve the complementarity problem; returns the number of factorisations, -2 if it did not settle."""
    p, ruptured = work.pressure, work.ruptured
    nt, nz = gx.shape[0], gz.shape[1]
    first = grid.first
    width = nz - first
    for step in range(1, MAX_ACTIVE_SET_STEPS + 1):
        _assemble(work.band, gx, gz, ruptured, first)
        _factorise(work.band)
        x = work.unknown
        for i in range(1, nt):
            for j in range(first, nz):
                k = (i - 1) * width + j - first
                x[k] = 0.0 if ruptured[i, j] else source[i, j]
        _substitute(work.band, x)
        for i in range(1, nt):
            for j in range(first, nz):
                p[i, j] = x[(i - 1) * width + j - first]
        if _update_active_set(p, ruptured, gx, gz, source, first) == 0:
            return step
    return -2


@compiled
def _update_active_set(
    p: FloatArray, ruptured: BoolArray, gx: FloatArray, gz: FloatArray, source: FloatArray, first: int
) -> int:
    nt, nz = gx.shape[0], gz.shape[1]
    changed = 0
    for i in range(1, nt):
        for j in range(first, nz):
            if ruptured[i, j]:
                inflow = gx[i - 1, j] * p[i - 1, j] + gx[i, j] * p[i + 1, j] + gz[i, j] * p[i, j + 1]
                if j > 0:
                    inflow += gz[i, j - 1] * p[i, j - 1]
                if source[i, j] + inflow > 0.0:  # more flows in than out: the film reforms here
                    ruptured[i, j] = False
                    changed += 1
            elif p[i, j] < 0.0:
                ruptured[i, j] = True
                changed += 1
    return changed


@compiled
def _assemble(band: FloatArray, gx: FloatArray, gz: FloatArray, ruptured: BoolArray, first: int) -> None:
    nt, nz = gx.shape[0], gz.shape[1]
    width = nz - first
    band[:, :] = 0.0
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * width + j - first
            if ruptured[i, j]:
                band[k, 0] = 1.0
                continue
            diagonal = gx[i - 1, j] + gx[i, j] + gz[i, j]
            if j > 0:
                diagonal += gz[i, j - 1]
            band[k, 0] = diagonal
            if j + 1 < nz and not ruptured[i, j + 1]:
                band[k, 1] -= gz[i, j]
            if i + 1 < nt and not ruptured[i + 1, j]:
                band[k, width] -= gx[i, j]


@compiled
def _factorise(band: FloatArray) -> None:
    """L D L^T in place: band[k, 0] = D, band[k, r] = L[k + r, k]."""
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        pivot = band[k, 0]
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r] / pivot
            if factor != 0.0:
                for s in range(r, width + 1):
                    band[k + r, s - r] -= factor * band[k, s]
        for r in range(1, width + 1):
            band[k, r] /= pivot


@compiled
def _substitute(band: FloatArray, x: FloatArray) -> None:
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        for r in range(1, min(width, n - 1 - k) + 1):
            x[k + r] -= band[k, r] * x[k]
    for k in range(n - 1, -1, -1):
        total = x[k] / band[k, 0]
        for r in range(1, min(width, n - 1 - k) + 1):
            total -= band[k, r] * x[k + r]
        x[k] = total


@compiled
def _substitute_four(band: FloatArray, x: FloatArray) -> None:
    """`_substitute` for the four derivatives side by side (n, 4): the inner loop fills a vector register."""
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r]
            for m in range(4):
                x[k + r, m] -= factor * x[k, m]
    for k in range(n - 1, -1, -1):
        pivot = band[k, 0]
        for m in range(4):
            x[k, m] /= pivot
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r]
            for m in range(4):
                x[k, m] -= factor * x[k + r, m]


@compiled
def _rupture_line(
    grid: FilmGrid, work: FilmWork, gx: FloatArray, gz: FloatArray, source: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where between two nodes the film ruptures, as changes of the wet nodes' diagonal and area.

    A dry node is reached by the share `wet` of the flow that would wet it; the pressure rises as the square of
    the distance from the rupture line, so that the line lies (0.5 + wet) steps from the last wet node. A linear
    profile that vanishes there has (wet - 0.5) / (wet + 0.5) of the wet node's value at the dry node.
    """
    nt, nz = gx.shape[0], gz.shape[1]
    p, ruptured = work.pressure, work.ruptured
    diagonal = np.zeros((nt + 1, nz + 1))
    area = grid.area.copy()
    for i in range(1, nt):
        for j in range(grid.first, nz):
            if not ruptured[i, j] or source[i, j] >= 0.0:
                continue
            inflow = gx[i - 1, j] * p[i - 1, j] + gx[i, j] * p[i + 1, j] + gz[i, j] * p[i, j + 1]
            if j > 0:
                inflow += gz[i, j - 1] * p[i, j - 1]
            wet = min(1.0, inflow / -source[i, j])
            ghost = (wet - 0.5) / (wet + 0.5)
            for side in range(-1, 2, 2):
                m = i + side
                if 0 < m < nt and not ruptured[m, j]:
                    diagonal[m, j] -= (gx[i - 1, j] if side < 0 else gx[i, j]) * ghost
                    area[m, j] *= 1.0 + 0.5 * (wet - 0.5)
    return diagonal, area


@compiled
def _add_diagonal(band: FloatArray, diagonal: FloatArray, first: int) -> None:
    nt, nz = diagonal.shape[0] - 1, diagonal.shape[1] - 1
    for i in range(1, nt):
        for j in range(first, nz):
            band[(i - 1) * (nz - first) + j - first, 0] += diagonal[i, j]


@compiled
def _derivatives(
    grid: FilmGrid,
    work: FilmWork,
    wedge: tuple[float, float, float],
    conductance: tuple[FloatArray, FloatArray],
) -> None:
    """Right-hand sides of the perturbed equation, solved with the factor at hand; then the mass flows."""
    p, rhs, h = work.pressure, work.slopes, work.thickness
    gx, gz = conductance
    nt, nz = gx.shape[0], gz.shape[1]
    first = grid.first
    width = nz - first
    rhs[:, :] = 0.0
    for i in range(nt):
        base = wedge[0] - wedge[1] * grid.cos_face[i] - wedge[2] * grid.sin_face[i]
        for j in range(nz + 1):
            poiseuille = gx[i, j] * (p[i + 1, j] - p[i, j])
            hf = base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])
            # d(outflow through the face)/dh, times dh/da = -cos, dh/db = -sin
            slope = (work.flow_x[i, j] - 3.0 * poiseuille) / hf
            work.flow_x[i, j] -= poiseuille
            if first <= j < nz:
                k = i * width + j - first
                if i + 1 < nt:
                    rhs[k, 0] -= slope * grid.cos_face[i]
                    rhs[k, 1] -= slope * grid.sin_face[i]
                if i > 0:
                    rhs[k - width, 0] += slope * grid.cos_face[i]
                    rhs[k - width, 1] += slope * grid.sin_face[i]
    for i in range(nt + 1):
        for j in range(nz):
            poiseuille = gz[i, j] * (p[i, j + 1] - p[i, j])
            work.flow_z[i, j] = -poiseuille
            if 0 < i < nt:
                slope = -3.0 * poiseuille / (0.5 * (h[i, j] + h[i, j + 1]))
                k = (i - 1) * width + j - first
                if j >= first:
                    rhs[k, 0] += slope * grid.cos[i]
                    rhs[k, 1] += slope * grid.sin[i]
                if j + 1 < nz:
                    rhs[k + 1, 0] -= slope * grid.cos[i]
                    rhs[k + 1, 1] -= slope * grid.sin[i]
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * width + j - first
            squeeze = work.density[i, j] * grid.dx * grid.height[j]
            rhs[k, 2] = squeeze * grid.cos[i]
            rhs[k, 3] = squeeze * grid.sin[i]
            if work.ruptured[i, j]:
                for m in range(4):
                    rhs[k, m] = 0.0
    _substitute_four(work.band, rhs)


@compiled
def _integrate(grid: FilmGrid, work: FilmWork, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Forces and their derivatives; `weight` is the area that a node's perturbed pressure stands for."""
    force = np.zeros(2)
    stiffness = np.zeros((2, 2))
    damping = np.zeros((2, 2))
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    first = grid.first
    width = nz - first
    total = np.zeros(5)
    for i in range(1, nt):
        total[:] = 0.0
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
