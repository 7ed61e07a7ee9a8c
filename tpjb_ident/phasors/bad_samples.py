"""Samples of a channel that are none: glitches and gaps, and the robust fit that tells them from the lines.

Channel by channel: what is bad in a probe stays good in the cells. An isolated bad sample takes nothing with it; where
several stand close together, it is a disturbance, and its flanks lie below the limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import OVERFLOW

#: A residual is no smaller than this share of the largest: what stands still has none, and is not divided by.
_ROUNDING = 1e-100
#: A sample is bad beyond this many robust standard deviations of the fit's residual.
BAD_LIMIT = 5.5
#: A window this many times noisier than its run's median is looked at again.
SCALE_LIMIT = 1.5
#: So many bad samples with at most one good one between neighbours are a disturbance,
_MANY = 3
#: and take so many more on either side with them.
_MARGIN = 3
#: A window that has lost more than this share of its samples gives no phasor.
_MAX_LOST = 0.5
#: Change of a residual over the usual one at which least absolute deviations have settled.
_SETTLED = 0.02
_LAD_ROUNDS = 15
_ROUNDS = 12


@dataclass(frozen=True)
class RobustFit:
    """Fit of one channel, and the samples that it rests on."""

    coefficients: FloatArray  #: (n_columns,): NaN where too few samples are left
    scale: float  #: robust standard deviation of the residual
    used: BoolArray  #: (n,): samples neither missing nor bad

    @property
    def lost(self) -> float:
        """Share of the samples left out."""
        return float(1 - self.used.mean())


def robust_deviation(residual: FloatArray) -> float:
    """Standard deviation of a normal residual by its median size."""
    return 1.4826 * float(np.median(np.abs(residual)))


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the noise of single values (n,): steps, levels and ramps drop out of second differences."""
    return robust_deviation(np.diff(values, 2)) / float(np.sqrt(6.0))


def usual_scale(scale: FloatArray) -> FloatArray:
    """Median over the windows with a scale (n_windows, q); infinite where none has."""
    usual = np.full(scale.shape[1], np.inf)
    for k, column in enumerate(scale.T):
        finite_values = column[np.isfinite(column)]
        if len(finite_values):
            usual[k] = np.median(finite_values)
    return usual


def is_present(values: FloatArray) -> BoolArray:
    """Whether a reading is a value: finite, and no overflow mark; (n,)."""
    with np.errstate(invalid="ignore"):  # a NaN compared is what "no value" looks like
        return np.asarray(np.abs(values) < OVERFLOW)


def with_flanks(outlying: BoolArray) -> BoolArray:
    """Bad samples: isolated ones by themselves, disturbances with their flanks; `outlying` (n,)."""
    bad = np.array(outlying)
    at = np.flatnonzero(outlying)
    if len(at) < _MANY:
        return bad
    groups = np.split(at, np.flatnonzero(np.diff(at) > 2) + 1)
    for group in groups:
        if len(group) >= _MANY:
            bad[max(group[0] - _MARGIN, 0) : group[-1] + _MARGIN + 1] = True
    return bad


def robust_fit(design: FloatArray, values: FloatArray, usual: float) -> RobustFit:
    """Find the bad samples, then plain least squares without them.

    Least absolute deviations (by reweighting) stand a quarter of the samples being wrong; bisquare steps with no more
    than the run's `usual` scale sharpen that into a clear verdict per sample.

    `design` (n, n_columns), `values` (n,).
    """
    present = is_present(values)
    missing = RobustFit(np.full(design.shape[1], np.nan), np.nan, np.zeros(len(values), dtype=bool))
    if present.mean() < 1 - _MAX_LOST or present.sum() <= 2 * design.shape[1]:
        return RobustFit(missing.coefficients, np.nan, present)
    full, y = design[present], values[present]
    excess, scale = _verdicts(full, y, usual)
    if excess is None:
        return missing
    outlying = np.zeros(len(values), dtype=bool)
    outlying[present] = excess > 1
    used = present & ~with_flanks(outlying)
    if used.mean() < 1 - _MAX_LOST:
        return RobustFit(missing.coefficients, np.nan, used)
    return RobustFit(np.asarray(np.linalg.lstsq(design[used], values[used], rcond=None)[0], dtype=float), scale, used)


def _verdicts(full: FloatArray, y: FloatArray, usual: float) -> tuple[FloatArray | None, float]:
    """Residual of every sample over the limit of a bad one (None where most are), and the residuals' scale."""
    weights, size = np.ones(len(y)), np.full(len(y), np.inf)
    for _ in range(_LAD_ROUNDS):
        previous, size = size, np.abs(y - full @ _quick_solution(full, y, weights))
        middle = max(float(np.median(size)), _ROUNDING * float(size.max(initial=0.0)), np.finfo(float).tiny)
        if np.abs(size - previous).max() <= _SETTLED * middle:
            break  # nothing moves any more that could make a verdict
        weights = 1 / np.maximum(size / middle, 0.1)
    scale = 0.0
    for _ in range(_ROUNDS):
        size = np.abs(y - full @ _quick_solution(full, y, weights))
        scale = min(robust_deviation(size), SCALE_LIMIT * usual)
        excess = size / max(scale * BAD_LIMIT, _ROUNDING * float(size.max(initial=0.0)), np.finfo(float).tiny)
        previous, weights = weights, np.maximum(1 - excess**2, 0.0) ** 2
        if weights.mean() < 1 - _MAX_LOST or np.abs(weights - previous).max() < 1e-3:
            break
    return (None if weights.mean() < 1 - _MAX_LOST else excess), scale


def _quick_solution(design: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted least squares by normal equations: good enough for the verdict on samples, and several times quicker."""
    weighted = design * weights[:, None]
    return np.asarray(np.linalg.pinv(weighted.T @ design, rcond=1e-12, hermitian=True) @ (weighted.T @ values))
