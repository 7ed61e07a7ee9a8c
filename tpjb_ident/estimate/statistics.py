"""Widths of intervals; weights of the robust estimators with their constants, computed, and the loop that they share.

For a q-dimensional complex circular Gaussian residual with covariance S, u = sqrt(2 r^H S^-1 r) follows
a chi distribution with 2 q degrees of freedom; everything below is an expectation over it.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.special import chdtr, gammaincinv, stdtrit

from rigdata.arrays import FloatArray

#: Median of the absolute value of a standard normal variable.
_NORMAL_MAD = 0.6744897501960817
#: Probabilities beyond which a window begins to lose weight, and beyond which none is left.
_BEGIN, _END = 0.99, 0.9999
#: Where a distribution ends, u^2, and values that stand for it.
_WIDEST, _VALUES = 400.0, 4000


def student_widening(freedom: float) -> float:
    """Width of Student's 95 % interval over that of the normal one: a scatter of few is uncertain by itself."""
    return float(stdtrit(freedom, 0.975) / stdtrit(np.inf, 0.975))


def half_width(level: float, random: FloatArray, dof: FloatArray, systematic: FloatArray) -> FloatArray:
    """Half the width of intervals (n,): Student's t of random standard errors, normal of systematic ones."""
    quantile = 0.5 + 0.5 * level
    return np.hypot(stdtrit(dof, quantile) * random, stdtrit(np.inf, quantile) * systematic)


def bisquare_weight(u: FloatArray, c: float) -> FloatArray:
    """Tukey's weight psi(u) / u; `u` (n,)."""
    return np.maximum(1 - (u / c) ** 2, 0.0) ** 2


def huber_weight(u: FloatArray, c: float) -> FloatArray:
    """Huber's weight psi(u) / u; `u` (n,), not negative."""
    return c / np.maximum(u, c)


def reweighted(
    design: Any,
    response: Any,
    weigh: Callable[[FloatArray], FloatArray],
    scale: float | FloatArray | None = None,
    tolerance: float = 1e-10,
    most: int = 200,
) -> tuple[Any, FloatArray, Any, int]:
    """Regression by iteratively reweighted least squares: coefficients (p,), weights (m,), scale and rounds.

    `design` (m, p), `response` (m,), real or complex; `weigh` takes absolute residuals over their scale, that of their
    median where none is known.
    """
    values, weights = np.linalg.pinv(design).dot(response), np.ones(len(response))
    rounds, step = 1, np.full(1, np.inf)
    while True:
        residual = np.abs(response - design.dot(values))
        size = np.median(residual / _NORMAL_MAD) if scale is None else scale
        if rounds >= most or not np.any(step > tolerance) or not np.all(size):
            return values, weights, size, rounds
        weights = weigh(residual / size)
        half = np.sqrt(weights)
        updated = np.linalg.pinv(half[:, None] * design).dot(half * response)
        step, values = np.abs(updated - values), updated
        rounds += 1


def half_shrinkage(dimension: int, share: float) -> float:
    """Variance of the innermost `share` of a chi(dimension) population, relative to all of it."""
    return float(chdtr(dimension + 2, _quantile(share, dimension)) / share)


@functools.cache
def efficiency_constant(dimension: int, efficiency: float = 0.95) -> float:
    """Constant c at which the bisquare location/regression estimate has this Gaussian efficiency."""
    x, density = _chi_square(dimension, _WIDEST)
    lower, upper = 1.0, 20.0
    while upper - lower > 1e-12:  # halved: scipy's root finders take longer to import than `identify` to solve
        middle = (lower + upper) / 2
        v = np.minimum(x / middle**2, 1.0)
        power, slope = density @ (x * (1 - v) ** 4) / dimension, density @ ((1 - v) ** 2 - 4 / dimension * v * (1 - v))
        lower, upper = (lower, middle) if slope**2 > efficiency * power else (middle, upper)
    return lower


@functools.cache
def trimming_limits(dimension: int) -> tuple[float, float, float]:
    """Squared distances where a window starts to lose weight and where it has none; the variance that weights leave."""
    lower, upper = _quantile(_BEGIN, dimension), _quantile(_END, dimension)
    x, density = _chi_square(dimension, upper)
    weight = density * trimming_weight(x, lower, upper)
    return lower, upper, float(weight @ x / (dimension * weight.sum()))


def _chi_square(dimension: int, most: float) -> tuple[FloatArray, FloatArray]:
    """Values u^2 up to `most`, and the share of the distribution about each: midpoints over u."""
    u = np.sqrt(most) * (np.arange(_VALUES) + 0.5) / _VALUES
    density = u ** (dimension - 1) * np.exp(-(u**2) / 2)
    return u**2, density / density.sum()


def _quantile(share: float, dimension: int) -> float:
    """Of the chi-square distribution."""
    return float(2.0 * gammaincinv(dimension / 2, share))


def trimming_weight(u2: FloatArray, lower: float, upper: float) -> FloatArray:
    """One up to `lower`, falling smoothly to zero at `upper` (no window tips the answer by a hair); `u2` (n,)."""
    v = np.clip((u2 - lower) / (upper - lower), 0.0, 1.0)
    return (1 - v) ** 2 * (1 + 2 * v)
