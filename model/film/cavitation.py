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

Row by row the matrix says what flows out of a control volume less what flows in. The column of a wet node is that of
its pressure; the column of a ruptured node is that of its filling, which the journal drags downstream only. Either
has non-positive entries beside the diagonal and sums to zero or more, so that every mixture is factorised without
pivoting. Not symmetric: banded L U.

B. Jakobsson, L. Floberg, Trans. Chalmers Univ. 190 (1957); K.-O. Olsson, ibid. 308 (1965); M. Giacopini et al., ASME
J. Tribology 132 (2010) 041702 (complementarity); L. Portugal, J. Judice, L. Vicente, Math. Comp. 63 (1994) 625
(block principal pivoting).
"""

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.faces import Faces, film_faces, net_inflow
from model.film.matrix import assemble, factorise, factorise_general, substitute_general
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.reynolds import FilmForces, integrate, solve_film
from model.film.slopes import keep_ruptured, pass_on
from rigdata.arrays import FloatArray

_MAX_STEPS = 4000
#: How many steps in a row may fail to lower the number of nodes on the wrong side before they change one at a time.
_PATIENCE = 8


class FedFilm(NamedTuple):
    """A film, its faces as if it were full, and what it is fed."""

    grid: FilmGrid
    work: FilmWork
    faces: Faces
    #: (nz + 1,): What the journal drags over the leading edge at most [kg/s], be it that a gap that opens there is
    #: not filled, or that the groove gives no more; and how that grows with the gap [kg/s/m].
    supply: FloatArray
    follows: FloatArray


@compiled
def fed_film(grid: FilmGrid, work: FilmWork, wedge: Wedge, speed: float, supplied: tuple[float, float]) -> FedFilm:
    """`supplied`: share of the gap at the leading edge that is filled at most, and what the groove gives [kg/s/m]."""
    supply, follows = supplied[1] * grid.height, np.zeros(len(grid.height))
    for j in range(len(supply)):
        dragged = 0.5 * supplied[0] * speed * work.density[0, j] * work.drag[0, j] * grid.height[j]
        # a groove without pressure fills no gap that opens
        if work.pressure[0, j] == 0.0 and dragged * work.thickness[0, j] <= supply[j]:
            supply[j], follows[j] = dragged * work.thickness[0, j], dragged
    return FedFilm(grid, work, film_faces(grid, work, wedge, speed), supply, follows)


@compiled
def solve_film_jfo(
    grid: FilmGrid,
    work: FilmWork,
    wedge: Wedge,
    speed: float,
    sharp: bool,
    supplied: tuple[float, float],
) -> FilmForces:
    """Pressure of one film and its derivatives, mass conserved where it is ruptured; `supplied`: see `fed_film`."""
    forces = solve_film(grid, work, wedge, speed, sharp)
    if forces.steps < 0:
        return forces
    film = fed_film(grid, work, wedge, speed, supplied)
    _starved(film)
    full = True
    for ruptured in work.ruptured.reshape(-1):  # numpy's own question would load scipy
        full = full and not ruptured
    if full:
        return forces
    x, band = np.empty((len(work.unknown), 1)), np.empty((len(work.unknown), 2 * work.band.shape[1] - 1))
    steps = _pivot(film, band, x)
    if steps < 0:
        return FilmForces(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), forces.min_film, steps)
    _assemble_columns(film, band)
    weight = _rupture_line(film, x, band) if sharp else grid.area
    factorise_general(band)
    _set_slopes(film, x, band)
    # factor and slopes of the film that is full now, for those who go on with them (heat, pads that bend)
    assemble(grid, work, film.faces)
    factorise(work.band)
    keep_ruptured(grid, work, work.slopes)
    force, stiffness, damping = integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, forces.min_film, steps)


@inner
def _pivot(film: FedFilm, band: FloatArray, x: FloatArray) -> int:
    """Solve F(x) = 0 by block principal pivoting; returns the number of factorisations, -2 if it did not settle."""
    ruptured, p = film.work.ruptured.reshape(-1), film.work.pressure.reshape(-1)
    fewest, patience = len(ruptured) + 1, _PATIENCE
    for step in range(1, _MAX_STEPS + 1):
        _assemble_columns(film, band)
        factorise_general(band)
        _drag(film, x[:, 0])
        substitute_general(band, x)
        wrong = _change_sides(film, x, 0)
        for k, n in enumerate(film.grid.node):
            film.work.unknown[k] = p[n] = 0.0 if ruptured[n] else x[k, 0]
        changed = _starved(film)
        if wrong + changed == 0:
            return step
        if wrong + changed < fewest:
            fewest, patience = wrong + changed, _PATIENCE
        else:
            patience -= 1
        if changed == 0 or patience >= 0:
            _change_sides(film, x, 1 if patience < 0 else len(ruptured))
    return -2


@inner
def _assemble_columns(film: FedFilm, band: FloatArray) -> None:
    """Fill the band (n, 2 width + 1): entry (row, column) stands at ``band[row, width + column - row]``."""
    grid, (along, across), couette = film.grid, film.faces.conductance, film.faces.couette[0]
    ruptured, width, line = film.work.ruptured.reshape(-1), band.shape[1] // 2, film.grid.steps[0]
    band[:] = 0.0
    for k in range(len(band)):
        n = grid.node[k]
        if ruptured[n]:
            band[k, width] = couette[n]
            if k + width < len(band):
                band[k + width, 0] = -couette[n]
            continue
        band[k, width] = along[n] + across[n] + across[n - 1]
        if k >= width or not ruptured[n - line]:  # what is supplied to a gap that opens does not ask for the pressure
            band[k, width] += along[n - line]
        if k >= width:
            band[k - width, 2 * width] = -along[n - line]
        if k + width < len(band):
            band[k + width, 0] = -along[n]
        if (k + 1) % width != 0:
            band[k + 1, width - 1] -= across[n]
        if k % width != 0:
            band[k - 1, width + 1] -= across[n - 1]


@inner
def _starved(film: FedFilm) -> int:
    """Mark where the gap behind the leading edge takes more than the supply; returns how many marks changed.

    The flow is the lesser of what is supplied and what a full gap would take against the pressure behind.
    """
    changed, p, faces = 0, film.work.pressure, film.faces
    for j in range(len(film.supply)):
        demand = faces.couette[0, j] - faces.conductance[0, j] * (p[1, j] - p[0, j])
        lacking = demand > film.supply[j]
        if lacking != film.work.ruptured[0, j]:
            film.work.ruptured[0, j] = lacking
            changed += 1
    return changed


@inner
def _drag(film: FedFilm, inflow: FloatArray) -> None:
    """Right-hand side: what the journal drags into each control volume of a full film less what it drags out."""
    faces = film.faces
    net_inflow(film.grid, faces.couette, inflow)
    for k in range(film.work.band.shape[1] - 1):
        j = film.grid.first + k
        if film.work.ruptured[0, j]:
            inflow[k] += film.supply[j] - faces.couette[0, j]
        else:  # the groove's pressure pushes where the gap is full
            inflow[k] += faces.conductance[0, j] * film.work.pressure[0, j]


@inner
def _change_sides(film: FedFilm, x: FloatArray, most: int) -> int:
    """Move nodes that are on the wrong side: wet ones that pull, ruptured ones that are more than full.

    The last ones first, and `most` of them (one at a time cannot cycle: Murty's rule); returns how many there are.
    """
    ruptured, count = film.work.ruptured.reshape(-1), 0
    for k in range(len(x) - 1, -1, -1):
        n = film.grid.node[k]
        if x[k, 0] > 0.0 if ruptured[n] else x[k, 0] < 0.0:
            if count < most:
                ruptured[n] = not ruptured[n]
            count += 1
    return count


@inner
def _rupture_line(film: FedFilm, x: FloatArray, band: FloatArray) -> FloatArray:
    """Where between two nodes the film ruptures: as in `model.film.slopes`; here what flows is kept in balance."""
    grid, ruptured, couette = film.grid, film.work.ruptured.reshape(-1), film.faces.couette[0]
    p, along, line = film.work.pressure.reshape(-1), film.faces.conductance[0], film.grid.steps[0]
    weight, width = grid.area.copy(), band.shape[1] // 2
    sizes = weight.reshape(-1)
    for k in range(width, len(band)):
        n = grid.node[k]
        before = n - line
        if ruptured[before] and not ruptured[n]:
            # so many steps behind the front where a film forms again: there the pressure jumps in slope
            backward = along[before] * p[n]
            sizes[n] *= 0.5 + backward / (backward - couette[before] * x[k - width, 0])
        excess = couette[n] - couette[before]
        if not ruptured[n] or ruptured[before] or excess <= 0.0:
            continue
        # what the gap widens by is filled by pressure to the share `wet`; a filling that the rest explains
        wet = min(1.0, max(0.0, 1.0 + couette[n] * x[k, 0] / excess))
        leak = along[before] * (wet - 0.5) / (wet + 0.5)
        band[k - width, width] -= leak
        band[k, 0] += leak
        sizes[before] *= 1.0 + 0.5 * (wet - 0.5)
    return weight


@inner
def _set_slopes(film: FedFilm, x: FloatArray, band: FloatArray) -> None:
    """Solve for the derivatives by a, b, da/dt, db/dt; then the mass flows of a full film, with which heat goes."""
    grid, faces, slopes = film.grid, film.faces, film.work.slopes
    static, rate = slopes[:, :2], slopes[:, 2:]
    carried = faces.couette.copy()
    for k, n in enumerate(grid.node):
        if film.work.ruptured.reshape(-1)[n]:
            carried[0, n] *= 1.0 + x[k, 0]
    by_a, by_b = pass_on(grid, film.work, Faces(faces.height, faces.conductance, carried, faces.power))
    for j in range(len(film.follows)):
        if film.work.ruptured[0, j]:  # the supply follows the gap at the edge itself
            by_a[0, j] = -film.follows[j] * grid.cos[0]
            by_b[0, j] = -film.follows[j] * grid.sin[0]
    net_inflow(grid, by_a, static[:, 0])
    net_inflow(grid, by_b, static[:, 1])
    substitute_general(band, static)
    _store(film, grid.cos_face, x[:, 0], static[:, 0], rate[:, 0])
    _store(film, grid.sin_face, x[:, 0], static[:, 1], rate[:, 1])
    substitute_general(band, rate)
    pass_on(grid, film.work, faces)


@inner
def _store(film: FedFilm, shape: FloatArray, x: FloatArray, static: FloatArray, stored: FloatArray) -> None:
    """Minus the mass rho h theta that a control volume takes up when a or b grows, slowly.

    The filling of a ruptured node is that of the face downstream, where it is carried on; so is its mass.
    """
    grid, faces, line = film.grid, film.faces, film.grid.steps[0]
    density, ruptured = film.work.density.reshape(-1), film.work.ruptured.reshape(-1)
    for k, n in enumerate(grid.node):
        j = n % line
        size = grid.dx * grid.height[j]
        if ruptured[n]:
            mass = 0.5 * size * (density[n] + density[n + line])
            stored[k] = mass * ((1.0 + x[k]) * shape[0, n] - faces.height[0, n] * static[k])
        else:
            stored[k] = size * density[n] * shape[1, n]
        if n < 2 * line and ruptured[j]:  # and the half volume at the edge
            filling = film.follows[j] / faces.couette[0, j] * faces.height[0, j]
            stored[k] += 0.25 * size * filling * (density[j] + density[n]) * shape[1, j]
