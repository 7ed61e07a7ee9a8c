"""Joint complex MM regression: one weight per window over all its components.

An M-estimator on stacked real rows (what RLM does) breaks down with a few bad regressors, and here
the regressors are the probes. This one starts from a high-breakdown fit: concentration steps from
many two-window starts (multivariate least trimmed squares, Agullo, Croux & Van Aelst 2008), two
reweighting steps for the scale, then a 95 % efficient biweight M-step at that fixed scale (the MM
principle of Yohai 1987). All of it with the full residual covariance, so that phase, axes and units
do not matter. A biweight S-start was tried and given up: with 45 % of the windows hit by one and the
same disturbance its reweighting leaves the good solution that the trimmed start has found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.dynamic.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.conditions import Condition
from tpjb_ident.dynamic.robust_constants import (
    bisquare_weight,
    efficiency_constant,
    half_shrinkage,
    trimming_limits,
    trimming_weight,
)

#: Fewer windows than this leave nothing to be robust with: least squares, and said so.
MIN_WINDOWS = 8
_STARTS = 60
_KEPT = 4
_MAX_ITERATIONS = 200
#: Share of the windows in the smaller core that is looked for besides the half.
_SMALL_CORE = 0.38


@dataclass(frozen=True)
class RobustFit:
    """Y = X B' with robust weights.

    Attributes
    ----------
    coefficients : (q, p) complex ndarray
        B: y = B x per window.
    scatter : (q, q) complex ndarray
        Residual covariance E[r r^H] of the good windows.
    weights : (n,) ndarray
        In [0, 1].
    distance2 : (n,) ndarray
        2 r^H scatter^-1 r: chi-square with 2 q degrees of freedom for a good window.
    iterations : int
    conditions : tuple of Condition
    """

    coefficients: ComplexArray
    scatter: ComplexArray
    weights: FloatArray
    distance2: FloatArray
    iterations: int
    conditions: tuple[Condition, ...]


def mm_fit(X: ComplexArray, Y: ComplexArray, direction: IntArray, seed: int = 1) -> RobustFit:
    """Robust multivariate complex regression of Y on X.

    Parameters
    ----------
    X : (n, 2) complex ndarray
    Y : (n, q) complex ndarray
    direction : (n,) ndarray of int
        Starts are drawn from windows of different directions where possible.
    seed : int
        Of the drawing of starts.
    """
    n, q = len(Y), Y.shape[1]
    if n < max(MIN_WINDOWS, 2 * (q + 1) + 2):
        return _least_squares_only(X, Y)
    pairs = _start_pairs(direction, seed)
    B, exact = _concentrated_start(X, Y, pairs, 0.5)
    if exact:
        return _exact_fit(X, Y, B)
    B, scatter = _reweighted(X, Y, B, 0.5)
    B, scatter = _tighter_core(X, Y, direction, pairs, (B, scatter))
    constant = efficiency_constant(2 * q)
    steps, change = 0, np.inf
    while change > 1e-12 and steps < _MAX_ITERATIONS:
        steps += 1
        u = np.sqrt(_distance2(Y - X @ B.T, scatter))
        B_new = _weighted_fit(X, Y, bisquare_weight(u, constant))
        change = float(np.abs(B_new - B).max() / np.abs(B).max())
        B = B_new
    conditions: tuple[Condition, ...] = ()
    if steps == _MAX_ITERATIONS:
        conditions = (Condition("iteration-limit", f"MM regression not settled after {steps} steps"),)
    distance2 = _distance2(Y - X @ B.T, scatter)
    weights = bisquare_weight(np.sqrt(distance2), constant)
    return RobustFit(B, scatter, weights, distance2, steps, conditions)


def _exact_fit(X: ComplexArray, Y: ComplexArray, B: ComplexArray) -> RobustFit:
    """More than half of the windows fit without residual: they count, the others do not."""
    size = np.linalg.norm(Y - X @ B.T, axis=1)
    good = size <= 1e-9 * np.median(np.linalg.norm(Y, axis=1))
    weights = good.astype(float)
    B = _weighted_fit(X, Y, weights)
    condition = Condition(
        "zero-scale", f"{int(good.sum())} of {len(good)} windows fit exactly; the others got no weight"
    )
    q = Y.shape[1]
    return RobustFit(B, np.zeros((q, q), dtype=complex), weights, np.where(good, 0.0, np.inf), 0, (condition,))


def _least_squares_only(X: ComplexArray, Y: ComplexArray) -> RobustFit:
    n, q = len(Y), Y.shape[1]
    weights = np.ones(n)
    B = _weighted_fit(X, Y, weights)
    residual = Y - X @ B.T
    scatter = residual.T @ residual.conj() / max(n - X.shape[1], 1)
    condition = Condition("no-robust-start", f"{n} windows are too few for a robust fit; least squares was used")
    return RobustFit(B, scatter, weights, np.full(n, 2.0 * q), 0, (condition,))


def _start_pairs(direction: IntArray, seed: int) -> IntArray:
    """Pairs of windows from different directions, shape (_STARTS, 2)."""
    rng = np.random.default_rng(seed)
    n = len(direction)
    pairs = rng.integers(0, n, size=(8 * _STARTS, 2))
    different = direction[pairs[:, 0]] != direction[pairs[:, 1]]
    chosen = pairs[different][:_STARTS]
    return chosen if len(chosen) else pairs[pairs[:, 0] != pairs[:, 1]][:_STARTS]


def _weighted_fit(X: ComplexArray, Y: ComplexArray, weights: FloatArray) -> ComplexArray:
    """Weighted least squares; batched over leading axes of `weights` (..., n) -> (..., q, 2)."""
    Xw = weights[..., :, None] * X.conj()
    normal = np.swapaxes(Xw, -1, -2) @ X
    right = np.swapaxes(Xw, -1, -2) @ Y
    return np.swapaxes(_solve_2x2(normal, right), -1, -2)


def _solve_2x2(A: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Cramer's rule on (..., 2, 2); a singular system gives large numbers, not an exception."""
    det = A[..., 0, 0] * A[..., 1, 1] - A[..., 0, 1] * A[..., 1, 0]
    tiny = 1e-14 * np.abs(A[..., 0, 0] * A[..., 1, 1]) + np.finfo(float).tiny
    det = np.where(np.abs(det) > tiny, det, tiny)[..., None]
    first = A[..., 1, 1, None] * b[..., 0, :] - A[..., 0, 1, None] * b[..., 1, :]
    second = A[..., 0, 0, None] * b[..., 1, :] - A[..., 1, 0, None] * b[..., 0, :]
    return np.stack([first / det, second / det], axis=-2)


