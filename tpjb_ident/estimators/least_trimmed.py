"""Joint complex MM regression: one weight per window over all its components.

An M-estimator on stacked real rows (what RLM does) breaks down with a few bad regressors, and here
the regressors are the probes. This one starts from a high-breakdown fit (`least_trimmed`) with its
scale, then takes a 95 % efficient biweight M-step at that fixed scale (the MM principle of Yohai 1987).
All of it with the full residual covariance, so that phase, axes and units
do not matter. A biweight S-start was tried and given up: with 45 % of the windows hit by one and the
same disturbance its reweighting leaves the good solution that the trimmed start has found.

The high-breakdown start is least trimmed squares by concentration steps: many two-window starts are concentrated on the
windows nearest to them (multivariate least trimmed squares, Agullo, Croux & Van Aelst 2008), all starts at once.
"""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.statistics import (
    bisquare_weight,
    efficiency_constant,
    half_shrinkage,
    trimming_limits,
    trimming_weight,
)

STARTS = 60
_KEPT = 4
_STEPS = 12
#: Share of the mean power of all components that each has at least in the metric.
_METRIC_FLOOR = 0.01
#: Share of the windows in the smaller core that is looked for besides the half.
_SMALL_CORE = 0.38
#: A core that tells less than this of some window leaves H undetermined, and fits it exactly by that.
_UNDETERMINED = 1e-12


