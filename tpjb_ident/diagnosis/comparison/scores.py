"""Scores: the evidence of one more fault beside a fitted model, to first order about the fault's own path.

No prediction is needed: the model's residual and derivatives at its solved point, and the path of every fault from
the baseline. At every scale the numbers that the model has already are integrated out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp, ndtr

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Linear
from tpjb_ident.diagnosis.comparison.paths import Path

#: Scales of which straight columns give the amplitudes to look at.
_EVERY = 4


@dataclass(frozen=True)
class Score:
    """What a fault would make of a model."""

    path: Path
    total: float  #: log p(y | model and fault) [nats]
    amplitudes: FloatArray = field(repr=False)  #: (k,): most probable, counted from where nothing happens
    scale: float  #: likeliest scale of the model's error
    p: float  #: probability that a tolerance would be as far out as the farthest one


@dataclass(frozen=True)
class Strain:
    """How far tolerances are out: ``rows @ theta / deviation`` is standard normal where they hold."""

    rows: FloatArray = field(repr=False)  #: (c, k)
    deviation: FloatArray = field(repr=False)  #: (c,)

    def p(self, theta: FloatArray) -> float:
        """Probability that one of them is as far out as the farthest one; `theta` (k,)."""
        if not len(self.rows):
            return 1.0
        farthest = float(np.max(np.abs(self.rows @ theta) / self.deviation))
        return min(1.0, len(self.rows) * 2.0 * float(ndtr(-farthest)))


@dataclass(frozen=True)
class _Level:
    """Residual and path columns at one scale, the model's own numbers integrated out."""

    product: FloatArray  #: (1 + c, 1 + c)
    lower: FloatArray  #: (k, k): Cholesky factor of the numbers' inverse covariance, in prior widths
    shared: FloatArray  #: (k, 1 + c)

    @classmethod
    def of(cls, white: FloatArray, count: int) -> _Level:
        own, rest = white[:, :count], white[:, count:]
        lower = np.linalg.cholesky(own.T @ own + np.eye(count))
        shared = np.linalg.solve(lower, own.T @ rest)
        return cls(rest.T @ rest - shared.T @ shared, np.asarray(lower, float), shared)

    def mean(self, at: slice, weights: FloatArray) -> FloatArray:
        """The model's own numbers beside path columns with some weights, in prior widths, (k,)."""
        return np.asarray(np.linalg.solve(self.lower.T, self.shared[:, 0] - self.shared[:, at] @ weights))


def scores(errors: ErrorModel, linear: Linear, paths: Sequence[Path], strain: Strain) -> list[Score]:
    """Score every fault beside a model, the best first."""
    if not paths:
        return []
    offset = linear.residual + linear.jacobian @ linear.theta
    stacked = np.column_stack([linear.jacobian * linear.width, offset, *(path.columns for path in paths)])
    rotated = errors.basis @ stacked
    count = linear.jacobian.shape[1]
    levels = [_Level.of(rotated * shrink[:, None], count) for shrink in errors.shrink]
    widths = Strain(strain.rows * linear.width, strain.deviation)
    out, start = [], 1
    for path in paths:
        at = slice(start, start + path.columns.shape[1])
        start = at.stop
        out.append(_score(path, at, levels, errors, widths))
    return sorted(out, key=lambda score: -score.total)


def _score(path: Path, at: slice, levels: Sequence[_Level], errors: ErrorModel, strain: Strain) -> Score:
    width = path.fault.width
    grids = [path.tried(level.product[0, at], level.product[at, at]) for level in levels[::_EVERY]]
    tried = np.unique(np.vstack(grids), axis=0)
    weights, slopes = path.weights(tried), path.slopes(tried) * width
    prior = np.sum((tried / width) ** 2, axis=1)
    rows = np.zeros((len(levels), len(tried)))
    for index, level in enumerate(levels):
        product, half_det = level.product, np.log(np.diag(level.lower)).sum()
        pull, square = product[0, at], product[at, at]
        change = 2.0 * weights @ pull - np.sum((weights @ square) * weights, axis=1) - prior
        inner = np.swapaxes(slopes, 1, 2) @ square @ slopes + np.eye(len(width))
        log_det = np.linalg.slogdet(inner)[1]
        rows[index] = 0.5 * (change - product[0, 0] - errors.log_norm[index] - log_det) - half_det
    totals = logsumexp(rows + errors.log_weights[:, None], axis=0)
    best = int(np.argmax(totals))
    leading = int(np.argmax(rows[:, best] + errors.log_weights))
    p = strain.p(levels[leading].mean(at, weights[best]))
    return Score(path, float(totals[best]), tried[best], float(errors.scales[leading]), p)
