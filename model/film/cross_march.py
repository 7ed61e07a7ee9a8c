"""Temperatures across a film from its factorised heat balances: marched as answers, or for what a pad conducts."""

from typing import Any

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_film import CrossOperator
from model.film.dense import product, residual, times
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

#: GMRES steps at most; what they leave contracts with the rest.
_STEPS = 12
#: An answer beyond this is none [K^2].
_BOUNDLESS = 1e30


def _marching(count: int) -> Any:
    """`march_cross` for three fields, or one: numbers that do not wait for one another cost little more than one."""
    one, other = 1 % count, 2 % count

    @inner
    def march_fields(operator: CrossOperator, fields: FloatArray, sources: FloatArray) -> FloatArray:
        n, (lines, cells) = fields.shape[1], operator.carried.shape
        heat_flow = np.zeros(count)
        for i in range(operator.factor.shape[0]):
            band, before, journal = operator.factor[i], operator.before[i], operator.journal[i]
            old, new = fields[i], fields[i + 1]
            for k in range(n):
                weight = before[k, 0]
                a, b, c = weight * old[k, 0] + sources[i, k], weight * old[k, one], weight * old[k, other]
                for side in range(4):
                    step = (1 if side < 2 else cells) * (2 * (side % 2) - 1)
                    weight, r = before[k, 1 + side], min(max(k + step, 0), n - 1)
                    a, b, c = a + weight * old[r, 0], b + weight * old[r, one], c + weight * old[r, other]
                if (k + 1) % cells == 0:  # beside a journal that is a kelvin warm for the third field
                    c += journal[k // cells, 0] + journal[k // cells, 1]
                for s in range(min(cells, k), 0, -1):
                    weight, r = band[k, cells - s], k - s
                    a, b, c = a - weight * new[r, 0], b - weight * new[r, one], c - weight * new[r, other]
                new[k, 0] = a
                if count == 3:
                    new[k, 1], new[k, 2] = b, c
            for k in range(n - 1, -1, -1):
                a, b, c = new[k, 0], new[k, one], new[k, other]
                for s in range(min(cells, n - 1 - k), 0, -1):
                    weight, r = band[k, cells + s], k + s
                    a, b, c = a - weight * new[r, 0], b - weight * new[r, one], c - weight * new[r, other]
                new[k, 0] = a * band[k, cells]
                if count == 3:
                    new[k, 1], new[k, 2] = b * band[k, cells], c * band[k, cells]
            for j in range(lines):
                k = j * cells + cells - 1
                for q in range(count):
                    heat_flow[q] += journal[j, 0] * old[k, q] + journal[j, 1] * new[k, q]
                if count == 3:
                    heat_flow[2] -= journal[j, 0] + journal[j, 1]
        return heat_flow

    return march_fields


_march_one, _march_three = _marching(1), _marching(3)


@compiled
def march_cross(operator: CrossOperator, fields: FloatArray, sources: FloatArray) -> FloatArray:
    """March temperature fields: of oil that enters as `fields` say; the first with sources, the third beside a journal.

    The equation is linear: the three are the answers to sources, to a kelvin of the inlet, and of the journal. One
    alone is that of the sources.

    `fields` (nt + 1, n, 1 or 3) [degC], `sources` (nt, n) [W]; gives what the journal takes of each [W].
    """
    return _march_three(operator, fields, sources) if fields.shape[2] == 3 else _march_one(operator, fields, sources)


@compiled
def face_temperature(
    work: FilmWork, edges: FloatArray, conductivity: float, field: FloatArray, heat_flow: FloatArray, face: FloatArray
) -> None:
    """Temperature of the pad's face, from the two cells next to it and the heat flux into the pad.

    `edges` (cells + 1,), `taken` (nt + 1, nz + 1) [W/m^2], `face` (nt + 1, nz + 1) [degC].
    """
    cells = len(edges) - 1
    first_centre = 0.5 * (edges[0] + edges[1])
    second_centre = 0.5 * (edges[1] + edges[2])
    for i in range(face.shape[0]):
        for j in range(face.shape[1]):
            slope = heat_flow[i, j] * work.thickness[i, j] / conductivity
            first, second = field[i, j * cells], field[i, j * cells + 1]
            bend = (second - first - slope * (second_centre - first_centre)) / (
                second_centre * second_centre - first_centre * first_centre
            )
            face[i, j] = first - slope * first_centre - bend * first_centre * first_centre


@inner
def station_heat(grid: FilmGrid, flux: FloatArray) -> FloatArray:
    """What a heat flux density into the pad takes between two stations.

    `flux` (nt + 1, nz + 1) [W/m^2]; gives (nt, nz + 1) [W].
    """
    return 0.5 * grid.dx * (flux[1:] + flux[:-1]) * grid.height


@compiled
def conduct(
    film: tuple[FilmGrid, FilmWork, FloatArray, float],
    operator: CrossOperator,
    pad: tuple[FloatArray, FloatArray, FloatArray],
    missing: FloatArray,
    tolerance: float,
    answer: tuple[FloatArray, FloatArray],
) -> float:
    """Change temperatures so that the pad takes what it conducts at its face's new temperature, not at its old one.

    By how much the pad's coarser nodes change is found by GMRES.

    `missing` (nt + 1, nz + 1) [K].
    """
    flux, to_coarse, guess = pad
    rhs = times(to_coarse, missing.reshape(-1))
    limit = tolerance * np.sqrt(product(rhs, rhs))
    steps = np.empty((_STEPS, rhs.size))
    images = np.empty((_STEPS, rhs.size))
    faces = np.empty((_STEPS, missing.shape[0], missing.shape[1]))
    fields = np.empty((_STEPS, *answer[0].shape))
    heat_flow = np.empty(_STEPS)
    weights = np.empty((_STEPS, 1))
    left = rhs.copy()
    count = 0
    while count < _STEPS:
        step = times(guess, left)
        steps[count] = step / np.sqrt(product(step, step))
        heat_flow[count] = _conducted(film, operator, times(flux, steps[count]), fields[count], faces[count])
        images[count] = steps[count] - times(to_coarse, faces[count].reshape(-1))
        if not product(images[count], images[count]) < _BOUNDLESS:
            return np.nan
        count += 1
        if residual(images, count, rhs, weights, left) < limit:
            break
    more = 0.0
    for k in range(count):
        more += weights[k, 0] * heat_flow[k]
        answer[0][:] += weights[k, 0] * fields[k]
        answer[1][:] += weights[k, 0] * faces[k]
    return more


@inner
def _conducted(
    film: tuple[FilmGrid, FilmWork, FloatArray, float],
    operator: CrossOperator,
    flux: FloatArray,
    field: FloatArray,
    face: FloatArray,
) -> float:
    """Temperatures of cells and face that a heat flux into the pad makes; what the journal takes up for it [W]."""
    grid, work, edges, conductivity = film
    heat = flux.reshape(face.shape)
    sources = np.zeros(operator.dissipation.shape)
    sources[:, :: len(edges) - 1] = -station_heat(grid, heat)
    fields = field.reshape((*field.shape, 1))
    field[0] = 0.0
    heat_flow = _march_one(operator, fields, sources)
    face_temperature(work, edges, conductivity, field, heat, face)
    return heat_flow[0]
