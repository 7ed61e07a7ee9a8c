"""Fit: amplitudes of effects together with everything that may be off, by damped Gauss-Newton steps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from model.effects import Effect
from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import ForwardModel, NoEquilibriumError
from tpjb_ident.diagnose.forward.nuisance import column_of, predict
from tpjb_ident.diagnose.forward.workers import Map
from tpjb_ident.diagnose.search.assessment import Assessment, Linear, assess
from tpjb_ident.diagnose.search.problem import Problem

MAX_STEPS = 4
#: Share of their tolerances that nuisances have at first.
TIGHT = 0.2
#: A fit is settled when a step would move every amplitude by less than this share of its standard error.
SETTLED = 0.1
#: A step that loses less than this [nats] is not tried shorter: it loses by its derivative, which is better known after
#: it, and not by its length.
HARDLY = 0.3
#: How often a fit takes derivatives of its own.
ROUNDS = 3
#: Steps on the same derivatives, which every step corrects: one run of the model each, where derivatives take thirty.
STEPS_BETWEEN = 4


@dataclass(frozen=True)
class Fit:
    """Effects fitted together, nuisances beside them.

    Attributes
    ----------
    candidates : tuple of Candidate
    amplitudes : tuple of (k_i,) ndarray
        In the nearly linear forms.
    nuisance : (m,) ndarray
        Where the model was taken, in standard deviations.
    prediction : (n,) ndarray
        There, readings included.
    jacobian : (n, k) ndarray
        Per unit of every amplitude.
    columns : (n, m) ndarray
        Per standard deviation of every nuisance.
    assessment : Assessment
    """

    candidates: tuple[Candidate, ...]
    amplitudes: tuple[FloatArray, ...]
    nuisance: FloatArray = field(repr=False)
    prediction: FloatArray = field(repr=False)
    jacobian: FloatArray = field(repr=False)
    columns: FloatArray = field(repr=False)
    assessment: Assessment = field(repr=False)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted sizes."""
        return build(self.candidates, self.amplitudes)

    @property
    def label(self) -> str:
        """Names, joined."""
        return " + ".join(c.label for c in self.candidates) or "baseline"

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(c.name for c in self.candidates)

    @property
    def evidence(self) -> float:
        """Log evidence [nats]."""
        return self.assessment.evidence

    @property
    def slices(self) -> tuple[slice, ...]:
        """Where every candidate's amplitudes stand among the free numbers."""
        ends = np.cumsum([0, *(len(a) for a in self.amplitudes)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))

    @property
    def errors(self) -> FloatArray:
        """Standard errors of all amplitudes, (k,)."""
        count = self.jacobian.shape[1]
        return np.sqrt(np.maximum(np.diag(self.assessment.covariance)[:count], 0.0))

    @property
    def at_bound(self) -> bool:
        """Whether some amplitude has run into a physical bound."""
        for c, a in zip(self.candidates, self.amplitudes, strict=True):
            low, high = c.limits
            size = 1e-6 * np.maximum(np.abs(low), np.abs(high))
            size = np.where(np.isfinite(size), size, 0.0)
            if np.any((a <= low + size) | (a >= high - size)):
                return True
        return False

    def at(self, free: FloatArray) -> FloatArray:
        """Prediction at other free numbers (counted from their priors' means), to first order, (n,)."""
        columns = np.column_stack([self.jacobian, self.columns])
        return self.prediction + columns @ (free - _free(self.candidates, self.amplitudes, self.nuisance))


def build(candidates: Sequence[Candidate], amplitudes: Sequence[FloatArray]) -> tuple[Effect, ...]:
    """Effects of candidates at amplitudes."""
    return tuple(c.effect(a) for c, a in zip(candidates, amplitudes, strict=True))


