"""The Newton iteration of `model.statics.newton_iteration` in one compiled call, from a start to where it ends."""

from __future__ import annotations

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import heat_by_drag
from model.film.mesh import FilmWork
from model.statics.compiled.anderson import DEPTH, mixed
from model.statics.compiled.bending import Shapes
from model.statics.compiled.carrying import (
    Case,
    along,
    edge,
    find_branch,
    leave_unstable,
    margin,
    reach,
    rigid_approach,
    set_loaded,
    update_carrying,
)
from model.statics.compiled.constants import (
    BOUNDLESS,
    FIRST_HEATING,
    HEAT_PER_FORCE,
    MAX_ITERATIONS,
    MICROMETRE,
    NEAR,
    NEAR_HEAT,
    PATIENCE,
    PROGRESS,
    RELAXATION,
    SLOW,
)
from model.statics.compiled.first_position import balance
from model.statics.compiled.stack import GridStack, PadStack, PadState, grid_of, work_of
from model.statics.compiled.step import move, newton, solve_films, solve_pressure
from rigdata.arrays import FloatArray

#: How an iteration ends.
SETTLED, RESTARTING, FILM_LOST, BOUNDLESS_HEAT, SINGULAR, _NOT_CONVERGED = range(6)


@inner
def _start_cold(grids: GridStack, case: Case, pads: PadStack, works: FilmWork, state: PadState) -> None:
    """Balance the load with the tabulated isothermal films, then put every pad on its loaded attitude.

    Films that make heat are balanced twice: as hot as their oil gets where it is only dragged along is known then.
    """
    for m in range(len(state.tilt)):
        works.temperature[m] = pads.inlet[m]
    _balance_films(case, pads, works, state, 0.0 if case.isothermal else FIRST_HEATING)
    if case.isothermal:
        return
    for m in range(len(state.tilt)):
        if not state.idle[m]:
            a = rigid_approach(pads, state, m) - state.deflection[m]
            wedge = (pads.clearance[m], a, along(pads, state, m) + pads.pivot_radius[m] * state.tilt[m])
            heat_by_drag(grid_of(grids, m), work_of(works, m), wedge, case.running, pads.inlet[m])
    _balance_films(case, pads, works, state, 0.0)


@inner
def _balance_films(case: Case, pads: PadStack, works: FilmWork, state: PadState, hotter: float) -> None:
    """Put journal and pads where tabulated films, as warm as these or `hotter` [K] than that, carry the load."""
    n = len(state.tilt)
    distances = np.empty((n, 3))
    room = math.inf
    for m in range(n):
        find_branch(case, pads, works, state, m, hotter)
        distances[m, 0], distances[m, 1] = pads.frame[m, 0, 0], pads.frame[m, 0, 1]
        distances[m, 2] = pads.preload[m]
        room = min(room, state.branch[m, 1, state.length[m] - 1] - pads.preload[m])
    position = balance(case.load, distances, state.branch[:, 0], state.branch[:, 3], state.length, room)
    state.position[0], state.position[1] = position[0], position[1]
    for m in range(n):
        set_loaded(pads, works, state, m)


@compiled
def iterate(
    shapes: Shapes, pads: PadStack, works: FilmWork, state: PadState, case: Case, cold: bool
) -> tuple[int, int, float, float, float]:
    """Iterate from where the arrays stand, or from a cold start."""
    if cold:
        _start_cold(shapes.grids, case, pads, works, state)
    best, residual, heat, stalled = math.inf, math.inf, math.inf, 0
    left, best_left, limited, relaxation = math.inf, math.inf, 0.0, RELAXATION if cold else 1.0
    mixes = not case.isothermal or len(shapes.bodies.which) > 0
    count, size = 0, _size(works, state) if mixes else 0
    images, residuals, before = np.empty((DEPTH + 1, size)), np.empty((DEPTH + 1, size)), np.empty(size)
    for iteration in range(1, MAX_ITERATIONS + 1):
        if update_carrying(case, pads, works, state):
            count = 0
        kept = left > SLOW * best_left and mixes
        if kept:
            _write_vector(pads, works, state, before)
        heat, limited = solve_films(shapes, pads, works, state, case, relaxation)
        if not heat < BOUNDLESS:
            return FILM_LOST if _lost(state) else BOUNDLESS_HEAT, iteration, math.inf, heat, limited
        residual, shift, moves = newton(case, pads, state)
        if not (math.isfinite(residual) and _finite(state.position, shift, moves)):
            return SINGULAR, iteration, math.inf, heat, limited
        best_left, left = min(best_left, left), max(residual, heat / HEAT_PER_FORCE)
        near = residual < NEAR and heat < NEAR_HEAT
        relaxation = 1.0 if near else RELAXATION
        if residual < case.accuracy and heat < HEAT_PER_FORCE * case.accuracy:
            if not leave_unstable(case, pads, works, state):
                return _settled(shapes.grids, pads, works, state, case), iteration, residual, heat, limited
            count = 0
            continue
        stalled = 0 if residual < PROGRESS * best else stalled + 1
        best = min(best, residual)
        whole = move(shapes, pads, works, state, (shift, moves), 0.5 if stalled > PATIENCE else 1.0)
        if kept and whole and near and left > SLOW * best_left:
            count = _remember(images, residuals, count)
            _write_vector(pads, works, state, images[count - 1])
            for q in range(size):
                residuals[count - 1, q] = images[count - 1, q] - before[q]
            _read_vector(pads, works, state, mixed(images, residuals, count))
        else:
            count = 0
    return _NOT_CONVERGED, MAX_ITERATIONS, residual, heat, limited


