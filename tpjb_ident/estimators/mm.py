"""Joint complex MM regression: one weight per window over all its components.

An M-estimator on stacked real rows (what RLM does) breaks down with a few bad regressors, and here
the regressors are the probes. This one starts from a high-breakdown fit (`least_trimmed`) with its
scale, then takes a 95 % efficient biweight M-step at that fixed scale (the MM principle of Yohai 1987).
All of it with the full residual covariance, so that phase, axes and units
do not matter. A biweight S-start was tried and given up: with 45 % of the windows hit by one and the
same disturbance its reweighting leaves the good solution that the trimmed start has found.
"""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.statistics import bisquare_weight, efficiency_constant
from tpjb_ident.estimators.least_trimmed import Regression, distance2, evenly_chosen, robust_start

#: A direction with less than this share of its windows accepted differs as a whole.
_ACCEPTED = 0.2
#: Fewer windows than this leave nothing to be robust with: least squares, and said so.
_MIN_WINDOWS = 8
#: The start looks at no more windows than this: as many tell what the majority is, and its memory grows with them.
MANY_WINDOWS = 640
_MAX_ITERATIONS = 200


@dataclass(frozen=True)
class RobustFit:
    """Y = X B' with robust weights."""

    coefficients: ComplexArray  #: (q, p) complex: B: y = B x per window
    scatter: ComplexArray  #: (q, q) complex
    weights: FloatArray  #: (n,), 0, 1: in
    iterations: int
    conditions: tuple[Condition, ...]


def mm_fit(X: ComplexArray, Y: ComplexArray, direction: IntArray, seed: int = 1, tolerance: float = 1e-12) -> RobustFit:
    """Robust multivariate complex regression of Y on X; `X` (n, 2), `Y` (n, q), `direction` (n,)."""
    n, q = len(Y), Y.shape[1]
    regression = Regression(X, Y)
    if n < max(_MIN_WINDOWS, 2 * (q + 1) + 2):
        text = f"{n} windows are too few for a robust fit; least squares was used"
        return _plain_fit(regression, np.ones(n), Condition("no-robust-start", text))
    subset = evenly_chosen(direction, MANY_WINDOWS)
    first = regression if len(subset) == n else Regression(X[subset], Y[subset])
    start = robust_start(first, direction[subset], seed)
    if start.exact:
        size = np.linalg.norm(regression.residual(start.coefficients), axis=0)
        good = size <= 1e-9 * np.median(np.linalg.norm(Y, axis=1))
        text = f"{int(good.sum())} of {n} windows fit exactly; the others got no weight"
        return _plain_fit(regression, good.astype(float), Condition("zero-scale", text))
    B, scatter = start.coefficients, start.scatter
    constant = efficiency_constant(2 * q)
    weights = bisquare_weight(np.sqrt(distance2(regression.residual(B), scatter)), constant)
    for steps in range(1, _MAX_ITERATIONS):
        before, B = B, regression.fit(weights)
        weights = bisquare_weight(np.sqrt(distance2(regression.residual(B), scatter)), constant)
        if np.abs(B - before).max() <= tolerance * np.abs(before).max():
            return RobustFit(B, scatter, weights, steps, ())
    unsettled = Condition("iteration-limit", f"MM regression not settled after {_MAX_ITERATIONS} steps")
    return RobustFit(B, scatter, weights, _MAX_ITERATIONS, (unsettled,))


def within_directions(weights: FloatArray, direction: IntArray) -> FloatArray:
    """Weights (n,) by which windows are judged within their direction (n,).

    A direction as a whole is no outlier of the windows: the scatter of the directions, or the weight of its block in
    the solve, takes it.
    """
    size = np.bincount(direction)
    share = np.bincount(direction, weights=weights > _ACCEPTED) / np.maximum(size, 1)
    return np.where((share < _ACCEPTED)[direction], 1.0, weights)


def _plain_fit(regression: Regression, weights: FloatArray, condition: Condition) -> RobustFit:
    """Least squares of some windows, the others without weight."""
    B = regression.fit(weights)
    residual = weights * regression.residual(B)
    spread = residual @ residual.conj().T / max(float(weights.sum()) - 2.0, 1.0)
    return RobustFit(B, spread, weights, 0, (condition,))
