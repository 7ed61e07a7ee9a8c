"""Held out: the gap on points to which a model must extrapolate, with numbers that have not seen them."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.unknowns import Unknowns, prediction
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.gap import gap, noise_floor


@dataclass(frozen=True)
class HeldOut:
    """An explanation on held-out points."""

    fit: Fit
    stated: FloatArray | None = field(
        repr=False
    )  #: (n,): its faults alone, every tolerance as stated; None: no equilibrium

    @property
    def as_stated(self) -> float:
        """Gap with exactly the faults, every tolerance as stated."""
        return float("inf") if self.stated is None else _gap(self.fit, self.stated)

    @functools.cached_property
    def free(self) -> float:
        """Gap with tolerances where the other points put them."""
        return free_gap(self.fit)

    @property
    def before(self) -> float:
        """Gap of the baseline as stated."""
        return _gap(self.fit, self.fit.problem.base)

    def remaining(self, after: float) -> float:
        """Share of the baseline's squared gap above noise that a gap leaves; none where it leaves noise alone."""
        floor = noise_floor(self.fit.problem.observations, self.fit.problem.held)
        rest, room = (max(value**2 - floor**2, 0.0) for value in (after, self.before))
        return rest / max(room, 1e-300)


def held_out_gap(run: Map, fit: Fit) -> HeldOut:
    """Solve a model with amplitudes from all other points, without its generic terms, every tolerance as stated."""
    theta = np.clip(_from_others(fit), fit.unknowns.low, fit.unknowns.high)
    faults = tuple(fault for fault in fit.faults if not fault.is_term)
    unknowns = Unknowns(fit.problem, faults)
    alone = np.zeros(len(unknowns.width))
    for fault, at in zip(fit.faults, fit.unknowns.slices, strict=True):
        if not fault.is_term:
            alone[unknowns.slices[faults.index(fault)]] = theta[at]
    (predicted,) = tuple(run(prediction, [(faults, alone)]))
    return HeldOut(fit, None if predicted is None else predicted * fit.problem.sigma)


def free_gap(fit: Fit) -> float:
    """Held-out gap with all numbers where the other points put them, in closed form."""
    return _gap(fit, free_prediction(fit))


def free_prediction(fit: Fit) -> FloatArray:
    """What a fit predicts with all numbers where the points that are not held out put them, SI, (n,)."""
    moved = _from_others(fit) - fit.point.theta
    return np.asarray((fit.point.prediction + fit.point.jacobian @ moved) * fit.problem.sigma)


def _gap(fit: Fit, predicted: FloatArray) -> float:
    return gap(fit.problem.observations, predicted, fit.problem.held)


def _from_others(fit: Fit) -> FloatArray:
    """Free numbers as the points that are not held out tell them, (k,); as all do where none are left."""
    held = fit.problem.held
    rows = ~held if not held.all() else held
    linear, width = fit.linear, fit.unknowns.width
    columns = (linear.jacobian * width)[rows]
    total = fit.problem.errors.covariance(fit.posterior.leading)[np.ix_(rows, rows)] + columns @ columns.T
    residual = (linear.residual + linear.jacobian @ linear.theta)[rows]
    return np.asarray(width * (columns.T @ np.linalg.solve(total, residual)))