def _distance2(residual: ComplexArray, scatter: ComplexArray) -> FloatArray:
    """2 r^H S^-1 r, batched: residual (..., n, q), scatter (..., q, q) -> (..., n)."""
    solved = np.linalg.solve(scatter, np.swapaxes(residual, -1, -2))
    return 2.0 * np.einsum("...nq,...qn->...n", residual.conj(), solved).real


def _scatter(residual: ComplexArray, weights: FloatArray) -> ComplexArray:
    weighted = np.swapaxes(weights[..., :, None] * residual, -1, -2)
    return weighted @ residual.conj() / weights.sum(axis=-1)[..., None, None]


def _core_size(Y: ComplexArray, share: float) -> int:
    """Windows in the core: what leaves `share` of them out when the fit passes through as many as it can."""
    n, q = Y.shape
    return int(share * n + 0.5 * (2 + q + 1))


def _concentrated_start(X: ComplexArray, Y: ComplexArray, pairs: IntArray, share: float) -> tuple[ComplexArray, bool]:
    """Best of many concentrated two-window starts, and whether its core fits exactly."""
    n, q = Y.shape
    chosen = np.zeros((len(pairs), n))
    np.put_along_axis(chosen, pairs, 1.0, axis=1)
    B = _weighted_fit(X, Y, chosen)
    # Any equivariant metric does for the first ordering; that of the forces themselves is at hand.
    metric, h = _scatter(Y, np.ones(n)), _core_size(Y, share)
    scatter = np.broadcast_to(metric, (len(B), q, q))
    for step in range(12):
        previous = B
        B, scatter = _concentrate(X, Y, B, scatter, metric, h)
        exact = _fits_exactly(scatter, Y)
        if exact.any():
            return B[int(np.argmax(exact))], True
        if step == 1:
            best = np.argsort(_log_det(scatter), kind="stable")[:_KEPT]
            B, scatter = B[best], scatter[best]
        elif np.array_equal(B, previous):
            break  # every start keeps the same windows
    return B[int(np.argmin(_log_det(scatter)))], False


