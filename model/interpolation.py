"""Tables: the row a value belongs to, the largest; polynomials and rising cubics.

numpy's and scipy's would load scipy: 0.3 s and 20 MB of a process that predicts.
"""

from typing import Any

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
def largest(values: Any) -> float:
    """Largest size of some values, (n,), real or complex; NaN if one is."""
    size = 0.0
    for value in values:
        if not abs(value) <= size and size == size:
            size = abs(value)
    return size


@inner
def lagrange(places: FloatArray, place: float) -> FloatArray:
    """Of values at places, (n,), in the polynomial through them, elsewhere."""
    weights = np.ones(len(places))
    for k in range(len(places)):
        for j in range(len(places)):
            if j != k:
                weights[k] *= (place - places[j]) / (places[k] - places[j])
    return weights


def rising_cubics(x: FloatArray, y: FloatArray) -> FloatArray:
    """Cubics through points (n,) that rise, which rise too, with a continuous tangent (PCHIP); gives (4, n - 1)."""
    h = np.diff(x)
    rise = np.diff(y) / h
    slope = np.full(len(x), rise[0])
    if len(x) > 2:
        early, late = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
        slope[1:-1] = (early + late) / (early / rise[:-1] + late / rise[1:])
        for end, near, far in ((0, 0, 1), (-1, -1, -2)):
            leaving = (2.0 * h[near] + h[far]) * rise[near] - h[near] * rise[far]
            slope[end] = max(leaving / (h[near] + h[far]), 0.0)
    bend = (slope[:-1] + slope[1:] - 2.0 * rise) / h
    return np.stack([bend / h, (rise - slope[:-1]) / h - bend, slope[:-1], y[:-1]])
