"""Mass-conserving cavitation, Jakobsson-Floberg-Olsson (JFO), as an option beside Swift-Stieber.

Where a film is full it has a pressure; where it is ruptured it has a filling theta < 1, which the journal drags on.
With m = rho h theta, and U the surface speed,

    div(rho h^3 / (12 mu) grad p) = U/2 dm/dx + dm/dt,    p >= 0,   1 - theta >= 0,   p (1 - theta) = 0.

On the control volumes of `model.film.reynolds` the Couette flow through a face is that of the full film times the
filling of the volume upstream. One unknown per node, x = p where wet and x = theta - 1 where ruptured, makes this a
piecewise linear problem F(x) = 0 whose pieces are M-matrices: it has one solution, found by block principal
pivoting (all nodes on the wrong side change sides at once; should that not help for long, one at a time, which must
end).

A film that does not rupture is the film of `model.film.reynolds`, to the last bit: this file asks it first. Where a
film ruptures and does not form again, both agree in pressure; they differ behind a diverging inlet and where a film
forms again, because Swift-Stieber makes up oil there.

B. Jakobsson, L. Floberg, Trans. Chalmers Univ. 190 (1957); K.-O. Olsson, ibid. 308 (1965); M. Giacopini et al., ASME
J. Tribology 132 (2010) 041702 (complementarity); L. Portugal, J. Judice, L. Vicente, Math. Comp. 63 (1994) 625
(block principal pivoting).
"""

from __future__ import annotations

import numpy as np

from model.compilation import compiled, inner
from model.film.cavitation_matrix import (
    FaceFlows,
    assemble_columns,
    face_flows,
    substitute_columns,
)
from model.film.matrix import assemble, factorise, factorise_general
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.reynolds import FilmForces, _integrate, solve_film
from model.film.slopes import face_slopes, net_inflow
from rigdata.arrays import BoolArray, FloatArray


@inner
def _jfo_slopes(
    grid: FilmGrid, work: FilmWork, wedge: Wedge, faces: FaceFlows, x: FloatArray, sharp: bool
) -> tuple[FloatArray, FloatArray]:
    """Solve for the derivatives by a, b, da/dt, db/dt; then the mass flows.

    `x` (unknowns, 1); gives weight (nt + 1, nz + 1) [m^2], slopes (unknowns, 4).
    """
    nz = work.pressure.shape[1] - 1
    width = nz - grid.first
    band = np.empty((x.shape[0], 2 * width + 1))
    assemble_columns(band, faces, work.ruptured, grid.first)
    weight = grid.area
    if sharp:
        weight = _rupture_line(grid, work, faces, x, band)
    factorise_general(band)
    slopes = np.zeros((x.shape[0], 4))
    static, rate = slopes[:, :2], slopes[:, 2:]
    _displaced(grid, work, wedge, faces, x, static)
    substitute_columns(band, static)
    _stored(grid, work, faces, x, static, rate)
    substitute_columns(band, rate)
    # heat goes with the flows of a full film
    work.flow_x[:] = faces.couette - faces.along * (work.pressure[1:] - work.pressure[:-1])
    return weight, slopes


