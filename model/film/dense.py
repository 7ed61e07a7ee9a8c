"""Small dense systems: Gauss' elimination, the combination of vectors nearest to another, GMRES, Anderson's mixing."""

import math
from typing import Any

import numpy as np

from model.compilation import inner
from rigdata.arrays import FloatArray

#: Differences that Anderson's mixing keeps, and steps of GMRES at most.
DEPTH, _STEPS = 4, 12
#: Kelvins beyond which a film is no film: squares would overflow.
BOUNDLESS = 1e30


@inner
def solve(matrix: FloatArray, constants: FloatArray) -> None:
    """Gauss' elimination with the largest pivot of each column; the solutions replace the right-hand sides (.., q)."""
    n, count = len(matrix), constants.shape[1]
    system = np.empty((n, n + count))
    system[:, :n], system[:, n:] = matrix, constants[:n]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(system[i, k]) > abs(system[best, k]):
                best = i
        for j in range(k, n + count):
            system[k, j], system[best, j] = system[best, j], system[k, j]
        for i in range(k + 1, n):
            factor = system[i, k] / system[k, k]
            for j in range(k, n + count):
                system[i, j] -= factor * system[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(count):
            total = system[k, n + j]
            for i in range(k + 1, n):
                total -= system[k, i] * constants[i, j]
            constants[k, j] = total / system[k, k]


@inner
def nearest(images: FloatArray, count: int, target: FloatArray, damping: float, weights: FloatArray) -> bool:
    """Weights (.., 1) of the first images (.., n) whose sum is nearest to a vector (n,); False if all are zero.

    Images that hardly differ are of no use to each other: `damping` is the share by which they are taken to.
    """
    gram, trace = np.empty((count, count)), 0.0
    for i in range(count):
        weights[i, 0] = product(images[i], target)
        for j in range(count):
            gram[i, j] = product(images[i], images[j])
        gram[i, i] *= 1.0 + damping
        trace += gram[i, i]
    if not trace > 0.0:
        return False
    solve(gram, weights)
    return True


@inner
def gmres(step_of: Any, held: Any, target: FloatArray, tolerance: float) -> FloatArray:
    """Steps (n,) whose images add up to a vector, to a share of it; NaN where an image is `BOUNDLESS`.

    ``step_of(held, residual)`` gives a step towards what is left, and its image; linear. What the last step leaves
    contracts with the rest. Y. Saad, SIAM J. Sci. Comput. 14 (1993) 461.
    """
    answer, residual, count = np.zeros(len(target)), target.copy(), 0
    steps, images, weights = np.empty((_STEPS, len(target))), np.empty((_STEPS, len(target))), np.zeros((_STEPS, 1))
    size = math.sqrt(product(target, target))
    length = size
    while count < _STEPS and length > tolerance * size:
        steps[count], images[count] = step_of(held, residual / length)
        if not product(images[count], images[count]) < BOUNDLESS:
            return np.full(len(target), math.nan)
        count += 1
        nearest(images, count, target, 1e-13, weights)
        residual[:] = target
        for k in range(count):
            residual -= weights[k, 0] * images[k]
        length = math.sqrt(product(residual, residual))
    for k in range(count):
        answer += weights[k, 0] * steps[k]
    return answer


@inner
def product(first: FloatArray, second: FloatArray) -> float:
    """Sum of products."""
    total = 0.0
    for q in range(len(first)):
        total += first[q] * second[q]
    return total


@inner
def times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Product with a vector; numpy's own would load scipy, 27 MB."""
    out = np.empty(len(matrix))
    for i in range(len(out)):
        out[i] = product(matrix[i], vector)
    return out


@inner
def mixed(images: FloatArray, residuals: FloatArray, count: int) -> FloatArray:
    """Next state of a fixed-point iteration: gives (n,)."""
    k = count - 1
    last, weights = images[k].copy(), np.empty((DEPTH, 1))
    if k > 0 and nearest(residuals[k] - residuals[:k], k, residuals[k], 1e-10, weights):
        for i in range(k):
            last -= weights[i, 0] * (images[k] - images[i])
    return last
