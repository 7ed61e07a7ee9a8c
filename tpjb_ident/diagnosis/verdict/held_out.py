"""Held out: the gap on points to which a model must extrapolate, with numbers that have not seen them."""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Fault
from tpjb_ident.diagnosis.comparison.unknowns import prediction
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import gap, noise_floor

#: Gaps that differ by less are the same: so far apart are two predictions of points that an effect does not move.
_ALIKE = 0.005


@dataclass(frozen=True)
class Touched:
    """The gap along what one fault moves, in standard deviations of everything else that may be off."""

    label: str
    before: float  #: without it, all other faults there
    after: float
    unseen: bool  #: on points left out of the fit; over all of them where these do not hear the fault

    @property
    def remaining(self) -> float:
        """Share of the squared gap above noise that is left."""
        return _share(self.after, self.before, 1.0)


@dataclass(frozen=True)
class HeldOut:
    """An explanation on points left out of the fit, or on all where these do not show it."""

    fit: Fit
    #: (n,): its faults alone, every tolerance as stated; None: no equilibrium
    exact: FloatArray | None = field(repr=False)
    touched: tuple[Touched, ...] = ()  #: by fault, the largest remainder first; none where one has no equilibrium

    @property
    def rows(self) -> BoolArray:
        """Elements that judge it: those left out, or all where these do not show every fault, (n,)."""
        held = self.fit.problem.held
        return held if all(row.unseen for row in self.touched) else np.ones_like(held)

    def gap(self, predicted: FloatArray) -> float:
        """Gap of a prediction (n,) on them."""
        return gap(self.fit.problem.observations, predicted, self.rows)

    @property
    def as_stated(self) -> float:
        """Gap with exactly the faults, every tolerance as stated."""
        return math.inf if self.exact is None else self.gap(self.exact)

    @functools.cached_property
    def free(self) -> float:
        """Gap with tolerances where the other points put them."""
        return self.gap(free_prediction(self.fit))

    @property
    def before(self) -> float:
        """Gap of the baseline as stated."""
        return self.gap(self.fit.problem.base)

    def remaining(self, after: float) -> float:
        """Share of the baseline's squared gap above noise that a gap leaves; none where it leaves noise alone."""
        return _share(after, self.before, noise_floor(self.fit.problem.observations, self.rows))

    @property
    def along_effects(self) -> dict[str, float]:
        """The gap along what the fault moves that closes it least."""
        first = vars(self.touched[0]) if self.touched else {}
        return {f"touched_{name}": float(value) for name, value in first.items() if name != "label"}

    @property
    def earns_all(self) -> bool:
        """Whether the gap along what a fault moves shrinks by every fault."""
        return bool(self.touched) and self.touched[0].remaining < 1.0

    @property
    def is_shrunk(self) -> bool:
        """Whether every fault halves the gap along what it moves, and the gap over everything does not grow."""
        halved = self.earns_all and self.touched[0].remaining <= Deciding.halved**2
        return halved and self.as_stated < self.before + _ALIKE


def _share(after: float, before: float, floor: float) -> float:
    remainder, room = (max(value**2 - floor**2, 0.0) for value in (after, before))
    return remainder / max(room, 1e-300)


def held_out_gap(run: Map, fit: Fit) -> HeldOut:
    """Solve a model with amplitudes from all other points, without its generic terms, every tolerance as stated."""
    # tolerances are integrated out about the fit: elsewhere a pad may have let go, and K and C have jumped
    theta, refitted, at = fit.linear.theta.copy(), _from_others(fit), fit.unknowns.of_faults
    theta[at] = refitted[at]
    exact = as_stated(run, fit, theta)
    if exact is None:
        return HeldOut(fit, None)
    place, parts = _without_terms(fit, theta)
    complete, changes = _acting(run, fit, place, parts)
    if complete is not None and parts and not changes:
        # without a fault there is no equilibrium there: what each does where all tolerances are as stated
        _, changes = _acting(run, fit, _neutral(place, fit.unknowns.tolerances), parts)
    if complete is None or not changes:
        return HeldOut(fit, exact)
    pairs = zip(parts, changes, strict=True)
    touched = [_touched(fit, place, fault, (complete, change)) for (fault, _), change in pairs]
    return HeldOut(fit, exact, tuple(sorted(touched, key=lambda row: -row.remaining)))


