"""Fit: amplitudes of one or several effects by nonlinear least squares on whitened training elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from model.effects import Effect
from tpjb_ident.diagnose.candidates import Candidate
from tpjb_ident.diagnose.forward import Forward, NoEquilibriumError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_STEPS = 12
#: A fit is settled when a step would move every amplitude by less than this share of its standard error.
SETTLED = 0.05
#: Width of the prior of an amplitude, in typical sizes.
PRIOR_WIDTH = 6.0


@dataclass(frozen=True)
class Fit:
    """Effects fitted together.

    Attributes
    ----------
    candidates : tuple of Candidate
    amplitudes : (k,) ndarray
        In the nearly linear forms.
    prediction : (n,) ndarray
        Of all elements, held-out ones too.
    jacobian : (n, k) ndarray
    chi_square : float
        Whitened misfit of the training elements plus the prior's.
    covariance : (k, k) ndarray
        Of the amplitudes.
    at_bound : bool
        Some amplitude has run into a physical bound.
    """

    candidates: tuple[Candidate, ...]
    amplitudes: FloatArray
    prediction: FloatArray = field(repr=False)
    jacobian: FloatArray = field(repr=False)
    chi_square: float
    covariance: FloatArray = field(repr=False)
    at_bound: bool = False

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects at their fitted sizes."""
        return build(self.candidates, self.amplitudes)

    @property
    def label(self) -> str:
        """Names, joined."""
        return " + ".join(c.label for c in self.candidates) or "baseline"


def build(candidates: Sequence[Candidate], amplitudes: FloatArray) -> tuple[Effect, ...]:
    """Effects of candidates at amplitudes."""
    return tuple(c.effect(float(a)) for c, a in zip(candidates, amplitudes, strict=True))


@dataclass(frozen=True)
class Misfit:
    """Whitened residuals of the training elements.

    Attributes
    ----------
    value : (n,) ndarray
    covariance : (n, n) ndarray
        For inference: identification, tolerance, nuisances.
    train : (n,) ndarray of bool
    """

    value: FloatArray
    covariance: FloatArray
    train: BoolArray
    factor: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        part = self.covariance[np.ix_(self.train, self.train)]
        scale = np.sqrt(np.diag(part))
        object.__setattr__(self, "factor", scale[:, None] * np.linalg.cholesky(part / np.outer(scale, scale)))

    def whiten(self, vector: FloatArray) -> FloatArray:
        """L^-1 of the training part of a vector or of columns."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor, vector[self.train], lower=True))

    def chi_square(self, prediction: FloatArray) -> float:
        """Whitened squared misfit of a prediction."""
        return float(np.sum(self.whiten(self.value - prediction) ** 2))


def fit(
    forward: Forward,
    misfit: Misfit,
    chosen: Sequence[Candidate],
    start: FloatArray,
    prediction: FloatArray | None = None,
) -> Fit | None:
    """Fit amplitudes by Levenberg-Marquardt with bounds and a wide prior.

    Parameters
    ----------
    forward : Forward
    misfit : Misfit
    chosen : sequence of Candidate
    start : (k,) ndarray
        First guess.
    prediction : (n,) ndarray, optional
        The model at `start`, if it is at hand.

    Returns
    -------
    Fit or None
        None where the model has no equilibrium near the start.
    """
    neutral = np.array([c.neutral for c in chosen])
    width = np.array([c.step for c in chosen]) * PRIOR_WIDTH
    low, high = np.array([c.bounds for c in chosen]).reshape(-1, 2).T
    now = np.clip(start, low, high)
    try:
        y = forward(build(chosen, now)) if prediction is None else prediction
    except NoEquilibriumError:
        return None
    cost = _cost(misfit, y, now, neutral, width)
    damping = 1e-4
    jacobian = _jacobian(forward, chosen, now, y)
    for _ in range(MAX_STEPS):
        normal, gradient = _normal(misfit, jacobian, y, (now - neutral) / width**2, width)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
        new = np.clip(now + step, low, high)
        settled = np.all(np.abs(new - now) < SETTLED / np.sqrt(np.diag(normal)))
        if settled:
            break
        trial = _try(forward, chosen, new)
        trial_cost = np.inf if trial is None else _cost(misfit, trial, new, neutral, width)
        if trial is None or trial_cost > cost:
            damping = max(10 * damping, 0.1)
            if damping > 1e4:
                break
            continue
        damping = max(0.1 * damping, 1e-6)
        now, y, cost = new, trial, trial_cost
        jacobian = _jacobian(forward, chosen, now, y)
    normal, _ = _normal(misfit, jacobian, y, (now - neutral) / width**2, width)
    inside = (now > low + 1e-9 * np.abs(low)) & (now < high - 1e-9 * np.abs(high))
    return Fit(tuple(chosen), now, y, jacobian, cost, np.asarray(np.linalg.inv(normal)), not bool(np.all(inside)))


def _cost(misfit: Misfit, y: FloatArray, now: FloatArray, neutral: FloatArray, width: FloatArray) -> float:
    return misfit.chi_square(y) + float(np.sum(((now - neutral) / width) ** 2))


def _normal(
    misfit: Misfit, jacobian: FloatArray, y: FloatArray, pull: FloatArray, width: FloatArray
) -> tuple[FloatArray, FloatArray]:
    white = misfit.whiten(jacobian)
    residual = misfit.whiten(misfit.value - y)
    return white.T @ white + np.diag(1.0 / width**2), white.T @ residual - pull


def _try(forward: Forward, chosen: Sequence[Candidate], amplitudes: FloatArray) -> FloatArray | None:
    try:
        return forward(build(chosen, amplitudes))
    except NoEquilibriumError:
        return None


def _jacobian(forward: Forward, chosen: Sequence[Candidate], now: FloatArray, y: FloatArray) -> FloatArray:
    columns = []
    for i, candidate in enumerate(chosen):
        columns.append(slope(forward, chosen, now, y, i, 0.1 * candidate.step))
    return np.column_stack(columns) if columns else np.zeros((len(y), 0))


def slope(
    forward: Forward, chosen: Sequence[Candidate], now: FloatArray, y: FloatArray, index: int, size: float
) -> FloatArray:
    """Change of the prediction per unit of one amplitude, by a one-sided difference that stays inside the bounds.

    A zero column where the model has no equilibrium on either side.
    """
    low, high = chosen[index].bounds
    for signed in (size, -size, 0.1 * size, -0.1 * size):
        moved = now.copy()
        moved[index] = min(max(now[index] + signed, low), high)
        if moved[index] == now[index]:
            continue
        other = _try(forward, chosen, moved)
        if other is not None:
            return (other - y) / (moved[index] - now[index])
    return np.zeros_like(y)