@inner
def _rupture_line(grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, band: FloatArray) -> FloatArray:
    """Where between two nodes the film ruptures: as in `model.film.reynolds`; here what flows is kept in balance."""
    nt, nz = faces.along.shape[0], faces.across.shape[1]
    width = nz - grid.first
    weight = grid.area.copy()
    for i in range(2, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * width + j - grid.first
            if work.ruptured[i - 1, j] and not work.ruptured[i, j]:
                weight[i, j] *= 0.5 + _behind_front(faces, work, x, k, width)
                continue
            excess = faces.couette[i, j] - faces.couette[i - 1, j]
            if not work.ruptured[i, j] or work.ruptured[i - 1, j] or excess <= 0.0:
                continue
            # what the gap widens by is filled by pressure to the share `wet`; a filling that the rest explains
            wet = min(1.0, max(0.0, 1.0 + faces.couette[i, j] * x[k, 0] / excess))
            leak = faces.along[i - 1, j] * (wet - 0.5) / (wet + 0.5)
            band[k - width, width] -= leak
            band[k, 0] += leak
            weight[i - 1, j] *= 1.0 + 0.5 * (wet - 0.5)
    return weight


@inner
def _behind_front(faces: FaceFlows, work: FilmWork, x: FloatArray, k: int, width: int) -> float:
    """How many steps behind the front where a film forms again its first wet node lies: the pressure jumps in slope."""
    i, j = k // width + 1, k % width + faces.across.shape[1] - width
    backward = faces.along[i - 1, j] * work.pressure[i, j]
    return backward / (backward - faces.couette[i - 1, j] * x[k - width, 0])


@inner
def _displaced(grid: FilmGrid, work: FilmWork, wedge: Wedge, faces: FaceFlows, x: FloatArray, rhs: FloatArray) -> None:
    """What more flows into a control volume when a or b grows and pressure and filling stay."""
    nt, width = faces.along.shape[0], faces.across.shape[1] - grid.first
    work.flow_x[:] = faces.couette
    for i in range(1, nt):
        for j in range(grid.first, faces.across.shape[1]):
            if work.ruptured[i, j]:
                work.flow_x[i, j] *= 1.0 + x[(i - 1) * width + j - grid.first, 0]
    along, across = face_slopes(grid, work, wedge, (faces.along, faces.across), None)
    for j in range(len(faces.follows)):
        if work.ruptured[0, j]:  # the supply follows the gap at the edge itself
            along[0, j, 0] = -faces.follows[j] * grid.cos[0]
            along[0, j, 1] = -faces.follows[j] * grid.sin[0]
    net_inflow(along, across, grid.first, rhs)


@inner
def _stored(
    grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, static: FloatArray, rhs: FloatArray
) -> None:
    """Minus the mass rho h theta that a control volume takes up when a or b grows, slowly.

    The filling of a ruptured node is that of the face downstream, where it is carried on; so is its mass.
    """
    nt, nz = work.pressure.shape[0] - 1, work.pressure.shape[1] - 1
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            size = grid.dx * grid.height[j]
            if work.ruptured[i, j]:
                mass = 0.5 * size * (work.density[i, j] + work.density[i + 1, j])
                filling, refill = 1.0 + x[k, 0], faces.height[i, j]
                rhs[k, 0] = mass * (filling * grid.cos_face[i] - refill * static[k, 0])
                rhs[k, 1] = mass * (filling * grid.sin_face[i] - refill * static[k, 1])
            else:
                rhs[k, 0] = size * work.density[i, j] * grid.cos[i]
                rhs[k, 1] = size * work.density[i, j] * grid.sin[i]
            if i == 1 and work.ruptured[0, j]:  # and the half volume at the edge
                filling = faces.follows[j] / faces.couette[0, j] * faces.height[0, j]
                mass = 0.25 * size * filling * (work.density[0, j] + work.density[1, j])
                rhs[k, 0] += mass * grid.cos[0]
                rhs[k, 1] += mass * grid.sin[0]


_MAX_STEPS = 4000
#: How many steps in a row may fail to lower the number of nodes on the wrong side before they change one at a time.
_PATIENCE = 8


@compiled
def solve_film_jfo(
    grid: FilmGrid,
    work: FilmWork,
    wedge: Wedge,
    speed: float,
    sharp: bool,
    supplied: tuple[float, float],
) -> FilmForces:
    """Pressure of one film and its derivatives, mass conserved where it is ruptured; `supplied`: see `face_flows`."""
    forces = solve_film(grid, work, wedge, speed, sharp)
    if forces.steps < 0:
        return forces
    faces = face_flows(grid, work, wedge, speed, supplied)
    _starved(work, faces)
    if not work.ruptured.any():
        return forces
    x = np.empty((work.unknown.shape[0], 1))
    steps = _pivot(grid, work, faces, x)
    _read(work, x, grid.first)
    force = np.zeros(2)
    stiffness = np.zeros((2, 2))
    damping = np.zeros((2, 2))
    if steps > 0:
        weight, slopes = _jfo_slopes(grid, work, wedge, faces, x, sharp)
        _leave_behind(grid, work, faces, slopes)
        force, stiffness, damping = _integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, forces.min_film, steps)


