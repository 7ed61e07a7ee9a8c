"""Readings along two or more directions, turned into X and Y."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
#: Below this smallest singular value two directions count as one (about 3 deg apart).
_COLLINEAR = 0.035


def solve_vector(axes: FloatArray, values: FloatArray) -> FloatArray:
    """Solve ``[cos a_i, sin a_i] . (X, Y) = value_i`` sample by sample.

    Parameters
    ----------
    axes : (m,) ndarray
        Directions [rad], not all along one line; they need not be orthogonal.
    values : (n, m) ndarray
        Components along `axes`; NaN where missing.

    Returns
    -------
    (n, 2) ndarray
        Exact for two directions, least squares over those with a value for more; NaN where the
        directions with a value do not span the plane.
    """
    directions = np.stack([np.cos(axes), np.sin(axes)], axis=1)
    present = np.isfinite(values)
    result = np.full((len(values), 2), np.nan)
    patterns, which = (
        np.unique(present, axis=0, return_inverse=True)
        if not present.all()
        else (
            np.ones((1, len(axes)), dtype=bool),
            np.zeros(len(values), dtype=np.intp),
        )
    )
    for index, pattern in enumerate(patterns):
        matrix = directions[pattern]
        if len(matrix) < 2 or np.linalg.svd(matrix, compute_uv=False)[-1] < _COLLINEAR:
            continue
        rows = which.ravel() == index
        # An inverse, not lstsq on all samples: two rows by thousands of right-hand sides.
        result[rows] = values[np.ix_(rows, pattern)] @ np.linalg.pinv(matrix).T
    return result
