"""The robust fit of lines to a stretch of samples: least squares of all lines together, glitches left out.

One fit for `tpjb identify` (window by window, `phasors`) and `tpjb check` (a whole run, `tpjb_ident.check.lines`): what
one of them calls a glitch the other does too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray

#: A sample is a glitch beyond this many robust standard deviations of the fit's residual.
GLITCH_LIMIT = 5.5
#: A window this many times noisier than its run's median is looked at again.
SCALE_LIMIT = 1.5
#: Samples left out on either side of a glitch.
GLITCH_MARGIN = 3
#: A window that has lost more than this share of its samples gives no phasor.
_MAX_LOST = 0.5
#: Change of a residual over the usual one at which least absolute deviations have settled.
_SETTLED = 0.02
_LAD_ROUNDS = 15
_ROUNDS = 12


@dataclass(frozen=True)
class RobustLines:
    """A fit, and which samples it rests on."""

    coefficients: FloatArray  #: (q, n_columns): of every channel; NaN where too few samples are left
    scale: FloatArray  #: (q,): robust standard deviation of the residuals
    kept: BoolArray  #: (n,): samples neither missing nor glitched, of all channels together
    lost: float


def beside(outlying: BoolArray) -> IntArray:
    """Samples that are outlying, or next to such a one: a glitch's flanks lie below the limit, (m,).

    `outlying` (q, n).
    """
    return np.flatnonzero(np.convolve(outlying.any(axis=0), np.ones(2 * GLITCH_MARGIN + 1), mode="same") > 0)


def fit_without_glitches(design: FloatArray, values: FloatArray, usual: FloatArray) -> RobustLines:
    """Find the glitches, then plain least squares without them.

    Least absolute deviations (by reweighting) stand a quarter of the samples being wrong; bisquare
    steps with no more than the run's usual scale sharpen that into a clear verdict per sample.

    `design` (n, n_columns), `values` (n, q), `usual` (q,).
    """
    present = np.asarray(np.isfinite(values).all(axis=1))
    q = values.shape[1]
    nothing = np.full((q, design.shape[1]), np.nan), np.full(q, np.nan), np.zeros(len(values), dtype=bool)
    if present.mean() < 1 - _MAX_LOST or present.sum() <= 2 * design.shape[1]:
        return RobustLines(*nothing, float(1 - present.mean()))
    full, y = design[present], values[present]
    u, scale = _verdicts(full, y, usual)
    if u is None:
        return RobustLines(*nothing, 1.0)
    bad = np.zeros((1, len(values)), dtype=bool)
    bad[0, present] = u > 1
    used = np.array(present)
    used[beside(bad)] = False
    lost = float(1 - used.mean())
    if lost > _MAX_LOST:
        return RobustLines(*nothing, lost)
    return RobustLines(_least_squares(design[used], values[used]).T, scale, used, lost)


def _verdicts(full: FloatArray, y: FloatArray, usual: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Residual of every sample over the limit of a glitch (None where most are), and the residuals' scale (q,)."""
    weights, size = np.ones(len(y)), np.full_like(y, np.inf)
    for _ in range(_LAD_ROUNDS):
        previous, size = size, np.abs(y - full @ _quick_solution(full, y, weights))
        if (np.abs(size - previous).max(axis=0) <= _SETTLED * np.median(size, axis=0)).all():
            break  # nothing moves any more that could make a verdict
        relative = (size / np.maximum(np.median(size, axis=0), np.finfo(float).tiny)).max(axis=1)
        weights = 1 / np.maximum(relative, 0.1)
    scale = np.zeros(y.shape[1])
    for _ in range(_ROUNDS):
        size = np.abs(y - full @ _quick_solution(full, y, weights))
        scale = np.minimum(1.4826 * np.median(size, axis=0), SCALE_LIMIT * usual)
        u = (size / np.maximum(scale, np.finfo(float).tiny)).max(axis=1) / GLITCH_LIMIT
        previous, weights = weights, np.maximum(1 - u**2, 0.0) ** 2
        if weights.mean() < 1 - _MAX_LOST or np.abs(weights - previous).max() < 1e-3:
            break
    return (None if weights.mean() < 1 - _MAX_LOST else u), scale


def _quick_solution(design: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted least squares by normal equations: good enough for the verdict on samples, and several times quicker."""
    weighted = design * weights[:, None]
    return np.asarray(np.linalg.pinv(weighted.T @ design, rcond=1e-12, hermitian=True) @ (weighted.T @ values))


def _least_squares(design: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(design, values, rcond=None)[0], dtype=float)
