"""Anderson mixing on the arrays of a compiled search."""

from __future__ import annotations

import numpy as np

from model.compilation import inner
from model.statics.compiled.elimination import solve
from rigdata.arrays import FloatArray

#: Differences that are kept.
DEPTH = 4


@inner
def mixed(images: FloatArray, residuals: FloatArray, count: int) -> FloatArray:
    """Next state of a fixed-point iteration: gives (n,)."""
    last = images[count - 1].copy()
    k = count - 1
    if k == 0:
        return last
    gram, right = np.zeros((k, k)), np.zeros((k, 1))
    for i in range(k):
        for j in range(i, k):
            total = 0.0
            for q in range(images.shape[1]):
                newest = residuals[k, q]
                total += (newest - residuals[i, q]) * (newest - residuals[j, q])
            gram[i, j] = gram[j, i] = total
        for q in range(images.shape[1]):
            right[i, 0] += (residuals[k, q] - residuals[i, q]) * residuals[k, q]
    trace = 0.0
    for i in range(k):
        gram[i, i] *= 1.0 + 1e-10
        trace += gram[i, i]
    if not trace > 0.0:
        return last
    solve(gram, right)
    for i in range(k):
        for q in range(images.shape[1]):
            last[q] -= right[i, 0] * (images[k, q] - images[i, q])
    return last
