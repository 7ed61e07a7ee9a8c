"""Pads that give way, on the arrays of a compiled search: what `model.pad.bending` does, pad by pad in one call."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from model.compilation import inner
from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import conductances
from model.film.slopes import shape_slopes
from model.pad.bending import PadDeformation
from model.statics.compiled.stack import GridStack, PadStack, PadState, grid_of, work_of
from rigdata.arrays import FloatArray, IntArray


class BodyStack(NamedTuple):
    """The matrices of k different pads and which of them the films have; n = (nt + 1)(nz + 1) film nodes."""

    which: IntArray  #: (pads,) of int: Body of every film; empty for rigid pads.
    #: (k, n, unknowns + c) of float32: Deformation by the pressure at the unknown nodes [m/Pa] and by the
    #: temperatures of the pad's coarser nodes [m/K]: half the memory, which is what the product waits for, at a
    #: ten-millionth of a deformation.
    answer: np.ndarray
    to_coarse: np.ndarray  #: (k, c, n) of float32: Those temperatures by the film's.
    shapes: FloatArray  #: (k, nt + 1, nz + 1, m)
    amplitudes: FloatArray  #: (k, m, n)
    response: FloatArray  #: (k, m, unknowns)
    #: (k, 2, unknowns): See `model.pad.bending.PadDeformation`; the factor on the deformation is in `answer` and
    #: `response`.
    weights: FloatArray
    supply: float


class Shapes(NamedTuple):
    """The films' meshes and the bodies of their pads."""

    grids: GridStack
    bodies: BodyStack


def stacked_bodies(
    bodies: tuple[PadDeformation, ...], unknown: tuple[int, int], factor: float, supply: float
) -> BodyStack:
    """Matrices of the pads side by side."""
    if not bodies:
        return _RIGID._replace(supply=supply)
    return _stacked(bodies, unknown, factor)._replace(supply=supply)


