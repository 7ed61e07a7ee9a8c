"""Samples of a channel that are none: glitches and gaps, and the robust residual that tells them from the lines.

Channel by channel: what is bad in a probe stays good in the cells. An isolated bad sample takes nothing with it; where
several stand close together, it is a disturbance, and its flanks lie below the limit.
"""

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
#: Change of a residual over the usual one at which least absolute deviations have settled.
_SETTLED = 0.02
_LAD_ROUNDS = 15


def robust_deviation(residual: FloatArray) -> float:
    """Standard deviation of a normal residual by its median size."""
    return 1.4826 * float(np.median(np.abs(residual)))


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the noise of single values (n,): steps, levels and ramps drop out of second differences."""
    return robust_deviation(np.diff(values, 2)) / float(np.sqrt(6.0))


def window_median(values: FloatArray, absent: float = np.nan) -> FloatArray:
    """Median over the windows (n, m) that have a value, `absent` where none has, (m,)."""
    present = np.isfinite(values)
    ranked = np.sort(np.pad(np.where(present, values, np.inf), ((0, 1), (0, 0)), constant_values=np.inf), axis=0)
    count, column = present.sum(axis=0), np.arange(values.shape[1])
    middle = 0.5 * (ranked[(count - 1) // 2, column] + ranked[count // 2, column])
    return np.where(count > 0, middle, absent)


def usual_scale(scale: FloatArray) -> FloatArray:
    """Median over the windows with a scale (n_windows, q); infinite where none has."""
    return window_median(scale, np.inf)


def is_present(values: FloatArray) -> BoolArray:
    """Whether a reading is a value: finite, and no overflow mark; (n,)."""
    with np.errstate(invalid="ignore"):  # a NaN compared is what "no value" looks like
        return np.abs(values) < OVERFLOW


def with_flanks(outlying: BoolArray) -> BoolArray:
    """Bad samples: isolated ones by themselves, disturbances with their flanks; `outlying` (n,)."""
    bad = np.array(outlying)
    at = np.flatnonzero(outlying)
    for group in np.split(at, np.flatnonzero(np.diff(at) > 2) + 1):
        if len(group) >= _MANY:
            bad[max(group[0] - _MARGIN, 0) : group[-1] + _MARGIN + 1] = True
    return bad


def absolute_residual(design: FloatArray, values: FloatArray) -> FloatArray:
    """What least absolute deviations leave of some values (n,): a quarter of them may be wrong.

    By reweighted normal equations: good enough for a first verdict on samples. `design` (n, n_columns).
    """
    weights, size = np.ones(len(values)), np.full(len(values), np.inf)
    for _ in range(_LAD_ROUNDS):
        weighted = design * weights[:, None]
        solution = np.linalg.pinv(weighted.T @ design, rcond=1e-12, hermitian=True) @ (weighted.T @ values)
        previous, size = size, np.abs(values - design @ solution)
        middle = max(float(np.median(size)), _ROUNDING * float(size.max(initial=0.0)), np.finfo(float).tiny)
        if np.abs(size - previous).max() <= _SETTLED * middle:
            break  # nothing moves any more that could make a verdict
        weights = 1 / np.maximum(size / middle, 0.1)
    return size