def _free(candidates: Sequence[Candidate], amplitudes: Sequence[FloatArray], nuisance: FloatArray) -> FloatArray:
    moved = [a - c.origin for c, a in zip(candidates, amplitudes, strict=True)]
    return np.concatenate([*moved, nuisance]) if moved else nuisance


@dataclass(frozen=True)
class Start:
    """Where a fit begins.

    Attributes
    ----------
    candidates : tuple of Candidate
    amplitudes : tuple of (k_i,) ndarray
    jacobian : (n, k) ndarray
        Derivatives that are known from nearby; steps correct them.
    nuisance : (m,) ndarray
        Where nuisances stand while amplitudes move.
    columns : (n, m) ndarray
    """

    candidates: tuple[Candidate, ...]
    amplitudes: tuple[FloatArray, ...]
    jacobian: FloatArray = field(repr=False)
    nuisance: FloatArray = field(repr=False)
    columns: FloatArray = field(repr=False)

    def split(self, flat: FloatArray) -> tuple[FloatArray, ...]:
        """Amplitudes by candidate, inside their bounds."""
        out, at = [], 0
        for c in self.candidates:
            low, high = c.limits
            out.append(np.clip(flat[at : at + len(low)], low, high))
            at += len(low)
        return tuple(out)


def linear(problem: Problem, start: Start, prediction: FloatArray, slack: float = 1.0) -> Linear:
    """Linear model about a prediction; `slack` scales the tolerances of all nuisances."""
    columns = problem.scaled(np.column_stack([start.jacobian, start.columns]))
    free = _free(start.candidates, start.amplitudes, start.nuisance)
    width = np.concatenate([*(c.width for c in start.candidates), np.full(start.columns.shape[1], slack)])
    residual = problem.scaled(problem.observations.value - prediction) + columns @ free
    return Linear(residual, columns, width)


def fitted(problem: Problem, start: Start, prediction: FloatArray, scales: FloatArray | None = None) -> Fit:
    """A fit where a model stands, assessed."""
    found = assess(problem.basis, linear(problem, start, prediction), scales)
    return Fit(start.candidates, start.amplitudes, start.nuisance, prediction, start.jacobian, start.columns, found)


@dataclass(frozen=True)
class _Place:
    """Where all free numbers stand, and what the model predicts there."""

    start: Start
    prediction: FloatArray

    def cost(self, problem: Problem, weight: FloatArray) -> float:
        """Squared misfit under noise and model error, plus that of all priors."""
        z = problem.scaled(problem.observations.value - self.prediction)
        free = _free(self.start.candidates, self.start.amplitudes, self.start.nuisance)
        width = np.concatenate([*(c.width for c in self.start.candidates), np.ones(len(self.start.nuisance))])
        return float(z @ weight @ z + np.sum((free / width) ** 2))


def fit(forward: ForwardModel, problem: Problem, start: Start) -> Fit | None:
    """Fit amplitudes; nuisances follow to first order.

    First the effects alone have to do it: far from the answer nuisances, linear as they are here, would bend the way.
    Then these are as free as stated, the model counting as wrong by what is stated and no more: where it may be wrong
    by anything, nothing needs to move. Last by what the residual tells.

    Derivatives are corrected along every step (Broyden, Math. Comp. 19 (1965) 577): a step costs one run of the model.

    Returns
    -------
    Fit or None
        None where the model has no equilibrium near the start.
    """
    y = attempt(forward, problem, start)
    if y is None:
        return None
    here = _descended(forward, problem, _Place(start, y), problem.basis.stated, TIGHT)
    here = _descended(forward, problem, here, problem.basis.stated)
    found = fitted(problem, here.start, here.prediction)
    there = _descended(forward, problem, here, found.assessment.scales)
    if there is here:
        return found
    other = fitted(problem, there.start, there.prediction, found.assessment.scales)
    return other if other.evidence > found.evidence else found


