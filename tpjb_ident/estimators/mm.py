"""Joint complex MM regression: one weight per window over all its components.

An M-estimator on stacked real rows (what RLM does) breaks down with a few bad regressors, and here
the regressors are the probes. This one starts from a high-breakdown fit (`least_trimmed`) with its
scale, then takes a 95 % efficient biweight M-step at that fixed scale (the MM principle of Yohai 1987).
All of it with the full residual covariance, so that phase, axes and units
do not matter. A biweight S-start was tried and given up: with 45 % of the windows hit by one and the
same disturbance its reweighting leaves the good solution that the trimmed start has found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.robust_constants import bisquare_weight, efficiency_constant
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
    if n < max(_MIN_WINDOWS, 2 * (q + 1) + 2):
        return _least_squares_only(X, Y)
    regression = Regression(X, Y)
    subset = evenly_chosen(direction, MANY_WINDOWS)
    first = regression if len(subset) == n else Regression(X[subset], Y[subset])
    start = robust_start(first, direction[subset], seed)
    if start.exact:
        return _exact_fit(regression, start.coefficients)
    B, scatter = start.coefficients, start.scatter
    constant = efficiency_constant(2 * q)
    steps, change = 0, np.inf
    weights = bisquare_weight(np.sqrt(distance2(regression.terms(B), scatter)), constant)
    while change > tolerance and steps < _MAX_ITERATIONS:
        steps += 1
        B_new = regression.fit(weights)
        weights = bisquare_weight(np.sqrt(distance2(regression.terms(B_new), scatter)), constant)
        change = float(np.abs(B_new - B).max() / np.abs(B).max())
        B = B_new
    conditions: tuple[Condition, ...] = ()
    if steps == _MAX_ITERATIONS:
        conditions = (Condition("iteration-limit", f"MM regression not settled after {steps} steps"),)
    return RobustFit(B, scatter, weights, steps, conditions)


def within_directions(weights: FloatArray, direction: IntArray) -> FloatArray:
    """Weights (n,) by which windows are judged within their direction (n,).

    A direction as a whole is no outlier of the windows: the scatter of the directions, or the weight of its block in
    the solve, takes it.
    """
    size = np.bincount(direction)
    share = np.bincount(direction, weights=weights > _ACCEPTED) / np.maximum(size, 1)
    return np.where((share < _ACCEPTED)[direction], 1.0, weights)


def _exact_fit(regression: Regression, B: ComplexArray) -> RobustFit:
    """More than half of the windows fit without residual: they count, the others do not."""
    size = np.linalg.norm(regression.residual(B), axis=1)
    good = size <= 1e-9 * np.median(np.linalg.norm(regression.Y, axis=1))
    weights = good.astype(float)
    B = regression.fit(weights)
    condition = Condition(
        "zero-scale", f"{int(good.sum())} of {len(good)} windows fit exactly; the others got no weight"
    )
    return RobustFit(B, np.zeros((regression.q, regression.q), dtype=complex), weights, 0, (condition,))


def _least_squares_only(X: ComplexArray, Y: ComplexArray) -> RobustFit:
    n = len(Y)
    weights = np.ones(n)
    regression = Regression(X, Y)
    B = regression.fit(weights)
    residual = regression.residual(B)
    scatter = residual.T @ residual.conj() / max(n - X.shape[1], 1)
    condition = Condition("no-robust-start", f"{n} windows are too few for a robust fit; least squares was used")
    return RobustFit(B, scatter, weights, 0, (condition,))
