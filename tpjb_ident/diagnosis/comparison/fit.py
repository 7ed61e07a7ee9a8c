"""Fit: an explanation at its solved point, all free numbers moved together."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from model.effects import Effect
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Linear, Posterior, posterior
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.comparison.scores import Strain
from tpjb_ident.diagnosis.comparison.unknowns import Unknowns, derivatives, prediction
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.schema import HALF_INTERVAL

#: Steps on one set of derivatives, which every step corrects, at the most; and the fall of chi-square that pays one.
_STEPS, _LEAST = 12, 1.0
#: Parts of a step or of a start that are tried.
_SHARES = (1.0, 0.4, 0.1)
#: Share of its deviation within which a number has arrived.
_ARRIVED = 0.1
#: Scatters whose mean is a tolerance of the whole bearing, with that tolerance where there is one.
_MEANS = {"clearance_scatter": "assembled_clearance", "bore_scatter": "pad_clearance", "pivot_stiffness_scatter": ""}


@dataclass(frozen=True, eq=False)
class Fit:
    """An explanation with what the data say of it."""

    unknowns: Unknowns = field(repr=False)
    linear: Linear = field(repr=False)  #: about its solved point
    posterior: Posterior = field(repr=False)

    @property
    def problem(self) -> Problem:
        """The campaign next to its baseline."""
        return self.unknowns.problem

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Its faults."""
        return self.unknowns.faults

    @property
    def labels(self) -> frozenset[str]:
        """Labels of its faults: what makes two fits the same explanation."""
        return frozenset(fault.label for fault in self.faults)

    @property
    def names(self) -> frozenset[str]:
        """Names of its effects."""
        return frozenset(fault.name for fault in self.faults)

    @property
    def label(self) -> str:
        """Labels, joined."""
        return " + ".join(fault.label for fault in self.faults) or "baseline"

    @property
    def has_terms(self) -> bool:
        """Whether a generic term takes part."""
        return any(fault.is_term for fault in self.faults)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted sizes."""
        return self.unknowns.effects(self.linear.theta)

    def place_of(self, fault: Fault) -> slice:
        """Where the numbers of one of its faults are."""
        return self.unknowns.slices[self.faults.index(fault)]

    @property
    def amplitudes(self) -> tuple[FloatArray, ...]:
        """Posterior means of every fault's amplitudes, within their bounds."""
        unknowns = self.unknowns
        mean = np.clip(self.posterior.mean, unknowns.low, unknowns.high) + unknowns.origin
        return tuple(mean[at] for at in unknowns.slices)

    @property
    def errors(self) -> tuple[FloatArray, ...]:
        """Standard errors of every fault's amplitudes; those on a tolerance's number hold its own scatter besides."""
        deviation = np.sqrt(np.maximum(np.diag(self.posterior.covariance), 0.0))
        pairs = zip(self.faults, self.unknowns.slices, strict=True)
        return tuple(np.hypot(deviation[at], 1.0 if fault.own >= 0 else 0.0) for fault, at in pairs)

    @property
    def sizes(self) -> FloatArray:
        """Posterior means of all tolerances in stated deviations, zero for one that a fault has taken over, (m,)."""
        out = np.zeros(len(self.posterior.mean))
        out[self.unknowns.tolerances] = self.posterior.mean[self.unknowns.tolerances]
        return out[self.unknowns.amplitudes :]

    @functools.cached_property
    def on_bound(self) -> bool:
        """Whether an amplitude is on its bound: the linear form counts the forbidden side too."""
        unknowns, theta = self.unknowns, self.linear.theta
        near = 1e-6 * unknowns.width
        out = (theta <= unknowns.low + near) | (theta >= unknowns.high - near)
        return any(out[at].any() for at in unknowns.slices)

    @functools.cached_property
    def unsized(self) -> tuple[str, ...]:
        """Labels of faults whose size is not told from none: its 95 % interval holds where nothing happens."""
        rows = zip(self.faults, self.amplitudes, self.unknowns.slices, self.errors, strict=True)
        labels = []
        for fault, size, at, error in rows:
            if not np.any(np.abs(size - self.unknowns.origin[at]) > HALF_INTERVAL * error):
                labels.append(fault.label)
        return tuple(labels)

    @property
    def leftover(self) -> str:
        """In words: the model error that it leaves."""
        return f"a model error of {self.posterior.scale:.2f} times the stated one"

    def needs_more(self, scale: float) -> bool:
        """Whether the data speak for a larger model error than this: more than its prior does."""
        errors = self.problem.errors
        wrong = errors.scales > scale
        return float(self.posterior.weights[wrong].sum()) > float(np.exp(errors.log_weights[wrong]).sum())

    @functools.cached_property
    def tolerances(self) -> tuple[Deviation, ...]:
        """Every tolerance that kept its stated prior, and the means of scatters, the farthest out first."""
        mean, strain = self.posterior.mean, self.strain
        columns = (strain.rows @ mean, strain.heard, strain.significance(mean))
        listed = zip(_combinations(self.unknowns)[0], *(column.tolist() for column in columns), strict=True)
        return tuple(sorted(itertools.starmap(Deviation, listed), key=lambda d: -abs(d.significance)))

    @functools.cached_property
    def strain(self) -> Strain:
        """How far they are out, seen through what the data say of them."""
        _, rows = _combinations(self.unknowns)
        return Strain(rows, 1.0 - np.sum((rows @ self.posterior.covariance) * rows, axis=1))

    @functools.cached_property
    def p(self) -> float:
        """Probability that a tolerance is as far out as the farthest one, all of them considered."""
        return self.strain.p(self.posterior.mean)


