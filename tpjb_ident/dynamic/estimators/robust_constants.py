"""Tuning constants of the complex robust estimators, computed instead of quoted.

For a q-dimensional complex circular Gaussian residual with covariance S, u = sqrt(2 r^H S^-1 r) follows
a chi distribution with 2 q degrees of freedom; everything below is an expectation over it.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy import integrate, optimize
from scipy.stats import chi, chi2

from tpjb_ident.arrays import FloatArray


def bisquare_weight(u: FloatArray, c: float) -> FloatArray:
    """Tukey's weight psi(u) / u.

    Parameters
    ----------
    u : (n,) ndarray
        Residuals over their scale.
    c : float
        Residual from which the weight is zero.
    """
    return np.asarray(np.maximum(1 - (u / c) ** 2, 0.0) ** 2)


def half_shrinkage(dimension: int, share: float) -> float:
    """Variance of the innermost `share` of a chi(dimension) population, relative to all of it.

    Parameters
    ----------
    dimension : int
        Real dimensions.
    share : float
        0 to 1.
    """
    limit = chi2.ppf(share, dimension)
    return float(chi2.cdf(limit, dimension + 2) / share)


@functools.cache
def efficiency_constant(dimension: int, efficiency: float = 0.95) -> float:
    """Constant c at which the bisquare location/regression estimate has this Gaussian efficiency.

    Parameters
    ----------
    dimension : int
        Real dimensions.
    efficiency : float, optional
        0 to 1.
    """

    def shortfall(c: float) -> float:
        def psi2(u: float) -> float:
            return float(u**2 * (1 - (u / c) ** 2) ** 4 * chi.pdf(u, dimension))

        def slope(u: float) -> float:
            v = (u / c) ** 2
            weight = (1 - v) ** 2
            return float((weight - 4 * v * (1 - v) / dimension) * chi.pdf(u, dimension))

        a = integrate.quad(psi2, 0, c)[0] / dimension
        b = integrate.quad(slope, 0, c)[0]
        return float(b**2 / a - efficiency)

    return float(optimize.brentq(shortfall, 2.0, 30.0))


@functools.cache
def trimming_limits(dimension: int, begin: float = 0.99, end: float = 0.9999) -> tuple[float, float, float]:
    """Squared distances where a window starts to lose weight and where it has none.

    Parameters
    ----------
    dimension : int
        Real dimensions.
    begin : float, optional
        Probability beyond which weight is lost.
    end : float, optional
        Probability beyond which none is left.

    Returns
    -------
    lower, upper : float
        Limits of u^2, chi-square with `dimension` degrees of freedom.
    shrinkage : float
        E[w u^2] / (dimension E[w]): what a weighted covariance comes out too small by.
    """
    lower, upper = float(chi2.ppf(begin, dimension)), float(chi2.ppf(end, dimension))

    def weight(u2: float) -> float:
        return float(trimming_weight(np.asarray(u2), lower, upper))

    mass = integrate.quad(lambda x: weight(x) * chi2.pdf(x, dimension), 0, upper, points=[lower])[0]
    moment = integrate.quad(lambda x: weight(x) * x * chi2.pdf(x, dimension), 0, upper, points=[lower])[0]
    return lower, upper, float(moment / (dimension * mass))


def trimming_weight(u2: FloatArray, lower: float, upper: float) -> FloatArray:
    """One up to `lower`, falling smoothly to zero at `upper` (no window tips the answer by a hair).

    Parameters
    ----------
    u2 : (n,) ndarray
        Squared distances.
    lower : float
        Where weight begins to fall.
    upper : float
        Where none is left.
    """
    v = np.clip((u2 - lower) / (upper - lower), 0.0, 1.0)
    return np.asarray((1 - v) ** 2 * (1 + 2 * v))
