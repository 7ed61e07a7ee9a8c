"""Temperature and viscosity across the film's thickness: what they do to its flow (Dowson's generalised Reynolds).

At every node the film is cut into cells from the pad (eta = 0) to the journal (eta = 1), each with one temperature
and one viscosity. With the integrals over eta

    f0 = int 1/mu,   e = int eta/mu / f0,   f2 = int (eta - e)^2 / mu

the flow per width is  U h (1 - e) - f2 h^3 dp/dx  along and  - f2 h^3 dp/dz  across, the shear mu du/dy is
U / (h f0) + h (eta - e) dp/dx. All are exact for viscosities that are constant in each cell; one viscosity gives
e = 1/2 and f2 = 1 / (12 mu).

In a turbulent film eddies add to the viscosity and to the conduction of heat across (`model.film.turbulence`): f0 and
e are those of the film with them, f2 that of the oil, which Ng and Pan's factors lower; what flows then has the profile
of the film with eddies.

D. Dowson, Int. J. Mech. Sci. 4 (1962) 159, Eq. (22), with the density taken at the mean temperature.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork, OilConstants
from model.film.slopes import change_by_oil
from model.film.turbulence import ACROSS, ALONG, excess, still_shares
from rigdata.arrays import FloatArray

#: Cells across the film: the temperatures of pad and film move by less than 0.2 K with twice as many.
_CELLS = 6
#: Share of Chebyshev's spacing in that of the cells, the rest is uniform: thinner cells where the walls are.
_GRADING = 0.5


class CrossFilm(NamedTuple):
    """What one film holds across its thickness; n cells, from the pad to the journal."""

    edges: FloatArray  #: (n + 1,): Of the cells, eta = y / h from 0 at the pad to 1 at the journal.
    temperature: FloatArray  #: (nt + 1, nz + 1, n), degC
    face: FloatArray  #: (nt + 1, nz + 1): Of the pad's face [degC].
    fluidity: FloatArray  #: (nt + 1, nz + 1, n): 1 / mu, as the pressure was solved with [1/(Pa s)].
    shear: FloatArray  #: (nt + 1, nz + 1): 1 / f0, the viscosity that shears [Pa s].
    centre: FloatArray  #: (nt + 1, nz + 1): e.
    eddy: FloatArray  #: (nt + 1, nz + 1, n): What eddies add to the viscosity [Pa s], zero in a laminar film.
    mixing: FloatArray  #: (nt + 1, nz + 1, n): Conduction across over that of the oil at rest, 1 in a laminar film.
    #: (nt + 1, nz + 1, 2): Flow that pressure drives along and across, over that of the profile; 1 in a laminar film.
    driven: FloatArray


class CrossOperator(NamedTuple):
    """The heat balances of one film, factorised; n = (nz + 1) * cells unknowns per station, cells fastest."""

    #: (nt, n, 2 cells + 1): L and U of the balances at the later station, with 1 / U on the diagonal [W/K].
    factor: FloatArray
    #: (nt, n, 5): What the earlier station adds: by the cell itself, the cells below and above, the lines before
    #: and after; nothing beyond the film.
    before: FloatArray
    journal: FloatArray  #: (nt, nz + 1, 2): Exchange with the journal at the earlier and the later station [W/K].
    #: (nt, n): Dissipation [W], and what the balances take from it per kelvin, at the present temperature.
    dissipation: FloatArray
    carried: FloatArray  #: (nz + 1, cells): Heat carried over the trailing edge per kelvin [W/K].
    flows: FloatArray  #: (nt, nz + 1, cells): Mass flow of the cells from station to station [kg/s].

    @classmethod
    def place(cls, rows: int, lines: int, cells: int) -> CrossOperator:
        """Room for the balances of a film."""
        nt, n = rows - 1, lines * cells
        return cls(
            np.zeros((nt, n, 2 * cells + 1)),
            np.zeros((nt, n, 5)),
            np.zeros((nt, lines, 2)),
            np.zeros((nt, n)),
            np.zeros((lines, cells)),
            np.zeros((nt, lines, cells)),
        )


def cross_film(work: FilmWork, temperature: float, cells: int = _CELLS) -> CrossFilm:
    """Lay out a film of one temperature."""
    shape = work.temperature.shape
    uniform = np.arange(cells + 1) / cells
    edges = _GRADING * 0.5 * (1.0 - np.cos(np.pi * uniform)) + (1.0 - _GRADING) * uniform
    return CrossFilm(
        edges,
        np.full((*shape, cells), temperature),
        np.full(shape, temperature),
        np.ones((*shape, cells)),
        np.ones(shape),
        np.full(shape, 0.5),
        np.zeros((*shape, cells)),
        np.ones((*shape, cells)),
        np.ones((*shape, 2)),
    )


@compiled
def set_cross_viscosity(
    cross: CrossFilm,
    work: FilmWork,
    oil: OilConstants,
    turbulent: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Viscosities of the cells, and what the pressure solution needs of them.

    `turbulent`: the journal's speed and the oil's c / k [m s/kg]; a laminar film has none.
    """
    rows, columns, _ = cross.temperature.shape
    for i in range(rows):
        for j in range(columns):
            mean, f0, centre, f2 = _integrals(cross, i, j, oil)
            if turbulent[0] > 0.0:
                density = oil[2] * (1.0 + oil[3] * (40.0 - mean))
                reynolds = 12.0 * f2 * density * turbulent[0] * work.thickness[i, j]
                _set_eddies(cross, i, j, reynolds, turbulent[1])
                mean, f0, centre, f2 = _integrals(cross, i, j, oil)
            cross.shear[i, j], cross.centre[i, j] = 1.0 / f0, centre
            work.temperature[i, j] = mean
            work.density[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - mean))
            work.drag[i, j] = 2.0 * (1.0 - centre)
            work.viscosity[i, j] = 1.0 / (12.0 * f2)


