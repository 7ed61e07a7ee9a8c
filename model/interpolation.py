"""Monotone cubics and bracketed roots: scipy's would cost 0.5 s of the 3 s that the first prediction takes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigdata.arrays import FloatArray

#: Steps of `bracketed_root`; each halves the bracket at least every third time.
_MOST_STEPS = 200


def monotone_cubics(x: FloatArray, y: FloatArray) -> FloatArray:
    """Cubics through points that rise or fall where the points do, with a continuous tangent.

    `x` (n,), `y` (n, m); gives (4, n - 1, m).
    """
    h = np.diff(x).reshape(-1, *([1] * (y.ndim - 1)))
    rise = np.diff(y, axis=0) / h
    slope = np.empty_like(y, dtype=float)
    if len(x) == 2:
        slope[:] = rise[0]
    else:
        w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
        turns = (np.sign(rise[1:]) != np.sign(rise[:-1])) | (rise[1:] == 0.0) | (rise[:-1] == 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):  # where the curve turns, its slope is zero
            mean = (w1 / rise[:-1] + w2 / rise[1:]) / (w1 + w2)
            slope[1:-1] = np.where(turns, 0.0, 1.0 / mean)
        slope[0] = _end(h[0], h[1], rise[0], rise[1])
        slope[-1] = _end(h[-1], h[-2], rise[-1], rise[-2])
    bend = (slope[:-1] + slope[1:] - 2.0 * rise) / h
    return np.stack([bend / h, (rise - slope[:-1]) / h - bend, slope[:-1], y[:-1]])


def _end(h0: FloatArray, h1: FloatArray, rise0: FloatArray, rise1: FloatArray) -> FloatArray:
    slope = ((2.0 * h0 + h1) * rise0 - h0 * rise1) / (h0 + h1)
    reversed_ = np.sign(slope) != np.sign(rise0)
    steep = (np.sign(rise0) != np.sign(rise1)) & (np.abs(slope) > 3.0 * np.abs(rise0))
    return np.asarray(np.where(reversed_, 0.0, np.where(steep, 3.0 * rise0, slope)))


def evaluated(x: FloatArray, coefficients: FloatArray, at: FloatArray) -> FloatArray:
    """Values of `monotone_cubics`: `x` (n,), `coefficients` (4, n - 1, m), `at` (k,); gives (k, m)."""
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    s = (at - x[i]).reshape(-1, *([1] * (coefficients.ndim - 2)))
    c = coefficients[:, i]
    return np.asarray(((c[0] * s + c[1]) * s + c[2]) * s + c[3])


def bracketed_root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Root of a function that changes its sign between two places."""
    at_low, at_high = function(low), function(high)
    if at_low == 0.0 or at_high == 0.0:
        return low if at_low == 0.0 else high
    if at_low * at_high > 0.0:
        raise ValueError(f"no change of sign between {low:g} and {high:g}")
    last = low
    for _ in range(_MOST_STEPS):
        middle = 0.5 * (low + high)
        value = function(middle)
        scale = max(abs(value), abs(at_low), abs(at_high))
        place, at_place = middle, value
        if np.isfinite(scale) and value != 0.0:
            f, g, m = at_low / scale, at_high / scale, value / scale
            place = middle + (middle - low) * (1.0 if f > g else -1.0) * m / (m * m - f * g) ** 0.5
            at_place = function(place)
        if at_place == 0.0 or abs(place - last) < tolerance or abs(high - low) < tolerance:
            return float(place)
        last = place
        for x, y in sorted(((middle, value), (place, at_place))):
            if low < x < high:
                if y * at_low > 0.0:
                    low, at_low = x, y
                else:
                    high, at_high = x, y
                    break
    return float(place)
