"""statsmodels' robust linear model on the stacked real rows of Eq. (15): the paper's choice.

Every identification solves Huber's and Tukey's norms with the MAD scale, and the import of statsmodels would make it
1.2 times as long: there, where its covariance is not asked for, these two are reweighted here, equal to statsmodels to
the last bit. Else statsmodels itself is run.

Kept as a reference with its traps guarded: complex input is refused (statsmodels takes it and returns false standard
errors), the system is scaled before (``conv="coefs"`` has an absolute tolerance and never ends in SI units), and
reaching the iteration limit is reported (statsmodels says nothing). What cannot be guarded: Re and Im of a row get
weights of their own, and the M-estimator has no breakdown against bad displacements. `mm` exists for that.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.near_names import unknown_name
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.errors import ArgumentError, TpjbError
from tpjb_ident.estimate.statistics import bisquare_weight, huber_weight, reweighted
from tpjb_ident.estimators.r_matrix import TableFit, real_rows

#: Names of the norms and the statsmodels class behind each.
NORMS = {
    "huber": "HuberT",
    "tukey": "TukeyBiweight",
    "bisquare": "TukeyBiweight",
    "hampel": "Hampel",
    "andrew": "AndrewWave",
    "ramsay": "RamsayE",
    "trimmed": "TrimmedMean",
    "quartic": "TukeyQuartic",
    "student": "StudentT",
    "mquantile": "MQuantileNorm",
    "least-squares": "LeastSquares",
}
#: Weight and threshold in scales, statsmodels' own, of the norms that are solved without it.
_QUICK = {"huber": (huber_weight, 1.345), "tukey": (bisquare_weight, 4.685), "bisquare": (bisquare_weight, 4.685)}


@dataclass(frozen=True)
class RlmSolution:
    """One real robust regression: what statsmodels' ``RLM(...).fit(conv="coefs")`` tells of it."""

    params: FloatArray  #: (p,)
    weights: FloatArray  #: (m,)
    scale: float
    iterations: int
    covariance: FloatArray | float = np.nan  #: (p, p): H1, scaled; NaN where it is not asked for
    conditions: tuple[Condition, ...] = ()


class ComplexInputError(TpjbError, TypeError):
    """Complex numbers given to a solver of real systems."""


@dataclass(frozen=True)
class RlmSettings:
    """How statsmodels is to be run."""

    norm: str = "huber"
    scale: Any = "mad"  #: as `RLM.fit` takes it
    max_iterations: int = 200
    tolerance: float = 1e-10
    quick: bool = False  #: whether its covariance is not asked for


def solve_rlm(design: FloatArray, response: FloatArray, settings: RlmSettings | None = None) -> RlmSolution:
    """Run statsmodels' RLM on a real system, guarded; `design` (m, p), `response` (m,)."""
    settings = settings or RlmSettings()
    if np.iscomplexobj(design) or np.iscomplexobj(response):
        raise ComplexInputError(
            "RLM solves real systems; complex data would come back with false standard errors. "
            "Stack real and imaginary parts first (tpjb_ident.estimators.r_matrix.real_rows)"
        )
    if settings.quick and settings.norm in _QUICK and settings.scale == "mad":
        weight, threshold = _QUICK[settings.norm]
        tolerance, most = settings.tolerance, settings.max_iterations
        fit = RlmSolution(*reweighted(design, response, lambda u: weight(u, threshold), None, tolerance, most))
    else:
        fit = _statsmodels(design, response, settings)
    stopped, exact = fit.iterations >= settings.max_iterations, "more than half of the rows fit exactly"
    is_exact = not fit.scale > 1e-14 * float(np.abs(response).max(initial=0.0))
    conditions = holding(
        (stopped, "iteration-limit", f"RLM stopped after {fit.iterations} iterations"),
        (is_exact, "zero-scale", f"{exact}; no standard errors exist"),
    )
    return replace(fit, conditions=conditions)


def _statsmodels(design: FloatArray, response: FloatArray, settings: RlmSettings) -> RlmSolution:
    from statsmodels.robust import norms
    from statsmodels.robust.robust_linear_model import RLM

    if settings.norm not in NORMS:
        raise ArgumentError(unknown_name("norm", settings.norm, NORMS))
    extra: dict[str, Callable[[], Any]] = {
        "student": lambda: norms.StudentT(c=1.0, df=4.0),
        "mquantile": lambda: norms.MQuantileNorm(0.5, norms.HuberT()),  # the symmetric one, which estimates H
    }
    norm = extra.get(settings.norm, getattr(norms, NORMS[settings.norm]))()
    fit = RLM(response, design, M=norm).fit(
        maxiter=settings.max_iterations, tol=settings.tolerance, conv="coefs", scale_est=settings.scale
    )
    params, weights, covariance = (np.asarray(values) for values in (fit.params, fit.weights, fit.bcov_scaled))
    return RlmSolution(params, weights, float(fit.scale), int(fit.fit_history["iteration"]), covariance)


def rlm_fit(D: ComplexArray, F: ComplexArray, settings: RlmSettings | None = None) -> TableFit:
    """Solve Eq. (15) axis by axis with statsmodels; `D`, `F` (n, 2)."""
    n = len(D)
    h = np.zeros((2, 2), dtype=complex)
    covariance = np.zeros((8, 8))
    weights = np.ones((n, 2))
    conditions: tuple[Condition, ...] = ()
    for axis in range(2):
        design, response = real_rows(D, F[:, axis])
        solution = solve_rlm(design, response, settings)
        h[axis] = solution.params[:2] + 1j * solution.params[2:]
        rows = np.array([2 * axis, 2 * axis + 1, 4 + 2 * axis, 5 + 2 * axis])
        covariance[np.ix_(rows, rows)] = solution.covariance
        weights[:, axis] = np.minimum(solution.weights[:n], solution.weights[n:])
        conditions += solution.conditions
    return TableFit(h, weights, covariance, np.full(8, max(2.0 * n - 4.0, 1.0)), conditions)
