"""Closure: how much of the gap a model closes on points that the numbers in it have not seen."""

from __future__ import annotations

from dataclasses import dataclass

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.gap import gap, noise_square
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem


@dataclass(frozen=True)
class Closure:
    """Root mean square of (measured - predicted) / sigma on unseen points, nuisances within their tolerances."""

    before: float
    after: float
    closed: float


def unseen(problem: Problem, fitted: Fit) -> FloatArray:
    """Every fold as all others tell it: amplitudes and nuisances without having seen it, (n,)."""
    out = fitted.prediction.copy()
    for fold in problem.folds:
        out[fold.members] = fitted.at(fitted.assessment.unseen(fold))[fold.members]
    return out


def effects_unseen(problem: Problem, fitted: Fit, exact: FloatArray) -> FloatArray:
    """The model with its effects alone, every fold with the amplitudes that all others tell; `exact` (n,)."""
    count = fitted.jacobian.shape[1]
    out = exact.copy()
    for fold in problem.folds:
        moved = (fitted.assessment.unseen(fold) - fitted.assessment.free)[:count]
        out[fold.members] += (fitted.jacobian @ moved)[fold.members]
    return out


def closure(problem: Problem, baseline: Fit, model: Fit) -> Closure:
    """Measure what a model closes on unseen points."""
    before, after = (gap(problem.observations, unseen(problem, f)) for f in (baseline, model))
    floor = noise_square(problem.observations)
    room = before**2 - floor
    closed = 1.0 - max(after**2 - floor, 0.0) / room if room > 0.0 and model.candidates else float("nan")
    return Closure(before, after, closed)
