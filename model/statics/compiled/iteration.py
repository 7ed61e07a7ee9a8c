"""One Newton iteration for journal, tilts and pivot deflections, from a start to an equilibrium or a named failure.

The films' own derivatives with respect to (a, b) are the Jacobian; temperature and pad deformation follow one step
behind and contract by a factor of about ten per iteration. Where a step is known to Python only, the iteration says
what it asks for, and is called again to go on.
"""

import math
from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.dense import BOUNDLESS, DEPTH, mixed
from model.statics.compiled.case import ACROSS, ALONE, COUPLED, HEAT_PER_FORCE, ISOTHERMAL, Problem
from model.statics.compiled.elimination import newton
from model.statics.compiled.heat import exchange_heat, heat_films
from model.statics.compiled.place import is_doubtful
from model.statics.compiled.stack import BACKFLOW, GROWING, GROWN, BodyStack
from model.statics.compiled.step import change_state, grow_and_bend, move, solve_pressures
from rigdata.arrays import FloatArray

_MAX_ITERATIONS = 80
#: Below this residual, and this change of temperature [K], the iteration is accelerated and the temperature no longer
#: relaxed.
_NEAR, _NEAR_HEAT = 0.3, 25.0
#: Steps that leave more than this share of what was left are accelerated; the others need no help.
_SLOW = 0.4
#: The same where temperatures across films, pads, journal and clearances settle together: Fillon's bearing takes 8 to
#: 11 steps, 9 to 14 with 0.4.
_SLOW_ACROSS = 0.12
#: A residual that has not fallen by this factor for so many steps has the steps halved.
_PROGRESS, _PATIENCE = 0.7, 12
#: Unit of lengths in the state vector [m]: a micrometre weighs as much as a kelvin.
_MICROMETRE = 1e-6
#: Share of a change of temperature that is made far from the equilibrium: a much hotter film carries less and heats
#: less, and undamped the two would swing.
_RELAXATION = 0.6
#: With temperatures across the films it ends at so many times `Setup.accuracy`: less than 1e-3 K asked for in the last
#: step. That leaves 2e-5 K and 6e-7 of K and C (rocker; two steps fewer), where a mesh twice as fine moves 0.1 K.
_ACROSS_ACCURACY = 30.0

#: How an iteration ends, or what it asks Python for: viscosities, temperatures for the pressures, the pivots' laws,
#: whether pads are stable whose frozen film does not say so.
SETTLED, FILM_LOST, BOUNDLESS_HEAT, SINGULAR, NOT_CONVERGED, ASKS_OIL, ASKS_HEAT, ASKS_LAWS, ASKS_STABLE = range(9)

#: Places in `Memory.trail`.
_STAGE, ITERATION, HEAT, _BEST, _STALLED, _LEFT, _BEST_LEFT, RELAXED, _COUNT, STABLE, TRAIL = range(11)
#: `_STAGE`
_BEGIN, _PRESSURE, _HEATING, _STEPPING = range(4)


class Memory(NamedTuple):
    """What an iteration remembers from step to step."""

    trail: FloatArray  #: (`TRAIL`,): Stage, count, heat [K], and the course so far.
    images: FloatArray  #: (`DEPTH` + 1, q): Last states, where they led to, the one that a step starts from.
    residuals: FloatArray
    before: FloatArray


def fresh_memory(problem: Problem) -> Memory:
    """Of an iteration that has not begun: films begin warm, and nothing is relaxed; vectors are `_write_vector`'s."""
    state = problem.state
    faces = state.faces.size if problem.case.thermal == ACROSS else 0
    size = 3 + 3 * len(problem.pads.table) + state.warmth.size + faces + state.bent.size
    trail = np.zeros(TRAIL)
    trail[[HEAT, _BEST, _LEFT, _BEST_LEFT]] = math.inf
    trail[RELAXED] = 1.0
    images = np.empty((2 * DEPTH + 3, size))
    return Memory(trail, images[: DEPTH + 1], images[DEPTH + 1 : -1], images[-1])


@compiled
def iterate(problem: Problem, memory: Memory) -> int:
    """Iterate from where the arrays stand until the end, or until Python is asked for a step."""
    pads, state, case, trail = problem.pads, problem.state, problem.case, memory.trail
    across = case.thermal == ACROSS
    accuracy = case.accuracy * (_ACROSS_ACCURACY if across else 1.0)
    while True:
        if trail[_STAGE] == _BEGIN:
            if trail[ITERATION] >= _MAX_ITERATIONS:
                return NOT_CONVERGED
            trail[ITERATION] += 1
            trail[_STAGE] = _PRESSURE
            if across:
                return ASKS_OIL
        if trail[_STAGE] == _PRESSURE:
            state.figures[BACKFLOW] = trail[HEAT] = 0.0
            _write_vector(problem, memory.before)
            trail[_STAGE] = _HEATING
            if not solve_pressures(problem, False):
                return FILM_LOST  # what has no pressure has no flow that could carry heat
            if across:
                return ASKS_HEAT
        if trail[_STAGE] == _HEATING:
            heat = _heat(problem.bodies, problem, trail)
            trail[HEAT] = grow_and_bend(problem, trail[RELAXED], heat)
            if not trail[HEAT] < BOUNDLESS:
                return BOUNDLESS_HEAT
            trail[_STAGE] = _STEPPING
            if case.asks_laws:
                return ASKS_LAWS
        residual, shift = newton(case, pads, state.figures[GROWING])
        trail[_STAGE] = _BEGIN
        if not math.isfinite(residual):
            return SINGULAR
        if residual < accuracy and trail[HEAT] < HEAT_PER_FORCE * accuracy:
            trail[_COUNT] = 0
            if trail[STABLE] == 0.0:
                for m in range(len(pads.table)):
                    if pads.table[m].solved and is_doubtful(case, pads.table[m], pads.curves[m]):
                        return ASKS_STABLE
            solve_pressures(problem, True)  # derivatives once more, with the rupture line between the nodes
            return SETTLED
        _go_on(problem, memory, residual, shift)