class Regression:
    """Y = X B' of one table of windows, for any weights."""

    def __init__(self, X: ComplexArray, Y: ComplexArray) -> None:
        self.X, self.Y = X, Y
        self.n, self.q = Y.shape
        moments = X.conj()[:, :, None] * np.concatenate([X, Y], axis=1)[:, None, :]
        self._moments = moments.reshape(self.n, -1).view(float)
        self._x, self._y = np.ascontiguousarray(X.T), np.ascontiguousarray(Y.T)
        #: Scatter of the forces themselves: any equivariant metric does for a first ordering, this one is at hand.
        #: A little of every component keeps it regular where some follow from the others exactly.
        self.metric = self._y @ self._y.conj().T / self.n
        self.metric += _METRIC_FLOOR * float(np.trace(self.metric).real) / self.q * np.eye(self.q)

    def _sums(self, weights: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Normal equations (..., 2, 2) and right-hand sides (..., 2, q); never singular; `weights` (..., n)."""
        sums = (weights @ self._moments).view(complex).reshape(*weights.shape[:-1], 2, 2 + self.q)
        normal, least = sums[..., :2], np.finfo(float).tiny
        size = np.einsum("...ii->...", normal).real[..., None, None]
        return normal * (1 + 1e-14 * np.eye(2)) + (1e-28 * size + least) * np.eye(2), sums[..., 2:]

    def fit(self, weights: FloatArray) -> ComplexArray:
        """Weighted least squares, (..., n) -> (..., q, 2); a singular system gives large numbers."""
        return np.asarray(np.linalg.solve(*self._sums(weights)).swapaxes(-1, -2))

    def told(self, weights: FloatArray) -> FloatArray:
        """Share of noise in the variance of every window's residual, (..., n): what B is not told there is the rest.

        Windows alone in their direction cannot be held against a fit that has none of them.
        """
        leverage = _squares(self._x.conj(), np.linalg.inv(self._sums(weights)[0]))
        return 1 / (1 + np.maximum(leverage, 0.0))

    def scatter(self, rows: ComplexArray, weights: FloatArray, shrinkage: float = 1.0) -> ComplexArray:
        """Weighted mean of r r^H over `shrinkage`, (..., q, q); `rows` (..., q, n), `weights` (..., n).

        A trace of the metric, relative to its own size, lets it be inverted.
        """
        sums = (weights[..., None, :] * rows) @ rows.conj().swapaxes(-1, -2)
        spread = sums / (shrinkage * weights.sum(axis=-1))[..., None, None]
        size = np.einsum("...ii->...", spread).real / np.trace(self.metric).real
        return spread + (1e-28 + 1e-13 * size)[..., None, None] * self.metric

    def residual(self, B: ComplexArray) -> ComplexArray:
        """Y - X B' of every window, (..., q, n); `B` (..., q, 2)."""
        return self._y - B @ self._x


def _squares(rows: ComplexArray, matrix: np.ndarray) -> FloatArray:
    """r^H A r of every window, (..., n); `rows` (..., q, n), `matrix` (..., q, q)."""
    moved = matrix @ rows
    return (rows.real * moved.real + rows.imag * moved.imag).sum(axis=-2)


def distance2(rows: ComplexArray, inner: ComplexArray) -> FloatArray:
    """2 r^H S^-1 r of every window, (..., n), from residuals (..., q, n) and their scatter S (..., q, q)."""
    # a scatter that is all but singular makes rounding large, of either sign
    return np.maximum(2 * _squares(rows, np.linalg.inv(inner)), 0.0)


@dataclass(frozen=True)
class InitialFit:
    """A robust first answer."""

    coefficients: ComplexArray  #: (q, 2) complex
    scatter: ComplexArray  #: (q, q) complex: residual covariance of the windows that belong together
    exact: bool = False


def robust_start(regression: Regression, direction: IntArray, seed: int) -> InitialFit:
    """Find coefficients and scatter of the majority, or of a tighter core; `direction` (n,).

    With 40 % of the windows bad on average, a draw can well have more than half. Bad windows that scatter, or
    share a disturbance that no H explains, give themselves away: a smaller core that is several times tighter
    and has windows in every direction is the better start. (A core in a few directions only would be two runs
    fitted exactly, so it does not count.)
    """
    directions = len(np.unique(direction))
    seeds = _first_fits(regression, _start_pairs(direction, seed))
    fits: list[InitialFit] = []
    for share in (0.5, _SMALL_CORE):
        weights, exact = _concentrated(regression, seeds, share, len(direction) / directions)
        if exact:
            none = np.zeros((regression.q, regression.q), dtype=complex)
            return fits[0] if fits else InitialFit(regression.fit(weights), none, True)
        fits.append(_reweighted(regression, weights, share))
    majority, core = fits
    limit = trimming_limits(2 * regression.q)[0]
    accepted = distance2(regression.residual(core.coefficients), core.scatter) <= limit
    everywhere = len(np.unique(direction[accepted])) == directions
    tighter = _log_det(core.scatter) < _log_det(majority.scatter) - np.log(4.0**regression.q)
    return core if everywhere and tighter else majority


def evenly_chosen(direction: IntArray, most: int) -> IntArray:
    """Indices of at most about `most` windows, the same share of every direction, spread over its time."""
    n = len(direction)
    by_direction = np.argsort(direction, kind="stable")
    return np.sort(by_direction[np.round(np.linspace(0, n - 1, min(n, most))).astype(int)])


def _start_pairs(direction: IntArray, seed: int) -> IntArray:
    """Pairs of windows from different directions, shape (STARTS, 2)."""
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, len(direction), size=(8 * STARTS, 2))
    different = direction[pairs[:, 0]] != direction[pairs[:, 1]]
    chosen = pairs[different][:STARTS]
    return chosen if len(chosen) else pairs[pairs[:, 0] != pairs[:, 1]][:STARTS]


def _core_size(regression: Regression, share: float) -> int:
    """Windows in the core: what leaves `share` of them out when the fit passes through as many as it can."""
    return int(share * regression.n + 0.5 * (2 + regression.q + 1))


def _first_fits(regression: Regression, pairs: IntArray) -> tuple[ComplexArray, FloatArray]:
    """Fits through pairs of windows, and the windows' distances from them."""
    chosen = np.zeros((len(pairs), regression.n))
    np.put_along_axis(chosen, pairs, 1.0, axis=1)
    B = regression.fit(chosen)
    return B, regression.told(chosen) * distance2(regression.residual(B), regression.metric)