@lru_cache(maxsize=8)
def _stacked(bodies: tuple[PadDeformation, ...], unknown: tuple[int, int], factor: float) -> BodyStack:
    kinds = list(dict.fromkeys(bodies))
    first, across = unknown
    inner = np.zeros((kinds[0].compliance.shape[0] // across, across), dtype=bool)
    inner[1:-1, first:-1] = True
    answer = [factor * np.hstack([b.compliance[:, inner.ravel()], b.expansion]) for b in kinds]
    return BodyStack(
        np.array([kinds.index(b) for b in bodies]),
        np.array(answer, dtype=np.float32),
        np.array([b.to_coarse for b in kinds], dtype=np.float32),
        np.array([b.shapes for b in kinds]),
        np.array([b.amplitudes for b in kinds]),
        np.array([factor * b.response for b in kinds]),
        np.array([b.weights for b in kinds]),
        0.0,
    )


_NOTHING = np.zeros((0, 0, 0))
_RIGID = BodyStack(
    np.zeros(0, dtype=np.int64),
    _NOTHING.astype(np.float32),
    _NOTHING.astype(np.float32),
    np.zeros((0, 0, 0, 0)),
    _NOTHING,
    _NOTHING,
    _NOTHING,
    0.0,
)


@inner
def bend_pads(shapes: Shapes, pads: PadStack, works: FilmWork, state: PadState) -> float:
    """Close the loop of pressure and deformation for every pad that carries."""
    grids, bodies = shapes
    count = len(state.tilt)
    unknowns, coarse, across = works.unknown.shape[1], bodies.to_coarse.shape[1], state.bent.shape[2]
    rise, given = np.zeros((count, state.bent[0].size)), np.zeros((count, unknowns + coarse))
    bends = np.zeros(count, dtype=np.bool_)
    for m in range(count):
        bends[m] = state.solved[m] and state.steps[m] > 0
        if bends[m]:
            for q in range(rise.shape[1]):
                rise[m, q] = works.temperature[m, q // across, q % across] - bodies.supply
            for q in range(unknowns):
                given[m, q] = works.unknown[m, q] + state.shift[m, q]
    asked, change = np.empty((count, state.bent[0].size)), np.empty(state.bent.shape[1:])
    same = np.empty(count, dtype=np.int64)
    for k in range(bodies.answer.shape[0]):
        some = 0
        for m in range(count):
            if bends[m] and bodies.which[m] == k:
                same[some] = m
                some += 1
        _times(bodies.to_coarse[k], rise, same[:some], given[:, unknowns:])
        _times(bodies.answer[k], given, same[:some], asked)
    share = 0.0
    for m in range(count):
        if bends[m]:
            largest = 0.0
            for q in range(asked.shape[1]):
                i, j = q // across, q % across
                change[i, j] = asked[m, q] - state.bent[m, i, j]
                if not largest >= abs(change[i, j]) and largest == largest:  # a NaN is not to be lost
                    largest = abs(change[i, j])
            share = max(share, largest / state.least[m])
            film = (grid_of(grids, m), work_of(works, m))
            _close_loop(film, pads, state, bodies, m, change)
    return share


@inner
def _times(matrix: np.ndarray, given: FloatArray, rows: IntArray, out: FloatArray) -> None:
    """Product of a matrix with some rows of `given`, four at a time for every row of the matrix that is read."""
    some = len(rows)
    for start in range(0, some, 4):
        one, two = given[rows[start]], given[rows[min(start + 1, some - 1)]]
        three, four = given[rows[min(start + 2, some - 1)]], given[rows[min(start + 3, some - 1)]]
        for i in range(matrix.shape[0]):
            row = matrix[i]
            a = b = c = d = 0.0
            for q in range(len(row)):
                value = np.float64(row[q])
                a += value * one[q]
                b += value * two[q]
                c += value * three[q]
                d += value * four[q]
            out[rows[start], i] = a
            out[rows[min(start + 1, some - 1)], i] = b
            out[rows[min(start + 2, some - 1)], i] = c
            out[rows[min(start + 3, some - 1)], i] = d


@inner
def _close_loop(
    film: tuple[FilmGrid, FilmWork], pads: PadStack, state: PadState, bodies: BodyStack, m: int, change: FloatArray
) -> None:
    """One pad's part of a Newton step, see `model.pad.bending.bending_step`."""
    grid, work = film
    k = bodies.which[m]
    shapes, amplitudes, response = bodies.shapes[k], bodies.amplitudes[k], bodies.response[k]
    a, b = state.wedge[m, 0], state.wedge[m, 1]
    slopes = shape_slopes(grid, work, conductances(grid, work, pads.clearance[m], a, b), shapes)
    count, unknowns = response.shape
    matrix, right = np.zeros((count, count)), np.zeros((count, 3))
    felt = np.zeros((2, count))
    for r in range(count):
        matrix[r, r] = 1.0
        q = 0
        for i in range(change.shape[0]):
            for j in range(change.shape[1]):
                right[r, 0] += amplitudes[r, q] * change[i, j]
                q += 1
    own = right[:, 0].copy()
    for q in range(unknowns):
        for r in range(count):
            value = response[r, q]
            right[r, 1] += value * work.slopes[q, 0]
            right[r, 2] += value * work.slopes[q, 1]
            for s in range(count):
                matrix[r, s] -= value * slopes[q, s]
        for s in range(count):
            felt[0, s] += bodies.weights[k, 0, q] * slopes[q, s]
            felt[1, s] += bodies.weights[k, 1, q] * slopes[q, s]
    _solve(matrix, right)
    for r in range(count):
        state.amplitude[m, r] = right[r]
        for axis in range(2):
            state.felt[m, axis] += felt[axis, r] * right[r, 0]
            state.felt_stiffness[m, axis, 0] += felt[axis, r] * right[r, 1]
            state.felt_stiffness[m, axis, 1] += felt[axis, r] * right[r, 2]
    for i in range(change.shape[0]):
        for j in range(change.shape[1]):
            total = change[i, j]
            for r in range(count):
                total -= shapes[i, j, r] * own[r]
            state.mismatch[m, i, j] = total


@inner
def _solve(matrix: FloatArray, right: FloatArray) -> None:
    """Gauss' elimination with the largest pivot of each column; the solutions replace the right-hand sides (n, q)."""
    n = len(matrix)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(right.shape[1]):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(right.shape[1]):
                right[i, j] -= factor * right[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(right.shape[1]):
            total = right[k, j]
            for i in range(k + 1, n):
                total -= matrix[k, i] * right[i, j]
            right[k, j] = total / matrix[k, k]


@inner
def change_shape(state: PadState, bodies: BodyStack, m: int, da: float, db: float) -> None:
    """Add to the change of a pad's deformation, `PadState.mismatch`, what belongs to a move of its film."""
    out, shapes = state.mismatch[m], bodies.shapes[bodies.which[m]]
    for r in range(shapes.shape[2]):
        amount = state.amplitude[m, r, 0] + state.amplitude[m, r, 1] * da + state.amplitude[m, r, 2] * db
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] += amount * shapes[i, j, r]