@inner
def _finite(position: FloatArray, shift: FloatArray, moves: FloatArray) -> bool:
    finite = math.isfinite(position[0] + shift[0]) and math.isfinite(position[1] + shift[1])
    for m in range(len(moves)):
        finite = finite and math.isfinite(moves[m, 0]) and math.isfinite(moves[m, 1])
    return finite


@inner
def _remember(images: FloatArray, residuals: FloatArray, count: int) -> int:
    """Make room for one more; returns how many there are with it."""
    if count == DEPTH + 1:
        for k in range(DEPTH):
            images[k] = images[k + 1]
            residuals[k] = residuals[k + 1]
        return count
    return count + 1


@inner
def _lost(state: PadState) -> bool:
    lost = False
    for m in range(len(state.tilt)):
        lost = lost or (not state.idle[m] and state.solved[m] and state.steps[m] < 0)
    return lost


@inner
def _settled(grids: GridStack, pads: PadStack, works: FilmWork, state: PadState, case: Case) -> int:
    """Derivatives once more, with the rupture line between the nodes, unless a pad can neither carry nor idle."""
    for m in range(len(state.tilt)):
        if state.idle[m] and margin(pads, state, m) > edge(pads, state, m) and reach(pads, state, m) > 0.0:
            return RESTARTING
    for m in range(len(state.tilt)):
        if state.solved[m]:
            solve_pressure((grid_of(grids, m), work_of(works, m)), pads, state, case, m, True)
    return SETTLED


@inner
def _size(works: FilmWork, state: PadState) -> int:
    return 2 + works.temperature.size + state.bent.size + 2 * len(state.tilt)


@inner
def _write_vector(pads: PadStack, works: FilmWork, state: PadState, out: FloatArray) -> None:
    """Journal, pads, film temperatures and deformations as one vector, in micrometres and kelvins."""
    out[0], out[1] = state.position[0] / MICROMETRE, state.position[1] / MICROMETRE
    at = 2
    for m in range(len(state.tilt)):
        out[at] = state.tilt[m] * pads.pivot_radius[m] / MICROMETRE
        out[at + 1] = state.deflection[m] / MICROMETRE
        at += 2
        warm = works.temperature[m]
        for i in range(warm.shape[0]):
            for j in range(warm.shape[1]):
                out[at] = 0.0 if state.idle[m] else warm[i, j]
                at += 1
        for i in range(state.bent.shape[1]):
            for j in range(state.bent.shape[2]):
                out[at] = state.bent[m, i, j] / MICROMETRE
                at += 1


@inner
def _read_vector(pads: PadStack, works: FilmWork, state: PadState, vector: FloatArray) -> None:
    """Undo `_write_vector`."""
    state.position[0], state.position[1] = vector[0] * MICROMETRE, vector[1] * MICROMETRE
    at = 2
    for m in range(len(state.tilt)):
        state.tilt[m] = vector[at] * MICROMETRE / pads.pivot_radius[m]
        state.deflection[m] = vector[at + 1] * MICROMETRE
        at += 2
        warm = works.temperature[m]
        for i in range(warm.shape[0]):
            for j in range(warm.shape[1]):
                if not state.idle[m]:
                    warm[i, j] = vector[at]
                at += 1
        if state.bent.size > 0:
            for i in range(state.bent.shape[1]):
                for j in range(state.bent.shape[2]):
                    change = vector[at] * MICROMETRE - state.bent[m, i, j]
                    state.bent[m, i, j] += change
                    works.extra[m, i, j] += change
                    at += 1