def _descended(forward: ForwardModel, problem: Problem, here: _Place, scales: FloatArray, slack: float = 1.0) -> _Place:
    """Steps at fixed scales of the model's error until no amplitude moves."""
    for _ in range(MAX_STEPS if here.start.jacobian.shape[1] else 0):
        found = assess(problem.basis, linear(problem, here.start, here.prediction, slack), scales, fixed=True)
        now = np.concatenate(here.start.amplitudes)
        step = np.concatenate(here.start.split(_targets(here.start, found))) - now
        errors = np.sqrt(np.maximum(np.diag(found.covariance)[: len(now)], 0.0))
        if np.all(np.abs(step) < SETTLED * errors):
            break
        moved = _improved(forward, problem, here, step, found, slack)
        if moved is None:
            break
        here = moved
    return here


def _improved(
    forward: ForwardModel, problem: Problem, here: _Place, step: FloatArray, found: Assessment, slack: float
) -> _Place | None:
    """The place after a step, or after a part of it, that is better; None if none is."""
    now = np.concatenate(here.start.amplitudes)
    for share in (1.0, 0.4, 0.1):
        trial = replace(here.start, amplitudes=here.start.split(now + share * step))
        y = attempt(forward, problem, trial)
        if y is None:
            continue
        taken = np.concatenate(trial.amplitudes) - now
        trial = replace(trial, jacobian=_corrected(here.start, y - here.prediction, taken))
        told = assess(problem.basis, linear(problem, trial, y, slack), found.scales, fixed=True)
        if told.evidence > found.evidence:
            return _Place(trial, y)
        if found.evidence - told.evidence < HARDLY:
            break
    return None


def _targets(start: Start, found: Assessment) -> FloatArray:
    count = start.jacobian.shape[1]
    return np.concatenate([c.origin for c in start.candidates]) + found.free[:count]


def _corrected(start: Start, change: FloatArray, step: FloatArray) -> FloatArray:
    """Broyden's update, amplitudes measured in their prior widths."""
    width = np.concatenate([c.width for c in start.candidates])
    scaled = step / width
    length = float(scaled @ scaled)
    if length < 1e-20:
        return start.jacobian
    return np.asarray(start.jacobian + np.outer(change - start.jacobian @ step, scaled / length) / width)


def settle(run: Map, problem: Problem, found: Fit, rounds: int = ROUNDS) -> Fit:
    """Give a fit derivatives of its own, those of the nuisances too, and move all of them together.

    Parameters
    ----------
    run : Map
        See `workers`.
    problem : Problem
    found : Fit
    rounds : int
        How often derivatives are taken.
    """
    start = Start(found.candidates, found.amplitudes, found.jacobian, found.nuisance, found.columns)
    here = _Place(start, found.prediction)
    scales = found.assessment.scales
    for number in range(rounds):
        if number:
            here = replace(here, start=_renewed(run, problem, here.start, here.prediction))
            found = fitted(problem, here.start, here.prediction, scales)
            scales = found.assessment.scales
        moved = False
        for _ in range(STEPS_BETWEEN):
            there, stepped = _stepped(run, problem, here, found)
            if not stepped:
                break
            here, moved = _learnt(problem, here, there), True
            found = fitted(problem, here.start, here.prediction, scales)
            scales = found.assessment.scales
        if number and not moved:
            break
    return found


def _learnt(problem: Problem, here: _Place, there: _Place) -> _Place:
    """Correct all derivatives by what a step showed, in units of the priors' widths (Broyden, as in `fit`)."""
    count = here.start.jacobian.shape[1]
    width = np.concatenate([*(c.width for c in here.start.candidates), np.ones(len(here.start.nuisance))])
    told = _free(there.start.candidates, there.start.amplitudes, there.start.nuisance)
    step = (told - _free(here.start.candidates, here.start.amplitudes, here.start.nuisance)) / width
    columns = np.column_stack([here.start.jacobian, here.start.columns]) * width
    change = there.prediction - here.prediction - columns @ step
    # what acts on readings is linear
    step[count:][[one.column is not None for one in problem.nuisances]] = 0.0
    length = float(step @ step)
    if length < 1e-20:
        return there
    columns = (columns + np.outer(change, step / length)) / width
    return replace(there, start=replace(there.start, jacobian=columns[:, :count], columns=columns[:, count:]))


