"""Pads that give way, on the arrays of a compiled search: what `model.pad.bending` does, pad by pad in one call."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from model.compilation import inner
from model.film.dense import solve
from model.film.faces import conductances
from model.film.mesh import FilmGrid, FilmWork
from model.film.slopes import force_of, shape_slopes
from model.interpolation import largest
from model.pad.bending import PadDeformation
from model.statics.compiled.case import Case, Problem
from model.statics.compiled.stack import BodyStack, PadState, grid_of, work_of
from model.tilt_hold import held_moment
from rigdata.arrays import FloatArray, IntArray


@lru_cache(maxsize=8)
def stacked_bodies(bodies: tuple[PadDeformation, ...], first: int, factor: float, conducting: bool) -> BodyStack:
    """Matrices of the pads side by side: of their deformation times a factor, of what they conduct."""
    kinds = list(dict.fromkeys(bodies))
    bending, conductors = (kinds if factor else []), (kinds if conducting else [])
    inner = np.zeros(kinds[0].shapes.shape[:2] if kinds else (0, 0), dtype=bool)
    inner[1:-1, first:-1] = True
    answer = [factor * np.hstack([b.compliance[:, inner.ravel()], b.expansion]) for b in bending]
    return BodyStack(
        np.array([kinds.index(b) for b in bodies], dtype=np.int64),
        _stack(answer, 3).astype(np.float32),
        _stack([b.to_coarse for b in bending], 3).astype(np.float32),
        _stack([b.shapes for b in bending], 4),
        _stack([b.amplitudes for b in bending], 3),
        _stack([factor * b.response for b in bending], 3),
        _stack([b.flux for b in conductors], 3),
        _stack([b.to_coarse for b in conductors], 3),
    )


def _stack(matrices: Sequence[FloatArray], dimensions: int) -> FloatArray:
    return np.array(matrices) if matrices else np.zeros((0,) * dimensions)


@inner
def bend_pads(bodies: BodyStack | None, problem: Problem) -> float:
    """Close the loop of pressure, deformation and tilt along the shaft for every pad that carries.

    Returns the largest change asked for, as a share of the thinnest film.
    """
    state, works = problem.state, problem.works
    if bodies is None or state.bent.size == 0:
        return 0.0
    count = len(state.tilt)
    asked = np.zeros((count, state.bent[0].size))
    if len(bodies.shapes) > 0:
        _ask_bodies(bodies, works, state, problem.case.supply, asked)
    share = 0.0
    for m in range(count):
        if state.solved[m]:
            change = asked[m] - state.bent[m].reshape(-1)
            tilted = _close_loop(bodies, problem, m, change)
            share = max(share, max(largest(change), tilted) / state.least[m])
    return share


@inner
def _ask_bodies(bodies: BodyStack, works: FilmWork, state: PadState, supply: float, asked: FloatArray) -> None:
    """Deformation (pads, nodes) that pressure and temperature ask for; pads of one shape in one product [m]."""
    count = len(state.tilt)
    unknowns, coarse = works.unknown.shape[1], bodies.lighter.shape[1]
    rise = np.zeros((count, state.bent[0].size))
    given = np.zeros((count, unknowns + coarse))
    for m in range(count):
        if state.solved[m]:
            rise[m] = state.faces[m].reshape(-1) - supply
            given[m, :unknowns] = works.unknown[m] + state.shift[m]
    same = np.empty(count, dtype=np.int64)
    for k in range(bodies.answer.shape[0]):
        some = 0
        for m in range(count):
            if state.solved[m] and bodies.which[m] == k:
                same[some] = m
                some += 1
        if some > 0:
            _times(bodies.lighter[k], rise, same[:some], given[:, unknowns:])
            _times(bodies.answer[k], given, same[:some], asked)


@inner
def _times(matrix: np.ndarray, given: FloatArray, rows: IntArray, out: FloatArray) -> None:
    """Product of a matrix with some rows of `given`: all of them for every row of the matrix that is read."""
    for i in range(matrix.shape[0]):
        factors = matrix[i]
        for row in rows:
            total, values = 0.0, given[row]
            for q in range(len(factors)):
                total += np.float64(factors[q]) * values[q]
            out[row, i] = total


@inner
def _close_loop(bodies: BodyStack, problem: Problem, m: int, change: FloatArray) -> float:
    """One pad's part of a Newton step, see `model.pad.bending`; how far a tilt along the shaft moves the ends [m]."""
    grid, work = grid_of(problem.grids, m), work_of(problem.works, m)
    state, case = problem.state, problem.case
    bends = len(bodies.shapes) > 0
    body, bending = (bodies.which[m], bodies.shapes.shape[3]) if bends else (0, 0)
    count = bending + (1 if case.axial else 0)
    unknowns = len(work.unknown)
    rows, columns = work.pressure.shape
    shapes = np.empty((rows, columns, count))
    response = np.empty((count, unknowns))
    matrix, right = np.zeros((count, count)), np.zeros((count, 3))
    if bends:
        shapes[:, :, :bending], response[:bending] = bodies.shapes[body], bodies.response[body]
        for r in range(bending):
            matrix[r, r] = 1.0
            for q in range(len(change)):
                right[r, 0] += bodies.amplitudes[body, r, q] * change[q]
    if case.axial:
        right[bending, 0], matrix[bending, bending] = _axial_moment(grid, work, state, case, m, response[bending])
        for i in range(rows):
            for j in range(columns):
                shapes[i, j, bending] = grid.cos[i] * grid.z[j]
    asked = right[:, 0].copy()
    wedge = (problem.pads.clearance[m], state.wedge[m, 0], state.wedge[m, 1])
    slopes = shape_slopes(grid, work, conductances(grid, work, wedge), shapes)
    felt = np.empty((2, count))
    for q in range(unknowns):
        for r in range(count):
            value = response[r, q]
            right[r, 1] += value * work.slopes[q, 0]
            right[r, 2] += value * work.slopes[q, 1]
            for s in range(count):
                matrix[r, s] -= value * slopes[q, s]
    felt[:] = force_of(grid, grid.area, slopes)
    solve(matrix, right)
    for r in range(count):
        for axis in range(2):
            state.felt[m, axis] += felt[axis, r] * right[r, 0]
            state.felt_stiffness[m, axis, 0] += felt[axis, r] * right[r, 1]
            state.felt_stiffness[m, axis, 1] += felt[axis, r] * right[r, 2]
    for r in range(bending):
        state.amplitude[m, r] = right[r]
    mismatch = state.mismatch[m].reshape(-1)
    flat = shapes.reshape((len(change), count))
    for q in range(len(change)):
        mismatch[q] = change[q]
        for r in range(bending):
            mismatch[q] -= flat[q, r] * asked[r]
    if not case.axial:
        return 0.0
    state.axial_step[m] = right[bending]
    return abs(right[bending, 0]) * largest(shapes[:, :, bending].copy().reshape(-1))


