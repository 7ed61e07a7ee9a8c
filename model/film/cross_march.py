"""Temperatures across a film from its factorised heat balances: marched as answers, or for what a pad conducts."""

from __future__ import annotations

from typing import Any

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_film import CrossOperator
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

#: GMRES steps at most; what they leave contracts with the rest.
_STEPS = 12
#: An answer beyond this is none [K^2].
_BOUNDLESS = 1e30


@compiled
def march_cross(operator: CrossOperator, fields: FloatArray, sources: FloatArray) -> FloatArray:
    """March three temperature fields: of fresh oil at zero with sources, per kelvin of the inlet, and of the journal.

    The equation is linear. Three numbers that do not wait for one another cost what one does.

    `fields` (nt + 1, n, 3) [degC], `sources` (nt, n) [W]; gives (3,) [W].
    """
    n, cells = fields.shape[1], operator.carried.shape[1]
    heat_flow = np.zeros(3)
    for i in range(operator.factor.shape[0]):
        band, before, journal = operator.factor[i], operator.before[i], operator.journal[i]
        old, new = fields[i], fields[i + 1]
        for k in range(n):
            m, weight = k % cells, before[k, 0]
            a, b, c = weight * old[k, 0] + sources[i, k], weight * old[k, 1], weight * old[k, 2]
            if m > 0:
                weight = before[k, 1]
                a, b, c = a + weight * old[k - 1, 0], b + weight * old[k - 1, 1], c + weight * old[k - 1, 2]
            weight = before[k, 2]
            if m < cells - 1:
                a, b, c = a + weight * old[k + 1, 0], b + weight * old[k + 1, 1], c + weight * old[k + 1, 2]
            else:
                c += weight + journal[k // cells, 1]
            if k >= cells:
                weight, r = before[k, 3], k - cells
                a, b, c = a + weight * old[r, 0], b + weight * old[r, 1], c + weight * old[r, 2]
            if k + cells < n:
                weight, r = before[k, 4], k + cells
                a, b, c = a + weight * old[r, 0], b + weight * old[r, 1], c + weight * old[r, 2]
            for s in range(max(0, cells - k), cells):
                weight, r = band[k, s], k - cells + s
                a, b, c = a - weight * new[r, 0], b - weight * new[r, 1], c - weight * new[r, 2]
            new[k, 0], new[k, 1], new[k, 2] = a, b, c
        for k in range(n - 1, -1, -1):
            a, b, c = new[k, 0], new[k, 1], new[k, 2]
            for s in range(cells + 1, cells + 1 + min(cells, n - 1 - k)):
                weight, r = band[k, s], k - cells + s
                a, b, c = a - weight * new[r, 0], b - weight * new[r, 1], c - weight * new[r, 2]
            weight = band[k, cells]
            new[k, 0], new[k, 1], new[k, 2] = a * weight, b * weight, c * weight
        for j in range(journal.shape[0]):
            k = j * cells + cells - 1
            for q in range(3):
                heat_flow[q] += journal[j, 0] * old[k, q] + journal[j, 1] * new[k, q]
            heat_flow[2] -= journal[j, 0] + journal[j, 1]
    return heat_flow


@inner
def march_one(operator: CrossOperator, field: FloatArray, sources: FloatArray) -> float:
    """`march_cross` for one field of fresh oil at zero beside a journal at zero.

    With sources in the lowest cells only.

    `field` (nt + 1, n) [K], `sources` (nt, nz + 1) [W].
    """
    n, cells = field.shape[1], operator.carried.shape[1]
    heat_flow = 0.0
    for i in range(operator.factor.shape[0]):
        band, before = operator.factor[i], operator.before[i]
        old, new = field[i], field[i + 1]
        for k in range(n):
            m = k % cells
            value = before[k, 0] * old[k]
            if m > 0:
                value += before[k, 1] * old[k - 1]
            else:
                value += sources[i, k // cells]
            if m < cells - 1:
                value += before[k, 2] * old[k + 1]
            if k >= cells:
                value += before[k, 3] * old[k - cells]
            if k + cells < n:
                value += before[k, 4] * old[k + cells]
            for r in range(max(0, cells - k), cells):
                value -= band[k, r] * new[k - cells + r]
            new[k] = value
        for k in range(n - 1, -1, -1):
            value = new[k]
            for r in range(cells + 1, cells + 1 + min(cells, n - 1 - k)):
                value -= band[k, r] * new[k - cells + r]
            new[k] = value * band[k, cells]
        for j in range(operator.journal.shape[1]):
            k = j * cells + cells - 1
            heat_flow += operator.journal[i, j, 0] * old[k] + operator.journal[i, j, 1] * new[k]
    return heat_flow


@compiled
def face_temperature(
    work: FilmWork, edges: FloatArray, conductivity: float, field: FloatArray, heat_flow: FloatArray, face: FloatArray
) -> None:
    """Temperature of the pad's face, from the two cells next to it and the heat flux into the pad.

    `edges` (cells + 1,), `taken` (nt + 1, nz + 1) [W/m^2], `face` (nt + 1, nz + 1) [degC].
    """
    cells = len(edges) - 1
    first_centre, second_centre = 0.5 * (edges[0] + edges[1]), 0.5 * (edges[1] + edges[2])
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
    limit, size, shape = tolerance * tolerance * np.dot(rhs, rhs), rhs.size, missing.shape
    steps, images, faces = np.empty((_STEPS, size)), np.empty((_STEPS, size)), np.empty((_STEPS, *shape))
    fields, heat_flow = np.empty((_STEPS, *answer[0].shape)), np.empty(_STEPS)
    gram, projections, residual = np.empty((_STEPS, _STEPS)), np.empty(_STEPS), rhs
    weights: Any = np.empty(0)
    for k in range(_STEPS):
        steps[k] = np.dot(guess, residual)
        steps[k] /= np.sqrt(np.dot(steps[k], steps[k]))
        heat_flow[k] = _conducted(film, operator, np.dot(flux, steps[k]), fields[k], faces[k])
        images[k] = steps[k] - np.dot(to_coarse, faces[k].ravel())
        gram[k, : k + 1] = np.dot(images[: k + 1], images[k])
        gram[: k + 1, k] = gram[k, : k + 1]
        if not gram[k, k] < _BOUNDLESS:
            return np.nan
        gram[k, k] *= 1.0 + 1e-13  # images that hardly differ are of no use to each other
        projections[k] = np.dot(images[k], rhs)
        weights = np.linalg.solve(gram[: k + 1, : k + 1].copy(), projections[: k + 1])
        residual = rhs - np.dot(weights, images[: k + 1])
        if np.dot(residual, residual) < limit:
            break
    more = 0.0
    for k in range(weights.size):
        more += weights[k] * heat_flow[k]
        answer[0][:] += weights[k] * fields[k]
        answer[1][:] += weights[k] * faces[k]
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
    field[0] = 0.0
    heat_flow = march_one(operator, field, -station_heat(grid, heat))
    face_temperature(work, edges, conductivity, field, heat, face)
    return heat_flow
