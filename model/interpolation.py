"""Tables: the row a value belongs to, the least and the largest; monotone cubics.

numpy's and scipy's would load scipy: 0.3 s and 20 MB of a process that predicts.
"""

from __future__ import annotations

import numpy as np

from model.compilation import inner
from rigdata.arrays import FloatArray


@inner
def row_below(x: FloatArray, count: int, at: float) -> int:
    """Row of the first `count` that a value lies above, the first or the last but one at least."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x[middle] <= at:
            low = middle
        else:
            high = middle
    return low


@inner
def largest(values: FloatArray) -> float:
    """Largest size of some values, (n,); NaN if one is."""
    found = 0.0
    for value in values:
        if not abs(value) <= found and found == found:
            found = abs(value)
    return found


@inner
def least(values: FloatArray) -> float:
    """Least of some values, (n,)."""
    found = values[0]
    for value in values:
        found = min(found, value)
    return found


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
