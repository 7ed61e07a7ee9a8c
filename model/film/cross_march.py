"""Temperatures across a film from its factorised heat balances: marched as answers, or for what a pad conducts."""

from __future__ import annotations

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_film import CrossOperator
from model.film.dense import nearest, product
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

#: GMRES steps at most; what they leave contracts with the rest.
_STEPS = 12
#: An answer beyond this is none [K^2].
_BOUNDLESS = 1e30


@compiled
def march_cross(operator: CrossOperator, fields: FloatArray, sources: FloatArray) -> FloatArray:
    """March temperature fields: of oil that enters as `fields` say; the first with sources, the third beside a journal.

    The equation is linear: the three are the answers to sources, to a kelvin of the inlet, and of the journal. One
    alone is that of the sources. What does not wait for one another costs little more than one.

    `fields` (nt + 1, n, 1 or 3) [degC], `sources` (nt, n) [W]; gives what the journal takes of each [W].
    """
    n, count, cells = fields.shape[1], fields.shape[2], operator.carried.shape[1]
    heat_flow = np.zeros(count)
    for i in range(operator.factor.shape[0]):
        band, before, journal = operator.factor[i], operator.before[i], operator.journal[i]
        old, new = fields[i], fields[i + 1]
        for k in range(n):
            m, from_journal = k % cells, 0.0
            if m == cells - 1 and count == 3:
                from_journal = before[k, 2] + journal[k // cells, 1]
            for q in range(count):
                value = before[k, 0] * old[k, q]
                if q == 0:
                    value += sources[i, k]
                if q == count - 1:
                    value += from_journal
                if m > 0:
                    value += before[k, 1] * old[k - 1, q]
                if m < cells - 1:
                    value += before[k, 2] * old[k + 1, q]
                if k >= cells:
                    value += before[k, 3] * old[k - cells, q]
                if k + cells < n:
                    value += before[k, 4] * old[k + cells, q]
                for s in range(max(0, cells - k), cells):
                    value -= band[k, s] * new[k - cells + s, q]
                new[k, q] = value
        for k in range(n - 1, -1, -1):
            for q in range(count):
                value = new[k, q]
                for s in range(cells + 1, cells + 1 + min(cells, n - 1 - k)):
                    value -= band[k, s] * new[k - cells + s, q]
                new[k, q] = value * band[k, cells]
        for j in range(journal.shape[0]):
            k = j * cells + cells - 1
            for q in range(count):
                heat_flow[q] += journal[j, 0] * old[k, q] + journal[j, 1] * new[k, q]
            if count == 3:
                heat_flow[2] -= journal[j, 0] + journal[j, 1]
    return heat_flow


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

    By how much the pad's coarser nodes change is found by GMRES: Y. Saad, SIAM J. Sci. Comput. 14 (1993) 461.

    `missing` (nt + 1, nz + 1) [K].
    """
    flux, to_coarse, guess = pad
    rhs = np.dot(to_coarse, missing.copy().ravel())
    limit = tolerance * tolerance * np.dot(rhs, rhs)
    size = rhs.size
    shape = missing.shape
    steps = np.empty((_STEPS, size))
    images = np.empty((_STEPS, size))
    faces = np.empty((_STEPS, *shape))
    fields = np.empty((_STEPS, *answer[0].shape))
    heat_flow = np.empty(_STEPS)
    weights = np.empty((_STEPS, 1))
    residual = rhs.copy()
    count = 0
    for k in range(_STEPS):
        steps[k] = np.dot(guess, residual)
        steps[k] /= np.sqrt(np.dot(steps[k], steps[k]))
        heat_flow[k] = _conducted(film, operator, np.dot(flux, steps[k]), fields[k], faces[k])
        images[k] = steps[k] - np.dot(to_coarse, faces[k].ravel())
        if not product(images[k], images[k]) < _BOUNDLESS:
            return np.nan
        count = k + 1
        nearest(images, count, rhs, 1e-13, weights)
        residual[:] = rhs
        for r in range(count):
            residual -= weights[r, 0] * images[r]
        if np.dot(residual, residual) < limit:
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
    heat_flow = march_cross(operator, fields, sources)
    face_temperature(work, edges, conductivity, field, heat, face)
    return heat_flow[0]
