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
_ROUNDS = 3
#: Steps on the same derivatives, which every step corrects: one run of the model each, where derivatives take thirty.
_STEPS_BETWEEN = 4


def converge(run: Map, problem: Problem, fit: Fit, rounds: int = _ROUNDS) -> Fit:
    """Give a fit derivatives of its own, those of the nuisances too, and move all of them together."""
    if fit.converged:
        return fit
    state = SearchState(fit.start, fit.prediction)
    scales = fit.assessment.scales
    for number in range(rounds):
        if number:
            state = replace(state, start=_renewed(run, problem, state.start, state.prediction))
            fit = fitted(problem, state.start, state.prediction, scales)
            scales = fit.assessment.scales
        moved = False
        for _ in range(_STEPS_BETWEEN):
            next_state, stepped = _stepped(run, problem, state, fit)
            if not stepped:
                break
            state, moved = _learnt(problem, state, next_state), True
            fit = fitted(problem, state.start, state.prediction, scales)
            scales = fit.assessment.scales
        if number and not moved:
            return replace(fit, converged=True)
    return fit


def _learnt(problem: Problem, state: SearchState, trial: SearchState) -> SearchState:
    """Correct all derivatives by what a step showed, in units of the priors' widths (Broyden, as in `fit`)."""
    count, width = state.start.jacobian.shape[1], state.start.width
    step = (trial.start.free - state.start.free) / width
    columns = np.column_stack([state.start.jacobian, state.start.columns]) * width
    change = trial.prediction - state.prediction - columns @ step
    # what acts on readings is linear
    step[count:][[nuisance.column is not None for nuisance in problem.nuisances]] = 0.0
    length = float(step @ step)
    if length < 1e-20:
        return trial
    columns = (columns + np.outer(change, step / length)) / width
    return replace(trial, start=replace(trial.start, jacobian=columns[:, :count], columns=columns[:, count:]))


def _stepped(run: Map, problem: Problem, state: SearchState, fit: Fit) -> tuple[SearchState, bool]:
    """Take the step that a linear model proposes, or a part of it; whether it was one worth taking."""
    weight: FloatArray = np.asarray(np.linalg.inv(problem.basis.covariance(fit.assessment.scales)), float)
    free = fit.assessment.free
    now = state.start.free
    errors = np.sqrt(np.maximum(np.diag(fit.assessment.covariance), 1e-300))
    if np.all(np.abs(free - now) < CONVERGED * errors):
        return state, False
    cost = state.cost(problem, weight)
    for share in (1.0, 0.4, 0.1):
        start = _moved(state.start, now + share * (free - now))
        (y,) = tuple(run(attempt, [(start,)]))
        if y is not None:
            next_state = SearchState(start, y)
            if next_state.cost(problem, weight) < cost:
                return next_state, True
    return state, False


def _moved(start: InitialFit, free: FloatArray) -> InitialFit:
    count = start.jacobian.shape[1]
    origin = np.concatenate([c.origin for c in start.candidates]) if start.candidates else np.zeros(0)
    return replace(start, amplitudes=start.split(origin + free[:count]), nuisance=free[count:])


def _renewed(run: Map, problem: Problem, start: InitialFit, y: FloatArray) -> InitialFit:
    """Take all derivatives anew; what acts on readings has its own."""
    count = start.jacobian.shape[1]
    asked = [*range(count), *(count + i for i, nuisance in enumerate(problem.nuisances) if nuisance.column is None)]
    jacobian = np.column_stack([start.jacobian, start.columns])
    for index, column in zip(asked, run(_column, [(start, y, i) for i in asked]), strict=True):
        jacobian[:, index] = column
    return replace(start, jacobian=jacobian[:, :count], columns=jacobian[:, count:])


def _column(forward: ForwardModel, problem: Problem, start: InitialFit, y: FloatArray, index: int) -> FloatArray:
    count = start.jacobian.shape[1]
    if index < count:
        return slope(forward, problem, start, y, index, 0.1)
    effects = build(start.candidates, start.amplitudes)
    try:
        return column_of(forward, effects, problem.nuisances, start.nuisance, y, index - count)
    except NoEquilibriumError:
        return np.asarray(start.columns[:, index - count])
