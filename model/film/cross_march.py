"""Temperatures across a film from its factorised heat balances: marched for many right-hand sides, or for one."""

from __future__ import annotations

import numpy as np

from model.arrays import FloatArray
from model.compilation import compiled, inner
from model.film.cross_energy import CrossOperator
from model.film.mesh import FilmWork


@compiled
def march_cross(operator: CrossOperator, fields: FloatArray, sources: FloatArray, journal: FloatArray) -> FloatArray:
    """March temperature fields that differ in inlet, sources and journal: the equation is linear.

    Parameters
    ----------
    operator : CrossOperator
    fields : (nt + 1, n, m) ndarray
        Station 0 holds the inlet; the rest is overwritten [degC].
    sources : (nt, n, m) ndarray
        Heat between two stations [W].
    journal : (m,) ndarray
        The journal's temperature [degC].

    Returns
    -------
    (m,) ndarray
        Heat that the journal takes up [W].
    """
    n, count = fields.shape[1], fields.shape[2]
    cells = operator.carried.shape[1]
    taken = np.zeros(count)
    for i in range(operator.factor.shape[0]):
        band, before = operator.factor[i], operator.before[i]
        old, new = fields[i], fields[i + 1]
        for k in range(n):
            m = k % cells
            for q in range(count):
                value = before[k, 0] * old[k, q] + sources[i, k, q]
                if m > 0:
                    value += before[k, 1] * old[k - 1, q]
                if m < cells - 1:
                    value += before[k, 2] * old[k + 1, q]
                else:
                    value += (before[k, 2] + operator.journal[i, k // cells, 1]) * journal[q]
                if k >= cells:
                    value += before[k, 3] * old[k - cells, q]
                if k + cells < n:
                    value += before[k, 4] * old[k + cells, q]
                new[k, q] = value
        _substitute(band, cells, new)
        for j in range(operator.journal.shape[1]):
            k = j * cells + cells - 1
            for q in range(count):
                taken[q] += operator.journal[i, j, 0] * (old[k, q] - journal[q])
                taken[q] += operator.journal[i, j, 1] * (new[k, q] - journal[q])
    return taken


@compiled
def march_one(operator: CrossOperator, field: FloatArray, sources: FloatArray) -> float:
    """`march_cross` for one field of fresh oil at zero beside a journal at zero, with sources in the lowest cells only.

    Parameters
    ----------
    operator : CrossOperator
    field : (nt + 1, n) ndarray
        Station 0 is zero; the rest is overwritten [K].
    sources : (nt, nz + 1) ndarray
        Heat between two stations [W].

    Returns
    -------
    float
        Heat that the journal takes up [W].
    """
    n, cells = field.shape[1], operator.carried.shape[1]
    taken = 0.0
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
            new[k] = value / band[k, cells]
        for j in range(operator.journal.shape[1]):
            k = j * cells + cells - 1
            taken += operator.journal[i, j, 0] * old[k] + operator.journal[i, j, 1] * new[k]
    return taken


@inner
def _substitute(band: FloatArray, width: int, x: FloatArray) -> None:
    n, count = x.shape
    for k in range(n):
        for r in range(1, min(width, k) + 1):
            scale = band[k, width - r]
            if scale != 0.0:
                for q in range(count):
                    x[k, q] -= scale * x[k - r, q]
    for k in range(n - 1, -1, -1):
        for r in range(1, min(width, n - 1 - k) + 1):
            scale = band[k, width + r]
            if scale != 0.0:
                for q in range(count):
                    x[k, q] -= scale * x[k + r, q]
        inverse = 1.0 / band[k, width]
        for q in range(count):
            x[k, q] *= inverse


@compiled
def face_temperature(
    work: FilmWork, edges: FloatArray, conductivity: float, field: FloatArray, taken: FloatArray, face: FloatArray
) -> None:
    """Temperature of the pad's face, from the two cells next to it and the heat flux into the pad.

    Parameters
    ----------
    work : FilmWork
    edges : (cells + 1,) ndarray
    conductivity : float
        Of the oil [W/m/K].
    field : (nt + 1, (nz + 1) cells) ndarray
        Temperature of the cells [degC].
    taken : (nt + 1, nz + 1) ndarray
        Heat flux density into the pad [W/m^2].
    face : (nt + 1, nz + 1) ndarray
        Overwritten [degC].
    """
    cells = len(edges) - 1
    one, two = 0.5 * (edges[0] + edges[1]), 0.5 * (edges[1] + edges[2])
    for i in range(face.shape[0]):
        for j in range(face.shape[1]):
            slope = taken[i, j] * work.thickness[i, j] / conductivity
            first, second = field[i, j * cells], field[i, j * cells + 1]
            bend = (second - first - slope * (two - one)) / (two * two - one * one)
            face[i, j] = first - slope * one - bend * one * one