def _stepped(run: Map, problem: Problem, here: _Place, found: Fit) -> tuple[_Place, bool]:
    """Take the step that a linear model proposes, or a part of it; whether it was one worth taking."""
    weight: FloatArray = np.asarray(np.linalg.inv(problem.basis.covariance(found.assessment.scales)), float)
    free = found.assessment.free
    now = _free(here.start.candidates, here.start.amplitudes, here.start.nuisance)
    errors = np.sqrt(np.maximum(np.diag(found.assessment.covariance), 1e-300))
    if np.all(np.abs(free - now) < SETTLED * errors):
        return here, False
    cost = here.cost(problem, weight)
    for share in (1.0, 0.4, 0.1):
        start = _moved(here.start, now + share * (free - now))
        (y,) = tuple(run(_attempt, [(start,)]))
        if y is not None:
            there = _Place(start, y)
            if there.cost(problem, weight) < cost:
                return there, True
    return here, False


def _moved(start: Start, free: FloatArray) -> Start:
    count = start.jacobian.shape[1]
    origin = np.concatenate([c.origin for c in start.candidates]) if start.candidates else np.zeros(0)
    return replace(start, amplitudes=start.split(origin + free[:count]), nuisance=free[count:])


def _renewed(run: Map, problem: Problem, start: Start, y: FloatArray) -> Start:
    count = start.jacobian.shape[1]
    jobs = [(start, y, i) for i in range(count + len(problem.nuisances))]
    columns = list(run(_column, jobs))
    nothing = np.zeros((len(y), 0))
    jacobian = np.column_stack(columns[:count]) if count else nothing
    return replace(start, jacobian=jacobian, columns=np.column_stack([nothing, *columns[count:]]))


def _column(forward: ForwardModel, problem: Problem, start: Start, y: FloatArray, index: int) -> FloatArray:
    count = start.jacobian.shape[1]
    if index < count:
        return slope(forward, problem, start, y, index, 0.1)
    effects = build(start.candidates, start.amplitudes)
    try:
        return column_of(forward, effects, problem.nuisances, start.nuisance, y, index - count)
    except NoEquilibriumError:
        return np.asarray(start.columns[:, index - count])


def _attempt(forward: ForwardModel, problem: Problem, start: Start) -> FloatArray | None:
    return attempt(forward, problem, start)


def attempt(forward: ForwardModel, problem: Problem, start: Start) -> FloatArray | None:
    """Predict; None where the model has no equilibrium."""
    try:
        return predict(forward, build(start.candidates, start.amplitudes), problem.nuisances, start.nuisance)
    except NoEquilibriumError:
        return None


def slope(forward: ForwardModel, problem: Problem, start: Start, y: FloatArray, index: int, share: float) -> FloatArray:
    """Change of the prediction per unit of one amplitude, by a one-sided difference that stays inside the bounds.

    Parameters
    ----------
    share : float
        Step, in typical sizes.

    Returns
    -------
    (n,) ndarray
        Zero where the model has no equilibrium on either side.
    """
    flat = np.concatenate(start.amplitudes)
    size = share * np.concatenate([c.steps for c in start.candidates])[index]
    for signed in (size, -size, 0.1 * size, -0.1 * size):
        moved = flat.copy()
        moved[index] += signed
        trial = replace(start, amplitudes=start.split(moved))
        taken = np.concatenate(trial.amplitudes)[index] - flat[index]
        if taken == 0.0:
            continue
        other = attempt(forward, problem, trial)
        if other is not None:
            return np.asarray((other - y) / taken)
    return np.zeros_like(y)