@inner
def _heat(bodies: BodyStack | None, problem: Problem, trail: FloatArray) -> float:
    """Temperatures of the films for their pressures; returns the largest change asked for [K]."""
    if problem.case.thermal == ALONE:
        return heat_films(problem, trail[RELAXED])
    if bodies is not None and problem.case.thermal == COUPLED:
        return exchange_heat(bodies, problem, trail[RELAXED])
    return trail[HEAT]


@inner
def _go_on(problem: Problem, memory: Memory, residual: float, shift: FloatArray) -> None:
    """Move by a step, and where slow modes are left, to where the last few steps head."""
    trail, across = memory.trail, problem.case.thermal == ACROSS
    heat = trail[HEAT]
    slow = _SLOW_ACROSS if across else _SLOW
    was_slow = trail[_LEFT] > slow * trail[_BEST_LEFT]
    trail[_BEST_LEFT] = min(trail[_BEST_LEFT], trail[_LEFT])
    trail[_LEFT] = max(residual, heat / HEAT_PER_FORCE)
    near = residual < _NEAR and heat < _NEAR_HEAT
    # a film with temperatures across knows that it makes less heat when it is hotter: it does not swing
    trail[RELAXED] = 1.0 if near or across else _RELAXATION
    trail[_STALLED] = 0.0 if residual < _PROGRESS * trail[_BEST] else trail[_STALLED] + 1.0
    trail[_BEST] = min(trail[_BEST], residual)
    damping = 0.5 if trail[_STALLED] > _PATIENCE else 1.0
    full_step = move(problem, shift, damping)
    # steps that were cut short, or still far off, say nothing of the iteration's slow modes
    mixes = problem.case.thermal != ISOTHERMAL or problem.state.bent.size > 0
    if mixes and was_slow and full_step and near and trail[_LEFT] > slow * trail[_BEST_LEFT]:
        count = _remember(memory)
        _write_vector(problem, memory.images[count - 1])
        memory.residuals[count - 1] = memory.images[count - 1] - memory.before
        _read_vector(problem, mixed(memory.images, memory.residuals, count))
    else:
        trail[_COUNT] = 0


@inner
def _remember(memory: Memory) -> int:
    """Make room for one more; returns how many there are with it."""
    count = int(memory.trail[_COUNT])
    if count == DEPTH + 1:
        memory.images[:DEPTH] = memory.images[1:].copy()
        memory.residuals[:DEPTH] = memory.residuals[1:].copy()
        return count
    memory.trail[_COUNT] = count + 1
    return count + 1


@inner
def _write_vector(problem: Problem, out: FloatArray) -> None:
    """Journal, pads, temperatures and deformations as one vector, in micrometres and kelvins."""
    pads, state = problem.pads, problem.state
    out[:2] = state.position / _MICROMETRE
    out[2] = state.figures[GROWN]
    parts = out[3:].reshape((len(pads.table), -1))
    warm, bent = 3 + state.warmth.shape[1], parts.shape[1] - state.bent[0].size
    for m in range(len(pads.table)):
        pad, part = pads.table[m], parts[m]
        unit = pad.pivot_radius / _MICROMETRE
        part[0] = pad.tilt * unit
        part[1] = pad.deflection / _MICROMETRE
        part[2] = pad.axial * unit
        part[3:bent] = 0.0
        if not pad.idle:
            part[3:warm] = state.warmth[m]
            part[warm:bent] = state.faces[m].reshape(-1)[: bent - warm]
        part[bent:] = state.bent[m].reshape(-1) / _MICROMETRE


@inner
def _read_vector(problem: Problem, vector: FloatArray) -> None:
    """Undo `_write_vector`."""
    pads, state = problem.pads, problem.state
    shift, moves = vector[:2] * _MICROMETRE - state.position, np.empty((len(pads.table), 3))
    state.figures[GROWING] = vector[2] - state.figures[GROWN]
    parts = vector[3:].reshape((len(pads.table), -1))
    warm, bent = 3 + state.warmth.shape[1], parts.shape[1] - state.bent[0].size
    for m in range(len(pads.table)):
        pad, part = pads.table[m], parts[m]
        unit = _MICROMETRE / pad.pivot_radius
        moves[m, 0] = part[0] * unit - pad.tilt
        moves[m, 1] = part[1] * _MICROMETRE - pad.deflection
        moves[m, 2] = part[2] * unit - pad.axial
        if not pad.idle:
            state.warmth[m] = part[3:warm]
            state.faces[m].reshape(-1)[: bent - warm] = part[warm:bent]
        state.mismatch[m] = part[bent:].reshape(state.bent[m].shape) * _MICROMETRE - state.bent[m]
    change_state(problem, shift, moves, 1.0)
