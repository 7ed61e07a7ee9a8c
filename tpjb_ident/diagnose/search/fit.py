"""Fit: amplitudes of one or several effects by nonlinear least squares on whitened training elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from model.effects import Effect
from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import ForwardModel, NoEquilibriumError

MAX_STEPS = 12
#: A fit is settled when a step would move every amplitude by less than this share of its standard error.
SETTLED = 0.1
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

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(c.name for c in self.candidates)


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


@dataclass(frozen=True)
class Start:
    """Where a fit begins.

    Attributes
    ----------
    amplitudes : (k,) ndarray
    columns : (n, k) ndarray
        Derivatives that are known from nearby; steps correct them.
    """

    amplitudes: FloatArray
    columns: FloatArray = field(repr=False)


@dataclass(frozen=True)
class _Prior:
    neutral: FloatArray
    width: FloatArray
    low: FloatArray
    high: FloatArray

    def cost(self, now: FloatArray) -> float:
        return float(np.sum(((now - self.neutral) / self.width) ** 2))


def fit(forward: ForwardModel, misfit: Misfit, chosen: Sequence[Candidate], start: Start) -> Fit | None:
    """Fit amplitudes by Levenberg-Marquardt with bounds and a wide prior.

    The derivatives at hand are corrected along every step (Broyden, Math. Comp. 19 (1965) 577): a step costs one run
    of the model however many effects there are.

    Parameters
    ----------
    forward : ForwardModel
    misfit : Misfit
    chosen : sequence of Candidate
    start : Start

    Returns
    -------
    Fit or None
        None where the model has no equilibrium near the start.
    """
    low, high = np.array([c.bounds for c in chosen]).reshape(-1, 2).T
    prior = _Prior(
        np.array([c.neutral for c in chosen]), np.array([c.step for c in chosen]) * PRIOR_WIDTH, low, high
    )  # fmt: skip
    now = np.clip(start.amplitudes, low, high)
    y = attempt(forward, chosen, now)
    if y is None:
        return None
    cost = misfit.chi_square(y) + prior.cost(now)
    damping = 1e-4
    jacobian = start.columns.copy()
    renewed = False
    for _ in range(MAX_STEPS):
        new = _proposed(misfit, prior, now, y, jacobian, damping)
        spread = _spread(misfit, prior, jacobian)
        if np.all(np.abs(new - now) < SETTLED * spread):
            break
        trial = attempt(forward, chosen, new)
        trial_cost = np.inf if trial is None else misfit.chi_square(trial) + prior.cost(new)
        if trial is not None:
            jacobian = _corrected(jacobian, trial - y, new - now, prior.width)
        if trial is None or trial_cost > cost:
            damping = max(10 * damping, 0.1)
            if damping > 1e3:
                if renewed:
                    break
                # the corrected derivatives have led nowhere: take real ones, once
                jacobian, damping, renewed = derivatives(forward, chosen, now, y), 1e-4, True
            continue
        damping = max(0.1 * damping, 1e-6)
        now, y, cost = new, trial, trial_cost
    return _result(misfit, prior, chosen, now, y, jacobian, cost)


def settle(forward: ForwardModel, misfit: Misfit, found: Fit) -> Fit:
    """Give a fit real derivatives at its place, for intervals and further searches."""
    jacobian = derivatives(forward, found.candidates, found.amplitudes, found.prediction)
    better = fit(forward, misfit, found.candidates, Start(found.amplitudes, jacobian))
    return better if better is not None and better.chi_square <= found.chi_square + 0.1 else found


def _result(  # type: ignore[no-untyped-def]
    misfit: Misfit, prior: _Prior, chosen: Sequence[Candidate], now: FloatArray, y: FloatArray, jacobian, cost: float
) -> Fit:
    white = misfit.whiten(jacobian)
    covariance = np.linalg.inv(white.T @ white + np.diag(1.0 / prior.width**2))
    inside = (now > prior.low + 1e-9 * np.abs(prior.low)) & (now < prior.high - 1e-9 * np.abs(prior.high))
    return Fit(tuple(chosen), now, y, jacobian, cost, np.asarray(covariance), not bool(np.all(inside)))


def _proposed(  # type: ignore[no-untyped-def]
    misfit: Misfit, prior: _Prior, now: FloatArray, y: FloatArray, jacobian: FloatArray, damping: float
):
    white = misfit.whiten(jacobian)
    normal = white.T @ white + np.diag(1.0 / prior.width**2)
    gradient = white.T @ misfit.whiten(misfit.value - y) - (now - prior.neutral) / prior.width**2
    step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
    return np.clip(now + step, prior.low, prior.high)


def _spread(misfit: Misfit, prior: _Prior, jacobian: FloatArray) -> FloatArray:
    white = misfit.whiten(jacobian)
    return np.asarray(1.0 / np.sqrt(np.sum(white**2, axis=0) + 1.0 / prior.width**2))


def _corrected(jacobian: FloatArray, change: FloatArray, step: FloatArray, width: FloatArray) -> FloatArray:
    """Broyden's update, amplitudes measured in their prior widths."""
    scaled = step / width
    length = float(scaled @ scaled)
    if length < 1e-20:
        return jacobian
    return np.asarray(jacobian + np.outer(change - jacobian @ step, scaled / length) / width)


def attempt(forward: ForwardModel, chosen: Sequence[Candidate], amplitudes: FloatArray) -> FloatArray | None:
    """Predict; None where the model has no equilibrium."""
    try:
        return forward(build(chosen, amplitudes))
    except NoEquilibriumError:
        return None


def derivatives(forward: ForwardModel, chosen: Sequence[Candidate], now: FloatArray, y: FloatArray) -> FloatArray:
    """Change of the prediction per unit of every amplitude, (n, k)."""
    columns = [slope(forward, chosen, now, y, i, 0.1 * c.step) for i, c in enumerate(chosen)]
    return np.column_stack(columns) if columns else np.zeros((len(y), 0))


def slope(
    forward: ForwardModel, chosen: Sequence[Candidate], now: FloatArray, y: FloatArray, index: int, size: float
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
        other = attempt(forward, chosen, moved)
        if other is not None:
            return (other - y) / (moved[index] - now[index])
    return np.zeros_like(y)
