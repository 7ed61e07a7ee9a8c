"""The high-breakdown start of the joint regression: least trimmed squares by concentration steps.

Many two-window starts are concentrated on the windows nearest to them (multivariate least trimmed squares,
Agullo, Croux & Van Aelst 2008). Normal equations, residual scatters and distances of all starts at once are
products with two tables of window by window terms, which is what makes this quick.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.estimate.robust_constants import half_shrinkage, trimming_limits, trimming_weight

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
        moments = (X.conj()[:, :, None] * Y[:, None, :]).reshape(self.n, -1)
        cross = X[:, 0].conj() * X[:, 1]
        power = X.real**2 + X.imag**2
        self._terms = np.concatenate(
            [power, cross.real[:, None], cross.imag[:, None], moments.real, moments.imag], axis=1
        )
        self._x, self._y = np.ascontiguousarray(X.T), np.ascontiguousarray(Y.T)
        #: Scatter of the forces themselves: any equivariant metric does for a first ordering, this one is at hand.
        #: A little of every component keeps it regular where some follow from the others exactly.
        self.metric = scatter(products(self._y), np.ones(self.n), self.q)
        self.metric += _METRIC_FLOOR * float(np.trace(self.metric).real) / self.q * np.eye(self.q)

    def fit(self, weights: FloatArray) -> ComplexArray:
        """Weighted least squares, (..., n) -> (..., q, 2), by Cramer's rule; a singular system gives large numbers."""
        sums = weights @ self._terms
        a, d, b, det = (part[..., None] for part in _normal(sums))
        half = (sums.shape[-1] - 4) // 2
        moment = (sums[..., 4 : 4 + half] + 1j * sums[..., 4 + half :]).reshape(*sums.shape[:-1], 2, self.q)
        B = np.empty((*sums.shape[:-1], self.q, 2), dtype=complex)
        B[..., 0] = (d * moment[..., 0, :] - b * moment[..., 1, :]) / det
        B[..., 1] = (a * moment[..., 1, :] - b.conj() * moment[..., 0, :]) / det
        return B

    def told(self, weights: FloatArray) -> FloatArray:
        """Share of noise in the variance of every window's residual, (..., n): what B is not told there is the rest.

        Windows alone in their direction cannot be held against a fit that has none of them.
        """
        a, d, b, det = _normal(weights @ self._terms[:, :4])
        inverse = np.stack([d, a, -2 * b.real, -2 * b.imag], axis=-1) / det[..., None]
        return np.asarray(1 / (1 + np.maximum(inverse @ self._terms[:, :4].T, 0.0)))

    def residual(self, B: ComplexArray) -> ComplexArray:
        """Y - X B', (n, q); `B` (q, 2)."""
        return np.asarray(self.Y - self.X @ B.T)

    def terms(self, B: ComplexArray) -> FloatArray:
        """`products` of the residual, (..., q^2, n); `B` (..., q, 2)."""
        return products(self._y - B @ self._x)