def _acting(
    run: Map, fit: Fit, place: FloatArray, parts: Sequence[tuple[Fault, slice]]
) -> tuple[FloatArray | None, list[FloatArray]]:
    """The prediction somewhere, (n,), and what each fault does to it beside all else; none: one has no equilibrium."""
    places = [place, *(_neutral(place, at) for _, at in parts)]
    complete, *partial = run(prediction, [(fit.faults, theta) for theta in places])
    changes = [complete - part for part in partial if complete is not None and part is not None]
    return complete, changes if len(changes) == len(parts) else []


def as_stated(run: Map, fit: Fit, theta: FloatArray) -> FloatArray | None:
    """What the faults of a fit predict alone, every tolerance as stated, SI, (n,); None: no equilibrium."""
    place = _neutral(_without_terms(fit, theta)[0], fit.unknowns.tolerances)
    (exact,) = run(prediction, [(fit.faults, place)])
    if exact is None:  # a verdict hangs on it
        (exact,) = run(prediction, [(fit.faults, place, True)])
    return None if exact is None else np.asarray(exact * fit.problem.sigma)


def _without_terms(fit: Fit, theta: FloatArray) -> tuple[FloatArray, list[tuple[Fault, slice]]]:
    """Free numbers within their bounds without generic terms, (k,), and where the other faults' are."""
    parts = list(zip(fit.faults, fit.unknowns.slices, strict=True))
    inside = np.clip(theta, fit.unknowns.low, fit.unknowns.high)
    terms = [at for fault, at in parts if fault.is_term]
    return _neutral(inside, *terms), [part for part in parts if not part[0].is_term]


def _neutral(theta: FloatArray, *parts: slice | IntArray) -> FloatArray:
    """Free numbers with some of them where nothing happens, (k,)."""
    out = theta.copy()
    for part in parts:
        out[part] = 0.0
    return out


def _touched(fit: Fit, theta: FloatArray, fault: Fault, acting: tuple[FloatArray, FloatArray]) -> Touched:
    """Project the gap on what a fault moves, seen through noise, model error and all tolerances that are stated.

    `acting`: the prediction with it and what it does, where the fit has put the tolerances, which derivatives count
    back to what is stated: no covariance has how they bend.
    """
    (complete, change), free, held = acting, fit.unknowns.tolerances, fit.problem.held
    columns = fit.linear.jacobian[:, free]
    residual = fit.problem.measured - complete + columns @ theta[free]
    for rows in (held, np.ones_like(held)):
        moved = change[rows]
        weights = np.linalg.solve(_covariance(fit, rows, columns[rows]), moved)
        size = math.sqrt(max(float(weights @ moved), 1e-300))
        if size >= Deciding.enough:
            break
    after = float(weights @ residual[rows]) / size
    return Touched(fault.label, abs(after + size), abs(after), rows is held and not held.all())


def _covariance(fit: Fit, rows: BoolArray, columns: FloatArray) -> FloatArray:
    """Of some elements at the likeliest scale, with numbers of unit variance behind `columns`."""
    return np.asarray(fit.problem.errors.covariance(fit.posterior.leading)[np.ix_(rows, rows)] + columns @ columns.T)


def free_prediction(fit: Fit) -> FloatArray:
    """What a fit predicts with all numbers where the points not held out put them, in closed form, SI, (n,)."""
    problem, linear = fit.problem, fit.linear
    moved = linear.jacobian @ (_from_others(fit) - linear.theta)
    return np.asarray((problem.measured - linear.residual + moved) * problem.sigma)


def _from_others(fit: Fit) -> FloatArray:
    """Free numbers as the points that are not held out tell them, (k,); as all do where none are left."""
    held = fit.problem.held
    rows = ~held if not held.all() else held
    linear, width = fit.linear, fit.linear.width
    columns = (linear.jacobian * width)[rows]
    residual = (linear.residual + linear.jacobian @ linear.theta)[rows]
    return np.asarray(width * (columns.T @ np.linalg.solve(_covariance(fit, rows, columns), residual)))