@inner
def _axial_moment(
    grid: FilmGrid, work: FilmWork, state: PadState, case: Case, m: int, lever: FloatArray
) -> tuple[float, float]:
    """Moment along the shaft that nothing balances, what holds that tilt, and the moment by the unknown pressures.

    `lever` (unknowns,) [m^3] is less what grows with the pad's load.
    """
    moment, stiffness, arm, _ = held_moment(case.hold, state.axial[m], state.corrected[m, 0])
    total, columns = -moment, grid.steps[0]
    for n in range(work.pressure.size):
        i, j = divmod(n, columns)
        total += grid.area[i, j] * grid.cos[i] * grid.z[j] * work.pressure[i, j]
    for q in range(len(lever)):
        i, j = divmod(grid.node[q], columns)
        total += grid.area[i, j] * grid.cos[i] * grid.z[j] * state.shift[m, q]
        lever[q] = grid.area[i, j] * grid.cos[i] * (grid.z[j] - arm)
    return total, stiffness


@inner
def change_shape(bodies: BodyStack | None, state: PadState, case: Case, m: int, da: float, db: float) -> float:
    """Add to the change of a pad's deformation, `PadState.mismatch`, what belongs to a move of its film.

    Returns the change of its tilt along the shaft [rad].
    """
    if bodies is None:
        return 0.0
    out = state.mismatch[m]
    if len(bodies.shapes) > 0:
        shapes = bodies.shapes[bodies.which[m]]
        for r in range(shapes.shape[2]):
            amount = state.amplitude[m, r, 0] + state.amplitude[m, r, 1] * da + state.amplitude[m, r, 2] * db
            for i in range(out.shape[0]):
                for j in range(out.shape[1]):
                    out[i, j] += amount * shapes[i, j, r]
    if not case.axial:
        return 0.0
    axial = state.axial_step[m, 0] + state.axial_step[m, 1] * da + state.axial_step[m, 2] * db
    if case.hold.slip > 0.0 and state.axial[m] * (state.axial[m] + axial) < 0.0:
        return -state.axial[m]  # friction turns round there
    return axial
