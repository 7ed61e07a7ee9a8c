"""statsmodels' RLM with the norms of Huber and Tukey and the MAD scale, operation by operation, without statsmodels.

Every identification computes these two beside its own estimate; to import statsmodels and what it draws in took as long
as to read all records. A test holds the two equal to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition

#: Thresholds in scales, statsmodels' own.
HUBER, TUKEY = 1.345, 4.685
#: Median of the absolute value of a standard normal variable.
NORMAL_MAD = 0.6744897501960817


@dataclass(frozen=True)
class Norm:
    """How residuals over their scale count: psi(z) / z, psi(z), its derivative."""

    weights: Callable[[FloatArray], FloatArray]
    psi: Callable[[FloatArray], FloatArray]
    slope: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class RlmSolution:
    """One real robust regression: what statsmodels' ``RLM(...).fit(conv="coefs")`` tells of it.

    Attributes
    ----------
    params : (p,) ndarray
    covariance : (p, p) ndarray
        H1, scaled.
    weights : (m,) ndarray
    scale : float
    iterations : int
    conditions : tuple of Condition
    """

    params: FloatArray
    covariance: FloatArray
    weights: FloatArray
    scale: float
    iterations: int
    conditions: tuple[Condition, ...] = ()


def robust_fit(
    design: FloatArray, response: FloatArray, norm: str, max_iterations: int, tolerance: float
) -> RlmSolution:  # fmt: skip
    """Robust regression by iteratively reweighted least squares.

    Parameters
    ----------
    design : (m, p) real ndarray
    response : (m,) real ndarray
    norm : str
        Out of `NORMS`.
    max_iterations : int
    tolerance : float
        On the largest change of a coefficient.

    Returns
    -------
    RobustFit

    Notes
    -----
    P. J. Huber, Robust Statistics, Wiley, 1981; statsmodels 0.15, ``robust.robust_linear_model``.
    """
    chosen = NORMS[norm]
    inverse = np.linalg.pinv(design)
    params, weights = inverse.dot(response), np.ones(len(response))
    residual = response - design.dot(params)
    scale, iterations = _mad(residual), 1
    while scale != 0.0:
        weights = chosen.weights(residual / scale)
        half = np.sqrt(weights)
        before, params = params, np.linalg.pinv(half[:, None] * design).dot(half * response)
        residual = response - design.dot(params)
        scale = _mad(residual)
        iterations += 1
        if iterations >= max_iterations or not np.any(np.abs(params - before) > tolerance):
            break
    sizes = residual / scale if scale != 0.0 else np.zeros(len(response))
    rank = int(np.linalg.matrix_rank(design))
    return RlmSolution(params, _spread(chosen, sizes, scale, rank) * inverse.dot(inverse.T), weights, scale, iterations)


def _mad(residual: FloatArray) -> float:
    return float(np.median(np.abs(residual) / NORMAL_MAD))


def _spread(norm: Norm, sizes: FloatArray, scale: float, rank: int) -> float:
    """Variance of a coefficient over that of the plain design: H1 of Huber 1973 with the small-sample factor k."""
    n, slope = len(sizes), norm.slope(sizes)
    k = 1 + rank / n * np.var(slope) / np.mean(slope) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):  # no row to spare: no covariance
        square = np.divide(1.0, n - rank) * np.sum(norm.psi(sizes) ** 2) * scale**2
    return float(k**2 * square / ((1 / n * np.sum(slope)) ** 2))


def _huber_weights(z: FloatArray) -> FloatArray:
    inside, size = np.less_equal(np.abs(z), HUBER), np.abs(z)
    size[inside] = 1.0
    return np.asarray(inside + (1 - inside) * HUBER / size)


def _huber_psi(z: FloatArray) -> FloatArray:
    inside = np.less_equal(np.abs(z), HUBER)
    return np.asarray(inside * z + (1 - inside) * HUBER * np.sign(z))


def _huber_slope(z: FloatArray) -> FloatArray:
    return np.less_equal(np.abs(z), HUBER).astype(float)


def _tukey_weights(z: FloatArray) -> FloatArray:
    return np.asarray((1 - (z / TUKEY) ** 2) ** 2 * np.less_equal(np.abs(z), TUKEY))


def _tukey_psi(z: FloatArray) -> FloatArray:
    return np.asarray(z * (1 - (z / TUKEY) ** 2) ** 2 * np.less_equal(np.abs(z), TUKEY))


def _tukey_slope(z: FloatArray) -> FloatArray:
    inside = np.less_equal(np.abs(z), TUKEY)
    return np.asarray(inside * ((1 - (z / TUKEY) ** 2) ** 2 - (4 * z**2 / TUKEY**2) * (1 - (z / TUKEY) ** 2)))


_TUKEY = Norm(_tukey_weights, _tukey_psi, _tukey_slope)
NORMS = {"huber": Norm(_huber_weights, _huber_psi, _huber_slope), "tukey": _TUKEY, "bisquare": _TUKEY}