@dataclass(frozen=True)
class Deviation:
    """How far a tolerance is from what is stated."""

    name: str
    size: float  #: in stated deviations
    heard: float  #: share of its variance that the data take away
    significance: float  #: standard normal where it holds


def _combinations(unknowns: Unknowns) -> tuple[list[str], FloatArray]:
    """Every tolerance by itself, and the mean of every scatter, which does what all pads do together, (c, k).

    All of prior variance 1.
    """
    listed = {int(i): unknowns.problem.nuisances[i - unknowns.amplitudes] for i in unknowns.tolerances}
    unit = np.eye(len(unknowns.width))
    names, rows = [n.label for n in listed.values()], list(unit[unknowns.tolerances])
    sigma = {n.name: n.sigma for n in listed.values()}
    for scatter, common in _MEANS.items():
        members = unit[[i for i, n in listed.items() if n.name == scatter]].sum(axis=0)
        if members.sum() > 1:
            common_row = unit[[i for i, n in listed.items() if n.name == common]].sum(axis=0)
            names.append(f"{scatter}, mean of all pads")
            rows.append(sigma[scatter] * members / members.sum() + sigma.get(common, 0.0) * common_row)
    table = np.reshape(rows, (-1, len(unit)))
    return names, table / np.linalg.norm(table, axis=1)[:, None]


@dataclass(frozen=True)
class Start:
    """An explanation to be fitted, and where its fit begins, on derivatives known from nearby."""

    faults: tuple[Fault, ...]
    place: FloatArray = field(repr=False)
    jacobian: FloatArray = field(repr=False)
    coarse: bool = False  #: past jumps of K and C first: every element off by itself, tolerances held
    estimate: float = 0.0  #: log p(y, model) to first order [nats]
    risen: bool = False  #: scored in the place of a fault whose fit has risen already

    @property
    def labels(self) -> frozenset[str]:
        """What makes two starts the same explanation."""
        return frozenset(fault.label for fault in self.faults)


def fitted(run: Map, problem: Problem, start: Start) -> Fit | None:
    """Fit from a start; None where there is no equilibrium."""
    unknowns = Unknowns(problem, start.faults)
    linear = _solved(run, unknowns, start)
    if linear is None:
        return None
    fit = _settled(run, unknowns, _past_jumps(run, unknowns, linear) if start.coarse else linear)
    # a direction beside its grid does nothing where nothing is there yet, and its derivative there says so
    idle = [i for i in unknowns.of_faults if not fit.linear.jacobian[:, i].any()]
    return _settled(run, unknowns, _renewed(run, unknowns, fit.linear, idle)) if idle else fit


def _solved(run: Map, unknowns: Unknowns, start: Start) -> Linear | None:
    """The model where a start begins, or nearer to what is stated, where there is no equilibrium."""
    for share in _SHARES:
        theta = share * np.clip(start.place, unknowns.low, unknowns.high)
        (predicted,) = tuple(run(prediction, [(unknowns.faults, theta)]))
        if predicted is not None:
            return Linear(unknowns.problem.measured - predicted, theta, start.jacobian, unknowns.width)
    return None


def _past_jumps(run: Map, unknowns: Unknowns, linear: Linear) -> Linear:
    """A coarse start: every element off by itself, tolerances held at first."""
    held, coarse = unknowns.width.copy(), unknowns.problem.errors.coarse
    held[unknowns.tolerances] = Deciding.held
    # those from before the jump say nothing behind it; of tolerances that are held little is asked
    linear = _renewed(run, unknowns, linear, unknowns.of_faults)
    linear = _stepped(run, unknowns, replace(linear, width=held), coarse)
    return _stepped(run, unknowns, replace(linear, width=unknowns.width), coarse)


def refined(run: Map, fit: Fit) -> Fit:
    """The same with derivatives of its own, moved on by them; as it is, where they would say the same."""
    unknowns = fit.unknowns
    if fit.posterior.scale <= Deciding.right and _foretells(run, fit):
        return fit
    asked = [i for i, reading in enumerate(unknowns.is_reading) if not reading]
    return _settled(run, unknowns, _renewed(run, unknowns, fit.linear, asked))


