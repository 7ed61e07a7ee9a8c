"""Models over frequency: K-C (h = K + i omega C) and K-C-M (h = K - omega^2 M + i omega C).

Generalised least squares over the excitation frequencies of one load, with the 8x8 covariance of every
point; chi-square says which model the data support. A tilting-pad bearing owes neither: its pads are
dynamic, and when K-C-M is refused too the raw H is the answer.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import FloatArray
from rigdata.near_names import unknown_name
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.results.point_result import PointResult, by_static_point
from tpjb_ident.errors import ArgumentError

#: A model is refused below this probability of its chi-square.
REFUSED = 0.01
#: Draws of a chi-square with measured covariances, and their seed; above so many degrees of freedom one is known.
_DRAWN, _LARGE_DOF = (4000, 5), 1e4
_MODELS = {"K-C": 8, "K-C-M": 12}


@dataclass(frozen=True)
class FrequencyFit:
    """One model over the frequencies of one load."""

    model: str
    K: FloatArray  #: (2, 2), N/m
    C: FloatArray  #: (2, 2), N s/m
    M: FloatArray  #: (2, 2), kg
    covariance: FloatArray = field(repr=False)  #: (p, p)
    chi_square: float
    dof: int
    n_frequencies: int
    omega_range: tuple[float, float]
    misfit: float
    noise_dof: tuple[float, ...] = ()

    @property
    def probability(self) -> float:
        """Probability of a chi-square this large if the model were true; NaN without spare data."""
        return chance_of(self.chi_square, self.dof, self.noise_dof) if self.dof > 0 else float("nan")

    @property
    def refused(self) -> bool:
        """Whether the data refuse the model."""
        return self.dof > 0 and self.probability < REFUSED

    @property
    def standard_error(self) -> FloatArray:
        """Of the parameters; inflated by the root of the reduced chi-square where that exceeds one."""
        inflation = max(1.0, self.chi_square / self.dof) if self.dof > 0 else 1.0
        return np.sqrt(np.diag(self.covariance) * inflation)

    def h(self, omega: float | FloatArray) -> np.ndarray:
        """Dynamic stiffness of the model, (2, 2) or (n, 2, 2) complex [N/m]; `omega` (n,) [rad/s]."""
        w = np.asarray(omega, dtype=float)[..., None, None]
        return np.asarray(self.K - w**2 * self.M + 1j * w * self.C)


def chance_of(chi_square: float, dof: int, noise_dof: tuple[float, ...]) -> float:
    """Probability of a larger chi-square whose covariances are themselves measured, point by point.

    A covariance from few repeats is too small as often as too large, and where it is too small its share of the
    chi-square is huge. Each share is a chi-square over a mean square of its own; the sum is drawn, with a fixed seed.
    A 2x2 complex covariance of nu degrees of freedom, inverted, is too large by nu / (nu - 4) on average: as a single
    variance of nu / 2 is.
    """
    plain = float(chdtrc(dof, chi_square)) if dof > 0 else np.nan
    finite = np.array([nu for nu in noise_dof if np.isfinite(nu) and nu < _LARGE_DOF])
    if not len(finite) or plain > 0.5:
        return plain
    rng = np.random.default_rng(_DRAWN[1])
    each = dof / len(noise_dof)
    total = np.zeros(_DRAWN[0])
    for nu in noise_dof:
        share = rng.chisquare(each, _DRAWN[0])
        half = max(nu / 2, 1.0)
        total += share / (rng.chisquare(half, _DRAWN[0]) / half) if nu < _LARGE_DOF else share
    above = float((total >= chi_square).mean())
    return max(above, plain)


def fit_over_frequency(estimates: list[DynamicStiffness], model: str) -> FrequencyFit:
    """Fit one model to the dynamic stiffnesses of one load."""
    if model not in _MODELS:
        raise ArgumentError(unknown_name("model", model, _MODELS))
    usable = [e for e in estimates if np.isfinite(e.h).all() and np.isfinite(e.covariance).all()]
    omegas = np.array([e.omega for e in usable])
    needed = 1 if model == "K-C" else 2
    if len(np.unique(omegas)) < needed:
        raise ArgumentError(f"{model} needs {needed} frequencies with an answer, got {len(np.unique(omegas))}")
    # Natural scales keep the normal equations well conditioned: N/m, per omega, per omega^2.
    middle = float(np.sqrt(omegas.min() * omegas.max()))
    size = float(np.mean([np.abs(e.h).max() for e in usable]))
    normal, moment, total = np.zeros((_MODELS[model],) * 2), np.zeros(_MODELS[model]), 0.0
    for est in usable:
        design = _design(est.omega / middle, model)
        y = est.vector / size
        inverse = np.linalg.inv(est.covariance / size**2)
        normal += design.T @ inverse @ design
        moment += design.T @ inverse @ y
        total += float(y @ inverse @ y)
    x = np.linalg.solve(normal, moment)
    chi_square = max(total - float(x @ moment), 0.0)
    scale = size * np.repeat([1.0, 1 / middle, 1 / middle**2][: len(x) // 4], 4)
    parameters = (x * scale).reshape(-1, 2, 2)
    mass = parameters[2] if model == "K-C-M" else np.zeros((2, 2))
    modelled = [parameters[0] - e.omega**2 * mass + 1j * e.omega * parameters[1] for e in usable]
    misfit = max(float(np.linalg.norm(m - e.h) / np.linalg.norm(e.h)) for m, e in zip(modelled, usable))
    return FrequencyFit(
        model,
        parameters[0],
        parameters[1],
        mass,
        np.linalg.inv(normal) * np.outer(scale, scale),
        chi_square,
        8 * len(usable) - len(x),
        len(usable),
        (float(omegas.min()), float(omegas.max())),
        misfit,
        tuple(float(np.median(e.dof)) for e in usable),
    )


def _design(omega: float, model: str) -> FloatArray:
    """Rows Re h, Im h; columns K, C (and M) entry by entry."""
    eye, zero = np.eye(4), np.zeros((4, 4))
    rows = [[eye, zero], [zero, omega * eye]]
    if model == "K-C-M":
        rows[0].append(-(omega**2) * eye)
        rows[1].append(zero)
    return np.block(rows)


@dataclass(frozen=True)
class LoadFits:
    """All models of one load, direction and speed."""

    points: tuple[PointResult, ...] = field(repr=False)
    fits: dict[str, FrequencyFit]
    supported: str


def fits_per_load(points: tuple[PointResult, ...]) -> list[LoadFits]:
    """Fit every load that was run at two excitation frequencies or more.

    Points with mains on the excitation line take part: their intervals say what they are worth.
    """
    result = []
    for members in by_static_point(points):
        estimates = [p.stiffness for p in members]
        if len({round(e.omega, 6) for e in estimates}) < 2:
            continue
        fits = {model: fit_over_frequency(estimates, model) for model in _MODELS}
        accepted = [name for name, fit in fits.items() if fit.dof > 0 and not fit.refused]
        result.append(LoadFits(tuple(members), fits, accepted[0] if accepted else "raw H"))
    return result
