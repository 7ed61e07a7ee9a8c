"""Tuning constants of the complex robust estimators, computed instead of quoted.

For a q-dimensional complex circular Gaussian residual with covariance S, u = sqrt(2 r^H S^-1 r) follows
a chi distribution with 2 q degrees of freedom; everything below is an expectation over it.
"""

from __future__ import annotations

import functools
from math import comb

import numpy as np
from scipy.special import chdtr, gammaincinv, gammaln, xlogy

from rigdata.arrays import FloatArray

#: Probabilities beyond which a window begins to lose weight, and beyond which none is left.
_BEGIN, _END = 0.99, 0.9999


def bisquare_weight(u: FloatArray, c: float) -> FloatArray:
    """Tukey's weight psi(u) / u; `u` (n,)."""
    return np.asarray(np.maximum(1 - (u / c) ** 2, 0.0) ** 2)


def half_shrinkage(dimension: int, share: float) -> float:
    """Variance of the innermost `share` of a chi(dimension) population, relative to all of it."""
    return float(chdtr(dimension + 2, _quantile(share, dimension)) / share)


@functools.cache
def efficiency_constant(dimension: int, efficiency: float = 0.95) -> float:
    """Constant c at which the bisquare location/regression estimate has this Gaussian efficiency."""

    def moment(k: int, c: float) -> float:
        """E[u^2k; u < c]: the chi-square's recursion x^k p_d(x) ~ p_(d + 2 k)(x)."""
        rising = float(np.prod(dimension + 2.0 * np.arange(k)))
        return rising * float(chdtr(dimension + 2 * k, c**2))

    def shortfall(c: float) -> float:
        # psi^2 = u^2 (1 - v)^4 and the mean slope (1 - v)^2 - 4 v (1 - v) / d, with v = (u / c)^2
        a = sum(comb(4, j) * (-1) ** j * moment(j + 1, c) / c ** (2 * j) for j in range(5)) / dimension
        more = 4 / dimension
        b = moment(0, c) - (2 + more) * moment(1, c) / c**2 + (1 + more) * moment(2, c) / c**4
        return float(b**2 / a - efficiency)

    lower, upper = 2.0, 30.0
    while upper - lower > 1e-12:  # halved: scipy's root finders take longer to import than `identify` to solve
        middle = (lower + upper) / 2
        lower, upper = (lower, middle) if shortfall(middle) > 0 else (middle, upper)
    return lower


@functools.cache
def trimming_limits(dimension: int) -> tuple[float, float, float]:
    """Squared distances where a window starts to lose weight and where it has none."""
    lower, upper = _quantile(_BEGIN, dimension), _quantile(_END, dimension)

    nodes, width = np.polynomial.legendre.leggauss(40)
    x = lower + 0.5 * (upper - lower) * (nodes + 1)
    part = 0.5 * (upper - lower) * width * trimming_weight(x, lower, upper) * _density(x, dimension)
    mass = float(chdtr(dimension, lower) + part.sum())
    moment = float(dimension * chdtr(dimension + 2, lower) + (part * x).sum())
    return lower, upper, moment / (dimension * mass)


def _quantile(share: float, dimension: int) -> float:
    """Of the chi-square distribution."""
    return float(2.0 * gammaincinv(dimension / 2, share))


def _density(x: FloatArray, dimension: int) -> FloatArray:
    """Of the chi-square distribution."""
    half = dimension / 2.0
    return np.asarray(np.exp(xlogy(half - 1.0, x) - x / 2.0 - gammaln(half) - np.log(2) * dimension / 2.0))


def trimming_weight(u2: FloatArray, lower: float, upper: float) -> FloatArray:
    """One up to `lower`, falling smoothly to zero at `upper` (no window tips the answer by a hair); `u2` (n,)."""
    v = np.clip((u2 - lower) / (upper - lower), 0.0, 1.0)
    return np.asarray((1 - v) ** 2 * (1 + 2 * v))