def _foretells(run: Map, fit: Fit) -> bool:
    """Whether derivatives foretell a step along a draw of the posterior, there and back: so curvature cancels."""
    unknowns, linear = fit.unknowns, fit.linear
    draw = np.random.default_rng(0).standard_normal(len(linear.theta))
    room = np.minimum(linear.theta - unknowns.low, unknowns.high - linear.theta)
    step = np.clip(np.linalg.cholesky(fit.posterior.covariance) @ draw, -room, room)
    ahead, back = run(prediction, [(unknowns.faults, linear.theta + end) for end in (step, -step)])
    if ahead is None or back is None:
        return False
    surprise = unknowns.problem.errors.white(0.5 * (ahead - back) - linear.jacobian @ step, fit.posterior.leading)
    return float(surprise @ surprise) < Deciding.surprise


def rise(run: Map, fit: Fit, index: int, deviations: float) -> float:
    """Rise of chi-square where a number is held off by some of its deviations and all others are fitted anew.

    Infinite out of bounds or without an equilibrium.
    """
    unknowns, linear, covariance = Unknowns(fit.problem, fit.faults), fit.linear, fit.posterior.covariance
    place = fit.posterior.mean + deviations * covariance[:, index] / math.sqrt(covariance[index, index])
    if not unknowns.low[index] <= place[index] <= unknowns.high[index]:
        return math.inf
    unknowns.low[index] = unknowns.high[index] = place[index]
    held = linear.jacobian.copy()
    held[:, index] = 0.0
    place = np.clip(place, unknowns.low, unknowns.high)
    (predicted,) = run(prediction, [(fit.faults, place)])
    if predicted is None:
        return math.inf
    start = replace(linear, theta=place, residual=fit.problem.measured - predicted, jacobian=held)
    errors, scale = fit.problem.errors, fit.posterior.leading
    moved = _stepped(run, unknowns, start, errors)
    return max(_chi_square(errors, scale, moved) - _chi_square(errors, scale, linear), 0.0)


def _chi_square(errors: ErrorModel, scale: int, at: Linear) -> float:
    white = errors.white(at.residual, scale)
    return float(white @ white + np.sum((at.theta / at.width) ** 2))


def _settled(run: Map, unknowns: Unknowns, linear: Linear) -> Fit:
    moved = _stepped(run, unknowns, linear, unknowns.problem.errors)
    return Fit(unknowns, moved, posterior(unknowns.problem.errors, moved))


def _renewed(run: Map, unknowns: Unknowns, linear: Linear, asked: Sequence[int]) -> Linear:
    """A model with derivatives of its own by some numbers; what acts on readings has them already."""
    parts = [asked[k :: run.opened.count] for k in range(run.opened.count)]
    jacobian = linear.jacobian.copy()
    jobs = [(unknowns.faults, linear.theta, part) for part in parts]
    for part, columns in zip(parts, run(derivatives, jobs), strict=True):
        for index, column in zip(part, columns, strict=True):
            if column is not None:
                jacobian[:, index] = column
    return replace(linear, jacobian=jacobian)


def _stepped(run: Map, unknowns: Unknowns, linear: Linear, errors: ErrorModel) -> Linear:
    """Steps to the most probable point while they pay; each is solved, and corrects the derivatives."""
    for _ in range(_STEPS):
        state = posterior(errors, linear)
        target = np.clip(state.mean, unknowns.low, unknowns.high)
        deviation = np.sqrt(np.maximum(np.diag(state.covariance), 1e-300))
        if np.all(np.abs(target - linear.theta) < _ARRIVED * deviation):
            return linear

        cost = functools.partial(_chi_square, errors, state.leading)
        moved = _step(run, unknowns, linear, target, cost)
        if moved is None:
            return linear
        gain, linear = cost(linear) - cost(moved), moved
        if gain < _LEAST:
            return linear
    return linear


def _step(
    run: Map, unknowns: Unknowns, linear: Linear, target: FloatArray,
    cost: Callable[[Linear], float],
) -> Linear | None:  # fmt: skip
    """A step towards a target, shorter where it does not pay, with derivatives corrected by what it showed."""
    most = cost(linear)
    for share in _SHARES:
        theta = linear.theta + share * (target - linear.theta)
        (new,) = tuple(run(prediction, [(unknowns.faults, theta)]))
        if new is None:
            continue
        moved = replace(linear, theta=theta, residual=unknowns.problem.measured - new)
        if cost(moved) < most:
            return _corrected(unknowns, linear, moved)
    return None


def _corrected(unknowns: Unknowns, linear: Linear, moved: Linear) -> Linear:
    """Derivatives that would have foretold a step, the least change in units of the priors' widths (Broyden)."""
    change = moved.theta - linear.theta
    surprise = linear.residual - moved.residual - linear.jacobian @ change
    step = change / unknowns.width
    step[unknowns.is_reading] = 0.0  # these are linear
    length = float(step @ step)
    if length < 1e-20:
        return moved
    return replace(moved, jacobian=linear.jacobian + np.outer(surprise, step / length) / unknowns.width)