def _concentrated(
    regression: Regression, seeds: tuple[ComplexArray, FloatArray], share: float, repeats: float
) -> tuple[FloatArray, bool]:
    """Weights (n,) of the core of the best of many concentrated two-window starts, and whether it fits exactly.

    `seeds`: coefficients of the starts, and the windows' distances from them.
    """
    h = _core_size(regression, share)
    B, distance = seeds
    nothing = 1e-26 * np.median(np.linalg.norm(regression.Y, axis=1)) ** 2
    for step in range(_STEPS):
        previous = B
        weights = _nearest(distance, h)
        told = regression.told(weights / repeats)  # windows of one direction may be off alike: they tell H once
        B = regression.fit(weights)
        rows = regression.residual(B)
        spread = regression.scatter(rows, weights)
        exact = (np.einsum("...ii->...", spread).real <= nothing) & (told.min(axis=-1) > _UNDETERMINED)
        if exact.any():  # nothing is left in any component: that is the answer
            return weights[np.argmax(exact)], True
        if step == 1:
            best = np.argsort(_log_det(spread), kind="stable")[:_KEPT]
            B, spread, rows, weights, told = B[best], spread[best], rows[best], weights[best], told[best]
        elif np.array_equal(B, previous):
            break  # every start keeps the same windows
        distance = told * distance2(rows, spread)
    return weights[np.argmin(_log_det(spread))], False


def _nearest(distance: FloatArray, h: int) -> FloatArray:
    """Weight one for the h nearest windows."""
    weights = np.zeros(distance.shape)
    np.put_along_axis(weights, np.argpartition(distance, h - 1, axis=-1)[..., :h], 1.0, axis=-1)
    return weights


def _log_det(spread: ComplexArray) -> FloatArray:
    return np.linalg.slogdet(spread)[1]


def _reweighted(regression: Regression, core: FloatArray, share: float) -> InitialFit:
    """Fit and scatter of the windows that belong together, from the weights (n,) of the concentrated core."""
    n, h, dimension = regression.n, _core_size(regression, share), 2 * regression.q
    B, told = regression.fit(core), regression.told(core)
    rows, members = regression.residual(B), np.ones(n)
    # The core's own scatter is self-consistent after a few looks at which windows it holds.
    for _ in range(5):
        spread = regression.scatter(rows, members)
        members = _nearest(told * distance2(rows, spread), h)
    spread = spread / half_shrinkage(dimension, h / n)
    lower, upper, shrinkage = trimming_limits(dimension)
    for _ in range(2):
        weights = trimming_weight(told * distance2(rows, spread), lower, upper)
        B, told = regression.fit(weights), regression.told(weights)
        rows = regression.residual(B)
        spread = regression.scatter(rows, weights, shrinkage * (1 - 2 / weights.sum()))
    return InitialFit(B, spread)


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
    conditions: Conditions


def mm_fit(X: ComplexArray, Y: ComplexArray, direction: IntArray, seed: int = 1, tolerance: float = 1e-12) -> RobustFit:
    """Robust multivariate complex regression of Y on X; `X` (n, 2), `Y` (n, q), `direction` (n,)."""
    n, q = len(Y), Y.shape[1]
    regression = Regression(X, Y)
    if n < max(_MIN_WINDOWS, 2 * (q + 1) + 2):
        text = f"{n} windows are too few for a robust fit; least squares was used"
        return _plain_fit(regression, np.ones(n), Condition("no-robust-start", text))
    subset = evenly_chosen(direction, MANY_WINDOWS)
    start = robust_start(Regression(X[subset], Y[subset]), direction[subset], seed)
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
    spread = residual @ residual.conj().T / max(weights.sum() - 2.0, 1.0)
    return RobustFit(B, spread, weights, 0, (condition,))
