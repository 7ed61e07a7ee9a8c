"""Settle: a fit with derivatives of its own, those of what may be off too, everything moved together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import ForwardModel, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import column_of
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit, build, fitted
from tpjb_ident.diagnosis.search.minimise import CONVERGED, SearchState, attempt, slope
from tpjb_ident.diagnosis.search.problem import Problem

#: How often a fit takes derivatives of its own.
ROUNDS = 3
#: Steps on the same derivatives, which every step corrects: one run of the model each, where derivatives take thirty.
STEPS_BETWEEN = 4


def converge(run: Map, problem: Problem, found: Fit, rounds: int = ROUNDS) -> Fit:
    """Give a fit derivatives of its own, those of the nuisances too, and move all of them together."""
    if found.converged:
        return found
    state = SearchState(found.start, found.prediction)
    scales = found.assessment.scales
    for number in range(rounds):
        if number:
            state = replace(state, start=_renewed(run, problem, state.start, state.prediction))
            found = fitted(problem, state.start, state.prediction, scales)
            scales = found.assessment.scales
        moved = False
        for _ in range(STEPS_BETWEEN):
            next_state, stepped = _stepped(run, problem, state, found)
            if not stepped:
                break
            state, moved = _learnt(problem, state, next_state), True
            found = fitted(problem, state.start, state.prediction, scales)
            scales = found.assessment.scales
        if number and not moved:
            return replace(found, converged=True)
    return found


def _learnt(problem: Problem, here: SearchState, there: SearchState) -> SearchState:
    """Correct all derivatives by what a step showed, in units of the priors' widths (Broyden, as in `fit`)."""
    count, width = here.start.jacobian.shape[1], here.start.width
    step = (there.start.free - here.start.free) / width
    columns = np.column_stack([here.start.jacobian, here.start.columns]) * width
    change = there.prediction - here.prediction - columns @ step
    # what acts on readings is linear
    step[count:][[nuisance.column is not None for nuisance in problem.nuisances]] = 0.0
    length = float(step @ step)
    if length < 1e-20:
        return there
    columns = (columns + np.outer(change, step / length)) / width
    return replace(there, start=replace(there.start, jacobian=columns[:, :count], columns=columns[:, count:]))


def _stepped(run: Map, problem: Problem, here: SearchState, found: Fit) -> tuple[SearchState, bool]:
    """Take the step that a linear model proposes, or a part of it; whether it was one worth taking."""
    weight: FloatArray = np.asarray(np.linalg.inv(problem.basis.covariance(found.assessment.scales)), float)
    free = found.assessment.free
    now = here.start.free
    errors = np.sqrt(np.maximum(np.diag(found.assessment.covariance), 1e-300))
    if np.all(np.abs(free - now) < CONVERGED * errors):
        return here, False
    cost = here.cost(problem, weight)
    for share in (1.0, 0.4, 0.1):
        start = _moved(here.start, now + share * (free - now))
        (y,) = tuple(run(attempt, [(start,)]))
        if y is not None:
            next_state = SearchState(start, y)
            if next_state.cost(problem, weight) < cost:
                return next_state, True
    return here, False


def _moved(start: InitialFit, free: FloatArray) -> InitialFit:
    count = start.jacobian.shape[1]
    origin = np.concatenate([c.origin for c in start.candidates]) if start.candidates else np.zeros(0)
    return replace(start, amplitudes=start.split(origin + free[:count]), nuisance=free[count:])


def _renewed(run: Map, problem: Problem, start: InitialFit, y: FloatArray) -> InitialFit:
    """Take all derivatives anew; what acts on readings has its own."""
    count = start.jacobian.shape[1]
    asked = [*range(count), *(count + i for i, nuisance in enumerate(problem.nuisances) if nuisance.column is None)]
    every = np.column_stack([start.jacobian, start.columns])
    for index, column in zip(asked, run(_column, [(start, y, i) for i in asked]), strict=True):
        every[:, index] = column
    return replace(start, jacobian=every[:, :count], columns=every[:, count:])


def _column(forward: ForwardModel, problem: Problem, start: InitialFit, y: FloatArray, index: int) -> FloatArray:
    count = start.jacobian.shape[1]
    if index < count:
        return slope(forward, problem, start, y, index, 0.1)
    effects = build(start.candidates, start.amplitudes)
    try:
        return column_of(forward, effects, problem.nuisances, start.nuisance, y, index - count)
    except NoEquilibriumError:
        return np.asarray(start.columns[:, index - count])
