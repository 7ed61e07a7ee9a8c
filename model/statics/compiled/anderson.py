"""Anderson mixing on the arrays of a compiled search."""

from __future__ import annotations

import numpy as np

from model.compilation import inner
from model.film.dense import nearest
from rigdata.arrays import FloatArray

#: Differences that are kept.
DEPTH = 4


@inner
def mixed(images: FloatArray, residuals: FloatArray, count: int) -> FloatArray:
    """Next state of a fixed-point iteration: gives (n,)."""
    k = count - 1
    last, weights = images[k].copy(), np.empty((DEPTH, 1))
    if k > 0 and nearest(residuals[k] - residuals[:k], k, residuals[k], 1e-10, weights):
        for i in range(k):
            last -= weights[i, 0] * (images[k] - images[i])
    return last