@inner
def _set_eddies(cross: CrossFilm, i: int, j: int, reynolds: float, by_heat: float) -> None:
    """What eddies do at a node: `by_heat` is c / k of the oil [m s/kg]."""
    edges, calm, swirled, centre = cross.edges, 0.0, 0.0, cross.centre[i, j]
    for m in range(len(edges) - 1):
        fluidity = cross.fluidity[i, j, m]
        light = fluidity / (1.0 - fluidity * cross.eddy[i, j, m])
        sheared, warmed = still_shares(reynolds, (edges[m], edges[m + 1]), by_heat / light)
        cross.eddy[i, j, m] = (1.0 / sheared - 1.0) / light
        cross.mixing[i, j, m] = 1.0 / warmed
        wide = edges[m + 1] - edges[m]
        away = 0.5 * (edges[m + 1] + edges[m]) - centre
        calm += wide * light * (away * away + wide * wide / 12.0)
        swirled += wide * light * sheared * (away * away + wide * wide / 12.0)
    cross.driven[i, j, 0] = calm / swirled / (1.0 + excess(reynolds, ALONG)[0] / 12.0)
    cross.driven[i, j, 1] = calm / swirled / (1.0 + excess(reynolds, ACROSS)[0] / 12.0)


@inner
def _integrals(cross: CrossFilm, i: int, j: int, oil: OilConstants) -> tuple[float, float, float, float]:
    """Mean temperature, f0, e and f2 at a node; its cells' fluidity is set, at the eddies that there are."""
    edges = cross.edges
    mean, f0, f1 = 0.0, 0.0, 0.0
    oil0, oil1, oil2 = 0.0, 0.0, 0.0  # moments of the oil's own fluidity, without eddies
    for m in range(len(edges) - 1):
        wide, middle = edges[m + 1] - edges[m], 0.5 * (edges[m + 1] + edges[m])
        t = cross.temperature[i, j, m]
        light = np.exp(-oil[1] * (40.0 - t)) / oil[0]
        fluidity = light / (1.0 + light * cross.eddy[i, j, m])
        cross.fluidity[i, j, m] = fluidity
        mean += wide * t
        f0 += wide * fluidity
        f1 += wide * fluidity * middle
        oil0 += wide * light
        oil1 += wide * light * middle
        oil2 += wide * light * (middle * middle + wide * wide / 12.0)
    centre = f1 / f0
    return mean, f0, centre, oil2 - centre * (2.0 * oil1 - centre * oil0)


@compiled
def cross_pressure_change(
    grid: FilmGrid,
    work: FilmWork,
    cross: CrossFilm,
    speed: float,
    oil: OilConstants,
    change: FloatArray,
) -> tuple[float, float]:
    """Change of the pressure that new temperatures across the film will make.

    As `model.film.slopes.pressure_change`.
    """
    shape = work.temperature.shape
    lighter, denser = np.empty(shape), np.empty(shape)
    for i in range(shape[0]):
        for j in range(shape[1]):
            mean, _, centre, f2 = _integrals(cross, i, j, oil)
            density = oil[2] * (1.0 + oil[3] * (40.0 - mean))
            lighter[i, j] = density * 12.0 * f2 - work.density[i, j] / work.viscosity[i, j]
            denser[i, j] = density * 2.0 * (1.0 - centre) - work.density[i, j] * work.drag[i, j]
    return change_by_oil(grid, work, speed, (lighter, denser), change)
