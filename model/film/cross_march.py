"""Temperatures across a film from its factorised heat balances: marched as answers, or for what a pad conducts."""

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_film import CrossOperator
from model.film.dense import gmres, times
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

_Three = tuple[float, float, float]
#: A film, the edges of its cells and the oil's conductivity.
_Solved = tuple[FilmGrid, FilmWork, FloatArray, float]


@compiled
def march_cross(operator: CrossOperator, fields: FloatArray, sources: FloatArray) -> FloatArray:
    """March three fields of oil that enters as they say; the first with sources, the third beside a journal.

    The equation is linear: the three are the answers to sources, to a kelvin of the inlet, and of the journal. Numbers
    that do not wait for one another cost little more than one.

    `fields` (nt + 1, n, 3) [degC], `sources` (nt, n) [W]; gives what the journal takes of each [W].
    """
    n, (lines, cells) = fields.shape[1], operator.carried.shape
    heat_flow = np.zeros(3)
    for i in range(operator.factor.shape[0]):
        band, before, journal = operator.factor[i], operator.before[i], operator.journal[i]
        old, new = fields[i], fields[i + 1]
        for k in range(n):
            coupling = 0.0  # a journal that is a kelvin warm for the third field
            if (k + 1) % cells == 0:
                coupling = journal[k // cells, 0] + journal[k // cells, 1]
            values = _plus((sources[i, k], 0.0, coupling), before[k, 0], old, k)
            for side in range(4):
                step = (1 if side < 2 else cells) * (2 * (side % 2) - 1)
                values = _plus(values, before[k, 1 + side], old, min(max(k + step, 0), n - 1))
            for s in range(min(cells, k), 0, -1):
                values = _plus(values, -band[k, cells - s], new, k - s)
            new[k, 0], new[k, 1], new[k, 2] = values
        for k in range(n - 1, -1, -1):
            values = (new[k, 0], new[k, 1], new[k, 2])
            for s in range(min(cells, n - 1 - k), 0, -1):
                values = _plus(values, -band[k, cells + s], new, k + s)
            for q in range(3):
                new[k, q] = values[q] * band[k, cells]
        for j in range(lines):
            k = j * cells + cells - 1
            for q in range(3):
                heat_flow[q] += journal[j, 0] * old[k, q] + journal[j, 1] * new[k, q]
            heat_flow[2] -= journal[j, 0] + journal[j, 1]
    return heat_flow


@inner
def _plus(values: _Three, weight: float, fields: FloatArray, row: int) -> _Three:
    """Three values and a row of the fields, weighted."""
    a, b, c = values
    return a + weight * fields[row, 0], b + weight * fields[row, 1], c + weight * fields[row, 2]


@compiled
def face_temperature(
    work: FilmWork, edges: FloatArray, conductivity: float, field: FloatArray, heat_flow: FloatArray, face: FloatArray
) -> None:
    """Temperature of the pad's face, from the two cells next to it and the heat flux into the pad.

    `edges` (cells + 1,), `taken` (nt + 1, nz + 1) [W/m^2], `face` (nt + 1, nz + 1) [degC].
    """
    cells = len(edges) - 1
    below, above = 0.5 * (edges[0] + edges[1]), 0.5 * (edges[1] + edges[2])
    slope = heat_flow * work.thickness / conductivity
    first, second = field[:, ::cells], field[:, 1::cells]
    bend = (second - first - slope * (above - below)) / (above * above - below * below)
    face[:] = first - slope * below - bend * below * below


@inner
def station_heat(grid: FilmGrid, flux: FloatArray) -> FloatArray:
    """What a heat flux density into the pad takes between two stations.

    `flux` (nt + 1, nz + 1) [W/m^2]; gives (nt, nz + 1) [W].
    """
    return 0.5 * grid.dx * (flux[1:] + flux[:-1]) * grid.height


@compiled
def conduct(
    film: _Solved,
    operator: CrossOperator,
    pad: tuple[FloatArray, FloatArray, FloatArray],
    missing: FloatArray,
    tolerance: float,
    answer: tuple[FloatArray, FloatArray],
) -> float:
    """Change temperatures so that the pad takes what it conducts at its face's new temperature, not at its old one.

    By how much the pad's coarser nodes change is found by GMRES; nothing is changed where it finds none.

    `missing` (nt + 1, nz + 1) [K]; gives what the journal takes besides [W].
    """
    fields, face = np.zeros((*answer[0].shape, 3)), np.empty(missing.shape)
    held = (film, operator, pad, fields, face)
    change = gmres(_warmed, held, times(pad[1], missing.reshape(-1)), tolerance)
    heat = _conducted(film, operator, times(pad[0], change), fields, face)
    if not math.isfinite(heat):
        return 0.0
    answer[0][:] += fields[:, :, 0]
    answer[1][:] += face
    return heat


@inner
def _warmed(
    held: tuple[_Solved, CrossOperator, tuple[FloatArray, FloatArray, FloatArray], FloatArray, FloatArray],
    rise: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """A change of the pad's coarser nodes, about the one that is asked for, and what the film leaves of it."""
    film, operator, (flux, to_coarse, guess), fields, face = held
    change = times(guess, rise)
    _conducted(film, operator, times(flux, change), fields, face)
    return change, change - times(to_coarse, face.reshape(-1))


@inner
def _conducted(film: _Solved, operator: CrossOperator, flux: FloatArray, fields: FloatArray, face: FloatArray) -> float:
    """Temperatures of cells (the first field) and face by a heat flux into the pad; what the journal takes [W]."""
    grid, work, edges, conductivity = film
    heat = flux.reshape(face.shape)
    sources = np.zeros(operator.dissipation.shape)
    sources[:, :: len(edges) - 1] = -station_heat(grid, heat)
    heat_flow = march_cross(operator, fields, sources)
    face_temperature(work, edges, conductivity, fields[:, :, 0], heat, face)
    return heat_flow[0]
