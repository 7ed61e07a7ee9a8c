"""Readings along two or more directions, turned into X and Y."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel

#: Two directions whose sine is not above this (3 deg) count as one.
COLLINEAR_SINE = 0.05
#: The same limit as the smallest singular value of two directions, sqrt(1 - cos).
_LEAST_SINGULAR = math.sqrt(1.0 - math.sqrt(1.0 - COLLINEAR_SINE**2))


def directions(axes: Sequence[float] | FloatArray) -> FloatArray:
    """Unit vectors along `axes`: what turns X and Y into components."""
    return np.stack([np.cos(axes), np.sin(axes)], axis=-1)


@functools.lru_cache(maxsize=256)
def inverse_directions(axes: tuple[float, ...]) -> FloatArray:
    """(2, m) matrix from components along `axes` [rad] to X and Y; NaN where they span no plane."""
    along = directions(axes)
    if len(axes) < 2 or np.linalg.svd(along, compute_uv=False)[-1] <= _LEAST_SINGULAR:
        return np.full((2, len(axes)), np.nan)
    inverse = np.linalg.pinv(along)
    inverse.setflags(write=False)
    return np.asarray(inverse)


def solve_vector(axes: FloatArray, values: FloatArray) -> FloatArray:
    """Solve ``[cos a_i, sin a_i] . (X, Y) = value_i`` sample by sample."""
    present = np.isfinite(values)
    if present.all():
        return values @ inverse_directions(tuple(axes)).T
    result = np.full((len(values), 2), np.nan)
    patterns, which = np.unique(present, axis=0, return_inverse=True)
    for index, pattern in enumerate(patterns):
        rows = which.ravel() == index
        result[rows] = values[np.ix_(rows, pattern)] @ inverse_directions(tuple(axes[pattern])).T
    return result


def zero_uncertainty(channels: Iterable[Channel], quantity: str) -> FloatArray:
    """Standard uncertainty of a quantity's zero along X and Y (2,).

    From what the manifest states of its channels [SI].
    """
    chosen = [c for c in channels if c.quantity == quantity and c.axis is not None]
    if len(chosen) < 2:
        return np.zeros(2)
    back = inverse_directions(tuple(float(c.axis or 0.0) for c in chosen))
    return np.asarray(np.sqrt(back**2 @ np.array([c.zero_uncertainty for c in chosen]) ** 2))