def _normal(sums: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
    """Entries xx, yy, xy of the normal equations, and their determinant, never zero; `sums` (..., 4 or more)."""
    a, d, b = sums[..., 0], sums[..., 1], sums[..., 2] + 1j * sums[..., 3]
    least = 1e-14 * a * d + 1e-28 * (a + d) ** 2 + np.finfo(float).tiny
    return a, d, b, np.maximum(a * d - (b.real**2 + b.imag**2), least)


@functools.cache
def _pairs(q: int) -> tuple[IntArray, IntArray]:
    """Indices a < b."""
    return np.triu_indices(q, 1)


def products(rows: ComplexArray) -> FloatArray:
    """Terms of r r^H as reals, (..., q, n) -> (..., q^2, n): |r_a|^2, then Re and Im of conj(r_a) r_b for a < b."""
    q = rows.shape[-2]
    first, second = _pairs(q)
    pairs = rows[..., first, :].conj() * rows[..., second, :]
    result = np.empty((*rows.shape[:-2], q * q, rows.shape[-1]))
    np.square(rows.real, out=result[..., :q, :])
    result[..., :q, :] += np.square(rows.imag)
    result[..., q : q + len(first), :] = pairs.real
    result[..., q + len(first) :, :] = pairs.imag
    return result


def scatter(terms: FloatArray, weights: FloatArray, q: int) -> ComplexArray:
    """Weighted mean of r r^H, (..., q, q), from `products`; `terms` (..., q^2, n), `weights` (..., n)."""
    sums = (terms @ weights[..., None])[..., 0] / weights.sum(axis=-1)[..., None]
    first, second = _pairs(q)
    result = np.zeros((*sums.shape[:-1], q, q), dtype=complex)
    np.einsum("...ii->...i", result)[...] = sums[..., :q]
    pairs = sums[..., q : q + len(first)] + 1j * sums[..., q + len(first) :]
    result[..., second, first] = pairs
    result[..., first, second] = pairs.conj()
    return result


def distance2(terms: FloatArray, inner: ComplexArray) -> FloatArray:
    """2 r^H S^-1 r of every window, (..., n), from `products` and the scatter S.

    `terms` (..., q^2, n), `inner` (..., q, q).
    """
    inverse = np.linalg.inv(inner)
    q = inner.shape[-1]
    first, second = _pairs(q)
    pairs = inverse[..., first, second]
    factors = np.concatenate([2 * np.einsum("...ii->...i", inverse).real, 4 * pairs.real, -4 * pairs.imag], axis=-1)
    # a scatter that is all but singular makes rounding large, of either sign
    return np.maximum((factors[..., None, :] @ terms)[..., 0, :], 0.0)


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
    seeds = _first_fits(regression, _start_pairs(direction, seed))
    repeats = len(direction) / len(np.unique(direction))
    half, exact = _concentrated(regression, seeds, 0.5, repeats)
    if exact:
        return InitialFit(regression.fit(half), np.zeros((regression.q, regression.q), dtype=complex), True)
    majority = InitialFit(*_reweighted(regression, half, 0.5))
    few, exact = _concentrated(regression, seeds, _SMALL_CORE, repeats)
    if exact:
        return majority
    core = InitialFit(*_reweighted(regression, few, _SMALL_CORE))
    limit = trimming_limits(2 * regression.q)[0]
    accepted = distance2(regression.terms(core.coefficients), core.scatter) <= limit
    everywhere = len(np.unique(direction[accepted])) == len(np.unique(direction))
    tighter = _log_det(core.scatter) < _log_det(majority.scatter) - np.log(4.0**regression.q)
    return core if everywhere and tighter else majority


def evenly_chosen(direction: IntArray, most: int) -> IntArray:
    """Indices of at most about `most` windows, the same share of every direction, spread over its time."""
    n = len(direction)
    if n <= most:
        return np.arange(n)
    by_direction = np.argsort(direction, kind="stable")
    return np.sort(by_direction[np.round(np.linspace(0, n - 1, most)).astype(int)])


def _start_pairs(direction: IntArray, seed: int) -> IntArray:
    """Pairs of windows from different directions, shape (STARTS, 2)."""
    rng = np.random.default_rng(seed)
    n = len(direction)
    pairs = rng.integers(0, n, size=(8 * STARTS, 2))
    different = direction[pairs[:, 0]] != direction[pairs[:, 1]]
    chosen = pairs[different][:STARTS]
    return chosen if len(chosen) else pairs[pairs[:, 0] != pairs[:, 1]][:STARTS]


def _core_size(regression: Regression, share: float) -> int:
    """Windows in the core: what leaves `share` of them out when the fit passes through as many as it can."""
    return int(share * regression.n + 0.5 * (2 + regression.q + 1))


def _first_fits(regression: Regression, pairs: IntArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Fits through pairs of windows, the terms of their residuals, and the windows' distances from them."""
    chosen = np.zeros((len(pairs), regression.n))
    np.put_along_axis(chosen, pairs, 1.0, axis=1)
    B = regression.fit(chosen)
    terms = regression.terms(B)
    spread = np.broadcast_to(regression.metric, (len(B), regression.q, regression.q))
    return B, terms, regression.told(chosen) * distance2(terms, spread)


def _concentrated(
    regression: Regression, seeds: tuple[ComplexArray, FloatArray, FloatArray], share: float, repeats: float
) -> tuple[FloatArray, bool]:
    """Weights (n,) of the core of the best of many concentrated two-window starts, and whether it fits exactly."""
    h = _core_size(regression, share)
    B, terms, distance = seeds
    for step in range(_STEPS):
        previous = B
        weights = _nearest(distance, h)
        told = regression.told(weights / repeats)  # windows of one direction may be off alike: they tell H once
        B = regression.fit(weights)
        terms = regression.terms(B)
        spread = _regular(scatter(terms, weights, regression.q), regression.metric)
        exact = _fits_exactly(spread, regression.Y) & (told.min(axis=-1) > _UNDETERMINED)
        if exact.any():
            return weights[int(np.argmax(exact))], True
        if step == 1:
            best = np.argsort(_log_det(spread), kind="stable")[:_KEPT]
            B, spread, terms, weights, told = B[best], spread[best], terms[best], weights[best], told[best]
        elif np.array_equal(B, previous):
            break  # every start keeps the same windows
        distance = told * distance2(terms, spread)
    return weights[int(np.argmin(_log_det(spread)))], False


def _nearest(distance: FloatArray, h: int) -> FloatArray:
    """Weight one for the h nearest windows."""
    weights = np.zeros(distance.shape)
    np.put_along_axis(weights, np.argpartition(distance, h - 1, axis=-1)[..., :h], 1.0, axis=-1)
    return weights


def _fits_exactly(spread: ComplexArray, Y: ComplexArray) -> BoolArray:
    """Which starts leave (numerically) nothing in any component: they are the answer."""
    floor = 1e-26 * float(np.median(np.linalg.norm(Y, axis=1))) ** 2
    return np.asarray(np.einsum("...ii->...", spread).real <= floor)


def _log_det(spread: ComplexArray) -> FloatArray:
    return np.asarray(np.linalg.slogdet(spread)[1])


def _regular(spread: ComplexArray, metric: ComplexArray) -> ComplexArray:
    """A scatter that can be inverted: with a trace of `metric`, relative to its own size."""
    size = np.einsum("...ii->...", spread).real / np.trace(metric).real
    return np.asarray(spread + (1e-28 + 1e-13 * size)[..., None, None] * metric)


def _reweighted(regression: Regression, core: FloatArray, share: float) -> tuple[ComplexArray, ComplexArray]:
    """Fit and scatter of the windows that belong together, from the weights (n,) of the concentrated core."""
    n, q, metric = regression.n, regression.q, regression.metric
    h = _core_size(regression, share)
    B, told = regression.fit(core), regression.told(core)
    terms = regression.terms(B)
    spread = _regular(scatter(terms, np.ones(n), q), metric)
    # The core's own scatter is self-consistent after a few looks at which windows it holds.
    for _ in range(4):
        spread = _regular(scatter(terms, _nearest(told * distance2(terms, spread), h), q), metric)
    spread = spread / half_shrinkage(2 * q, h / n)
    lower, upper, shrinkage = trimming_limits(2 * q)
    for _ in range(2):
        weights = trimming_weight(told * distance2(terms, spread), lower, upper)
        B, told = regression.fit(weights), regression.told(weights)
        terms = regression.terms(B)
        freedom = (weights.sum() - 2) / weights.sum()
        spread = _regular(scatter(terms, weights, q) / (shrinkage * freedom), metric)
    return B, spread
