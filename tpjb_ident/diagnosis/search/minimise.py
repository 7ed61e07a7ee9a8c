"""Descend: amplitudes of effects by damped Gauss-Newton steps, everything that may be off following to first order."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import ForwardModel, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import predict
from tpjb_ident.diagnosis.search.assessment import Assessment, Basis, assess
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit, build, fitted, linear
from tpjb_ident.diagnosis.search.problem import Problem

_MAX_STEPS = 4
#: Share of their tolerances that nuisances have at first.
_TIGHT = 0.2
#: A fit is settled when a step would move every amplitude by less than this share of its standard error.
CONVERGED = 0.1
#: A step that loses less than this [nats] is not tried shorter: it loses by its derivative, which is better known after
#: it, and not by its length.
_HARDLY = 0.3


@dataclass(frozen=True)
class SearchState:
    """Where all free numbers stand, and what the model predicts there, (n,)."""

    start: InitialFit
    prediction: FloatArray

    def cost(self, problem: Problem, weight: FloatArray) -> float:
        """Squared misfit under noise and model error, plus that of all priors; `weight` (n, n)."""
        z = problem.scaled(problem.observations.value - self.prediction)
        return float(z @ weight @ z + np.sum((self.start.free / self.start.width) ** 2))


def fit(forward: ForwardModel, problem: Problem, start: InitialFit) -> Fit | None:
    """Fit amplitudes; nuisances follow to first order.

    First the effects alone have to do it: far from the answer nuisances, linear as they are here, would bend the way.
    There every element may also be off by itself by as much as is stated: where pads come out of contact a campaign is
    all cliffs to a weight that knows of smooth errors only. Then nuisances are as free as stated, the model counting as
    wrong by what is stated and no more: where it may be wrong by anything, nothing needs to move. Last by what the
    residual tells.

    Derivatives are corrected along every step (Broyden, Math. Comp. 19 (1965) 577): a step costs one run of the model.
    """
    y = attempt(forward, problem, start)
    if y is None:
        return None
    coarse, basis = problem.basis.coarse, problem.basis
    state = _minimised(forward, problem, SearchState(start, y), _Objective(coarse, basis.stated, _TIGHT))
    state = _minimised(forward, problem, state, _Objective(basis, basis.stated, _TIGHT))
    state = _minimised(forward, problem, state, _Objective(basis, basis.stated))
    fitted_first = fitted(problem, state.start, state.prediction)
    next_state = _minimised(forward, problem, state, _Objective(basis, fitted_first.assessment.scales))
    if next_state is state:
        return fitted_first
    refitted = fitted(problem, next_state.start, next_state.prediction, fitted_first.assessment.scales)
    return refitted if refitted.evidence > fitted_first.evidence else fitted_first


@dataclass(frozen=True)
class _Objective:
    """What a step is judged by."""

    basis: Basis
    scales: FloatArray  #: (c,): of the model's error
    slack: float = 1.0

    def assess(self, problem: Problem, start: InitialFit, y: FloatArray) -> Assessment:
        """What a place is worth; `y` (n,)."""
        return assess(self.basis, linear(problem, start, y, self.slack), self.scales, fixed=True)


def _minimised(forward: ForwardModel, problem: Problem, state: SearchState, objective: _Objective) -> SearchState:
    """Steps at fixed scales of the model's error until no amplitude moves."""
    for _ in range(_MAX_STEPS if state.start.jacobian.shape[1] else 0):
        assessment = objective.assess(problem, state.start, state.prediction)
        now = np.concatenate(state.start.amplitudes)
        step = np.concatenate(state.start.split(_targets(state.start, assessment))) - now
        errors = np.sqrt(np.maximum(np.diag(assessment.covariance)[: len(now)], 0.0))
        if np.all(np.abs(step) < CONVERGED * errors):
            break
        moved = _improved(forward, problem, state, step, (objective, assessment))
        if moved is None:
            break
        state = moved
    return state


def _improved(
    forward: ForwardModel,
    problem: Problem,
    state: SearchState,
    step: FloatArray,
    evidence: tuple[_Objective, Assessment],
) -> SearchState | None:
    """The place after a step, or after a part of it, that is better; None if none is."""
    objective, assessment = evidence
    now = np.concatenate(state.start.amplitudes)
    for share in (1.0, 0.4, 0.1):
        trial = replace(state.start, amplitudes=state.start.split(now + share * step))
        y = attempt(forward, problem, trial)
        if y is None:
            continue
        moved = np.concatenate(trial.amplitudes) - now
        trial = replace(trial, jacobian=_corrected(state.start, y - state.prediction, moved))
        trial_assessment = objective.assess(problem, trial, y)
        if trial_assessment.evidence > assessment.evidence:
            return SearchState(trial, y)
        if assessment.evidence - trial_assessment.evidence < _HARDLY:
            break
    return None


def _targets(start: InitialFit, found: Assessment) -> FloatArray:
    count = start.jacobian.shape[1]
    return np.concatenate([c.origin for c in start.candidates]) + found.free[:count]


def _corrected(start: InitialFit, change: FloatArray, step: FloatArray) -> FloatArray:
    """Broyden's update, amplitudes measured in their prior widths."""
    width = np.concatenate([c.width for c in start.candidates])
    scaled = step / width
    length = float(scaled @ scaled)
    if length < 1e-20:
        return start.jacobian
    return np.asarray(start.jacobian + np.outer(change - start.jacobian @ step, scaled / length) / width)


def attempt(forward: ForwardModel, problem: Problem, start: InitialFit) -> FloatArray | None:
    """Predict; None where the model has no equilibrium."""
    try:
        return predict(forward, build(start.candidates, start.amplitudes), problem.nuisances, start.nuisance)
    except NoEquilibriumError:
        return None


def slope(
    forward: ForwardModel, problem: Problem, start: InitialFit, y: FloatArray, index: int, share: float
) -> FloatArray:
    """Change of the prediction per unit of one amplitude, by a one-sided difference that stays inside the bounds.

    `y` (n,).
    """
    flat = np.concatenate(start.amplitudes)
    size = share * np.concatenate([c.steps for c in start.candidates])[index]
    for signed in (size, -size, 0.1 * size, -0.1 * size):
        moved = flat.copy()
        moved[index] += signed
        trial = replace(start, amplitudes=start.split(moved))
        change = np.concatenate(trial.amplitudes)[index] - flat[index]
        if change == 0.0:
            continue
        shifted = attempt(forward, problem, trial)
        if shifted is not None:
            return np.asarray((shifted - y) / change)
    return np.zeros_like(y)
