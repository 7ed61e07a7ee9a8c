"""Closure: how much of the gap a model closes on points that no fit has seen, beside three controls.

    closure = 1 - (chi2_after - n) / (chi2_before - n)

on the held-out points, whitened with noise, tolerance and calibration errors. The controls share the axis: the best
effect that was not named (*wrong effect*), a Gaussian process that closes what can be closed and names nothing
(*ceiling*), and the same selection on campaigns with nothing in them (*placebo*).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search

DRAWS = 300
#: Amplitudes of the Gaussian process that are tried, in stated model tolerances.
AMPLITUDES = np.geomspace(0.03, 100.0, 15)


@dataclass(frozen=True)
class Closure:
    """Squared misfit per held-out point, and the share of the gap that is closed.

    Attributes
    ----------
    before, after : float
        Squared whitened misfit per held-out point; 1 is what noise and tolerance leave.
    closed, lo, hi : float
        Closure with its 95 % interval from resampled blocks; NaN where there was no gap on held-out points.
    wrong_name : str
    wrong, ceiling : float
        Closure by the best effect that was not named and by a Gaussian process.
    placebo : (float, float, float)
        Fall of the squared misfit per held-out point when the best effect is added to campaigns that lack none:
        5 %, 50 % and 95 % quantiles.
    """

    before: float
    after: float
    closed: float
    lo: float
    hi: float
    wrong_name: str
    wrong: float
    ceiling: float
    placebo: tuple[float, float, float]

    def to_dict(self) -> dict[str, object]:
        """Plain data for ``diagnosis.json``."""
        return {
            "heldout_before": self.before, "heldout_after": self.after, "closed": self.closed,
            "closed_lo": self.lo, "closed_hi": self.hi,
            "wrong_effect": {"name": self.wrong_name, "closed": self.wrong}, "gaussian_process_closed": self.ceiling,
            "placebo_fall": list(self.placebo),
        }  # fmt: skip


def closure(problem: Problem, found: Search) -> Closure | None:
    """Measure what the model of a search closes; None without held-out points."""
    if not problem.held.any():
        return None
    seen = _Seen(problem)
    before, after = seen.blocks(problem.base), seen.blocks(found.model.prediction)
    lo, hi = _interval(before, after)
    wrong = next((f for f in found.singles if not f.names & _named(found)), None)
    columns = {s.candidate: s.column for s in found.first_scores}
    return Closure(
        before=seen.per_point(problem.base),
        after=seen.per_point(found.model.prediction),
        closed=_closed(before, after) if found.model.candidates else float("nan"),
        lo=lo,
        hi=hi,
        wrong_name=wrong.label if wrong is not None else "",
        wrong=_closed(before, seen.blocks(wrong.prediction)) if wrong is not None else float("nan"),
        ceiling=_closed(before, seen.blocks(gaussian_process(problem))),
        placebo=_placebo(problem, columns),
    )


def held_out_misfit(problem: Problem, prediction: FloatArray) -> float:
    """Squared whitened misfit per held-out point."""
    return _Seen(problem).per_point(prediction)


def _named(found: Search) -> frozenset[str]:
    return found.model.names


class _Seen:
    """Held-out points, whitened all together, their squares summed by block."""

    def __init__(self, problem: Problem) -> None:
        held = problem.held
        self.held, self.value = held, problem.observations.value
        part = problem.covariance[np.ix_(held, held)]
        scale = np.sqrt(np.diag(part))
        self.factor = scale[:, None] * np.linalg.cholesky(part / np.outer(scale, scale))
        names = problem.observations.blocks[held]
        self.members = [names == name for name in sorted(set(names))]

    def white(self, difference: FloatArray) -> FloatArray:
        """Whitened held-out part of vectors (N,) or (N, m)."""
        return np.asarray(np.linalg.solve(self.factor, difference[self.held]))

    def per_point(self, prediction: FloatArray) -> float:
        """Squared misfit per point."""
        return float(np.mean(self.white(self.value - prediction) ** 2))

    def blocks(self, prediction: FloatArray) -> FloatArray:
        """Per block: squared misfit less its expectation, (b,)."""
        z = self.white(self.value - prediction) ** 2
        return np.array([float(np.sum(z[m])) - int(m.sum()) for m in self.members])


def _closed(before: FloatArray, after: FloatArray) -> float:
    # without a clear gap there is nothing to close, and the ratio means nothing
    return float(1.0 - after.sum() / before.sum()) if before.sum() > 10.0 else float("nan")


def _interval(before: FloatArray, after: FloatArray) -> tuple[float, float]:
    rng = np.random.default_rng(20190761)
    picks = rng.integers(len(before), size=(1000, len(before)))
    ratios = [_closed(before[p], after[p]) for p in picks]
    good = [r for r in ratios if np.isfinite(r)]
    return (float(np.quantile(good, 0.025)), float(np.quantile(good, 0.975))) if len(good) > 100 else (np.nan, np.nan)


def gaussian_process(problem: Problem) -> FloatArray:
    """Baseline plus the mean of a smooth discrepancy learnt from the training points, (n,)."""
    train = ~problem.held
    sigma = problem.observations.sigma
    columns = np.column_stack([g.columns for g in problem.groups])
    size = np.sqrt(
        np.sum(columns**2, axis=0) / np.maximum(np.sum((columns != 0) * sigma[:, None] ** 2, axis=0), 1e-300)
    )
    smooth = (columns / size) @ (columns / size).T
    residual = (problem.observations.value - problem.base)[train]
    unit = np.sqrt(np.diag(problem.covariance))[train]
    best: tuple[float, FloatArray] = (np.inf, problem.base)
    for amplitude in AMPLITUDES:
        total = (problem.covariance + amplitude**2 * smooth)[np.ix_(train, train)] / np.outer(unit, unit)
        factor = cho_factor(total, lower=True)
        weight = cho_solve(factor, residual / unit)
        cost = float(residual / unit @ weight + 2.0 * np.sum(np.log(np.diag(factor[0]))))
        if cost < best[0]:
            best = cost, problem.base + amplitude**2 * smooth[:, train] @ (weight / unit)
    return best[1]


def _placebo(problem: Problem, columns: Mapping[Candidate, FloatArray]) -> tuple[float, float, float]:
    """Add the best effect, to first order, to campaigns drawn from the baseline and the covariance."""
    seen, misfit = _Seen(problem), problem.misfit
    scale = np.sqrt(np.diag(problem.covariance))
    factor = scale[:, None] * np.linalg.cholesky(problem.covariance / np.outer(scale, scale))
    draws = factor @ np.random.default_rng(61).standard_normal((len(scale), DRAWS))
    table = np.column_stack(list(columns.values()))
    train, held, effect = misfit.whiten(draws), seen.white(draws), seen.white(table)
    white = misfit.whiten(table)
    power = np.maximum(np.sum(white**2, axis=0), 1e-300)
    toward = white.T @ train
    best = np.argmax(toward**2 / power[:, None], axis=0)
    amplitude = toward[best, np.arange(DRAWS)] / power[best]
    fall = np.sum(held**2, axis=0) - np.sum((held - effect[:, best] * amplitude) ** 2, axis=0)
    low, middle, high = np.quantile(fall / len(held), [0.05, 0.5, 0.95])
    return float(low), float(middle), float(high)