def _fits_exactly(scatter: ComplexArray, Y: ComplexArray) -> BoolArray:
    """Which starts leave (numerically) nothing in any component: they are the answer."""
    floor = 1e-26 * float(np.median(np.linalg.norm(Y, axis=1))) ** 2
    return np.asarray(np.einsum("...ii->...", scatter).real <= floor)


def _log_det(scatter: ComplexArray) -> FloatArray:
    return np.asarray(np.linalg.slogdet(scatter)[1])


def _concentrate(
    X: ComplexArray,
    Y: ComplexArray,
    B: ComplexArray,
    scatter: ComplexArray,
    metric: ComplexArray,
    h: int,
) -> tuple[ComplexArray, ComplexArray]:
    """Refit on the h windows nearest to the present fit (batched over starts).

    A trace of `metric` keeps the distance defined where the residuals of a subset are all alike.
    """
    distance2 = _distance2(Y - X @ np.swapaxes(B, -1, -2), scatter)
    nearest = np.argpartition(distance2, h - 1, axis=-1)[:, :h]
    weights = np.zeros(distance2.shape)
    np.put_along_axis(weights, nearest, 1.0, axis=-1)
    B = _weighted_fit(X, Y, weights)
    return B, _regular(_scatter(Y - X @ np.swapaxes(B, -1, -2), weights), metric)


def _regular(scatter: ComplexArray, metric: ComplexArray) -> ComplexArray:
    """A scatter that can be inverted: with a trace of `metric`, relative to its own size."""
    size = np.einsum("...ii->...", scatter).real / np.trace(metric).real
    return np.asarray(scatter + (1e-28 + 1e-13 * size)[..., None, None] * metric)


def _reweighted(X: ComplexArray, Y: ComplexArray, B: ComplexArray, share: float) -> tuple[ComplexArray, ComplexArray]:
    """Fit and scatter of the windows that belong together, from the concentrated core."""
    n, q = Y.shape
    h = _core_size(Y, share)
    residual, metric = Y - X @ B.T, _scatter(Y, np.ones(n))
    scatter = _regular(_scatter(residual, np.ones(n)), metric)
    # The core's own scatter is self-consistent after a few looks at which windows it holds.
    for _ in range(4):
        core = np.zeros(n)
        core[np.argpartition(_distance2(residual, scatter), h - 1)[:h]] = 1.0
        scatter = _regular(_scatter(residual, core), metric)
    scatter = scatter / half_shrinkage(2 * q, h / n)
    lower, upper, shrinkage = trimming_limits(2 * q)
    for _ in range(2):
        weights = trimming_weight(_distance2(residual, scatter), lower, upper)
        B = _weighted_fit(X, Y, weights)
        residual = Y - X @ B.T
        freedom = (weights.sum() - 2) / weights.sum()
        scatter = _regular(_scatter(residual, weights) / (shrinkage * freedom), metric)
    return B, scatter


def _accepted(X: ComplexArray, Y: ComplexArray, B: ComplexArray, scatter: ComplexArray) -> BoolArray:
    """Windows within the 99 % distance."""
    return np.asarray(_distance2(Y - X @ B.T, scatter) <= trimming_limits(2 * Y.shape[1])[0])


def _tighter_core(
    X: ComplexArray,
    Y: ComplexArray,
    direction: IntArray,
    pairs: IntArray,
    majority: tuple[ComplexArray, ComplexArray],
) -> tuple[ComplexArray, ComplexArray]:
    """Look for a tighter core of fewer windows where the half holds bad ones.

    With 40 % of the windows bad on average, a draw can well have more than half. Bad windows that
    scatter, or share a disturbance that no H explains, give themselves away: a smaller core that is
    several times tighter and has windows in every direction is the better start. (A core in a few
    directions only would be two runs fitted exactly, so it does not count.)
    """
    B, exact = _concentrated_start(X, Y, pairs, _SMALL_CORE)
    if exact:
        return majority
    B, scatter = _reweighted(X, Y, B, _SMALL_CORE)
    inside = np.unique(direction[_accepted(X, Y, B, scatter)])
    everywhere = len(inside) == len(np.unique(direction))
    tighter = _log_det(scatter) < _log_det(majority[1]) - np.log(4.0 ** Y.shape[1])
    return (B, scatter) if everywhere and tighter else majority
