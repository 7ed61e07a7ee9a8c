"""Anderson mixing on the arrays of a compiled search, see `model.statics.acceleration`."""

from __future__ import annotations

import numpy as np

from model.compilation import inner
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
    gram, right = np.zeros((k, k)), np.zeros(k)
    for i in range(k):
        for j in range(i, k):
            total = 0.0
            for q in range(images.shape[1]):
                newest = residuals[k, q]
                total += (newest - residuals[i, q]) * (newest - residuals[j, q])
            gram[i, j] = gram[j, i] = total
        for q in range(images.shape[1]):
            right[i] += (residuals[k, q] - residuals[i, q]) * residuals[k, q]
    trace = 0.0
    for i in range(k):
        gram[i, i] *= 1.0 + 1e-10
        trace += gram[i, i]
    if not trace > 0.0:
        return last
    mix = _least_squares(gram, right)
    for i in range(k):
        for q in range(images.shape[1]):
            last[q] -= mix[i] * (images[k, q] - images[i, q])
    return last


@inner
def _least_squares(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Least-squares solution of a symmetric system that may be singular, by Jacobi's rotations.

    `matrix` (k, k), `right` (k,).
    """
    k = len(right)
    vectors = np.zeros((k, k))
    for i in range(k):
        vectors[i, i] = 1.0
    for _ in range(30):
        off, scale = 0.0, 0.0
        for i in range(k):
            scale = max(scale, abs(matrix[i, i]))
            for j in range(i):
                off = max(off, abs(matrix[i, j]))
        if off <= 1e-17 * scale:
            break
        for p in range(k):
            for q in range(p + 1, k):
                if matrix[p, q] != 0.0:
                    _rotate(matrix, vectors, p, q)
    largest = 0.0
    for i in range(k):
        largest = max(largest, abs(matrix[i, i]))
    answer = np.zeros(k)
    for i in range(k):
        if abs(matrix[i, i]) > 1e-12 * largest:
            share = 0.0
            for j in range(k):
                share += vectors[j, i] * right[j]
            share /= matrix[i, i]
            for j in range(k):
                answer[j] += vectors[j, i] * share
    return answer


@inner
def _rotate(matrix: FloatArray, vectors: FloatArray, p: int, q: int) -> None:
    """Turn rows and columns p and q so that their product vanishes (Golub, Van Loan, Matrix Computations, 8.5)."""
    ratio = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
    t = 1.0 / (abs(ratio) + np.sqrt(1.0 + ratio * ratio))
    if ratio < 0.0:
        t = -t
    c = 1.0 / np.sqrt(1.0 + t * t)
    s = t * c
    for i in range(len(matrix)):
        one, other = matrix[i, p], matrix[i, q]
        matrix[i, p], matrix[i, q] = c * one - s * other, s * one + c * other
        one, other = vectors[i, p], vectors[i, q]
        vectors[i, p], vectors[i, q] = c * one - s * other, s * one + c * other
    for i in range(len(matrix)):
        one, other = matrix[p, i], matrix[q, i]
        matrix[p, i], matrix[q, i] = c * one - s * other, s * one + c * other
    matrix[p, q] = matrix[q, p] = 0.0