@inner
def _pivot(grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray) -> int:
    """Solve F(x) = 0 by block principal pivoting; returns the number of factorisations, -2 if it did not settle."""
    ruptured, first = work.ruptured, grid.first
    band = np.empty((x.shape[0], 2 * (work.band.shape[1] - 1) + 1))
    fewest, patience = ruptured.size + 1, _PATIENCE
    for step in range(1, _MAX_STEPS + 1):
        assemble_columns(band, faces, ruptured, first)
        factorise_general(band)
        _drag(work, faces, first, x)
        substitute_columns(band, x)
        wrong = _change_sides(x, ruptured, first, 0)
        _read(work, x, first)
        changed = _starved(work, faces)
        if wrong + changed == 0:
            return step
        if wrong + changed < fewest:
            fewest, patience = wrong + changed, _PATIENCE
        else:
            patience -= 1
        if changed == 0 or patience >= 0:
            _change_sides(x, ruptured, first, 1 if patience < 0 else ruptured.size)
    return -2


@inner
def _starved(work: FilmWork, faces: FaceFlows) -> int:
    """Mark where the gap behind the leading edge takes more than the supply; returns how many marks changed.

    The flow is the lesser of what is supplied and what a full gap would take against the pressure behind.
    """
    changed = 0
    for j in range(len(faces.supply)):
        asked = faces.couette[0, j] - faces.along[0, j] * (work.pressure[1, j] - work.pressure[0, j])
        lacking = asked > faces.supply[j]
        if lacking != work.ruptured[0, j]:
            work.ruptured[0, j] = lacking
            changed += 1
    return changed


@inner
def _drag(work: FilmWork, faces: FaceFlows, first: int, x: FloatArray) -> None:
    """Right-hand side: what the journal drags into each control volume of a full film less what it drags out."""
    couette, p = faces.couette, work.pressure
    width = faces.across.shape[1] - first
    for i in range(1, couette.shape[0]):
        for j in range(first, faces.across.shape[1]):
            into = couette[i - 1, j]
            if i == 1:  # the groove's pressure pushes where the gap is full
                into = faces.supply[j] if work.ruptured[0, j] else into + faces.along[0, j] * p[0, j]
            x[(i - 1) * width + j - first, 0] = into - couette[i, j]


@inner
def _change_sides(x: FloatArray, ruptured: BoolArray, first: int, most: int) -> int:
    """Move nodes that are on the wrong side: wet ones that pull, ruptured ones that are more than full.

    The last ones first, and `most` of them (one at a time cannot cycle: Murty's rule); returns how many there are.
    """
    nt, nz = ruptured.shape[0] - 1, ruptured.shape[1] - 1
    count = 0
    for i in range(nt - 1, 0, -1):
        for j in range(nz - 1, first - 1, -1):
            value = x[(i - 1) * (nz - first) + j - first, 0]
            if value > 0.0 if ruptured[i, j] else value < 0.0:
                if count < most:
                    ruptured[i, j] = not ruptured[i, j]
                count += 1
    return count


@inner
def _read(work: FilmWork, x: FloatArray, first: int) -> None:
    """Pressure at the nodes and at the unknowns; zero where ruptured."""
    nt, nz = work.pressure.shape[0] - 1, work.pressure.shape[1] - 1
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * (nz - first) + j - first
            work.unknown[k] = 0.0 if work.ruptured[i, j] else x[k, 0]
            work.pressure[i, j] = work.unknown[k]


@inner
def _leave_behind(grid: FilmGrid, work: FilmWork, faces: FaceFlows, slopes: FloatArray) -> None:
    """Factor and slopes of the film that is full now, for those who go on with them (heat, pads that bend)."""
    assemble(work.band, faces.along, faces.across, work.ruptured, grid.first)
    factorise(work.band)
    nt, nz = work.pressure.shape[0] - 1, work.pressure.shape[1] - 1
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            for m in range(4):
                work.slopes[k, m] = 0.0 if work.ruptured[i, j] else slopes[k, m]
