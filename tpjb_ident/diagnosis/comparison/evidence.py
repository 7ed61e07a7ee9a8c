"""Evidence of an explanation: Gaussian and linear about where it was solved, summed over the model error's scale.

    y = f(theta_0) + J (theta - theta_0) + e,   theta ~ N(0, D),   e ~ N(0, S + s^2 M)

S from identification, M the stated model tolerance, s one scale for all of it, half-Cauchy about what is stated
(Gelman, Bayesian Analysis 1 (2006) 515). Everything in units of `total_sigma`, theta counted from its priors' means.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import logsumexp

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.observations.constants import Deciding


class ErrorModel:
    """S + s^2 M at every scale, decomposed once: its inverse is B' diag(shrink^2) B."""

    def __init__(self, noise: FloatArray, model: FloatArray, at: FloatArray | None = None) -> None:
        lowest, step, count = Deciding.scales
        scales = np.asarray(lowest * step ** np.arange(count) if at is None else at, dtype=float)
        self.noise, self.model, self.scales = noise, model, scales
        weights = np.log(scales / (1.0 + scales**2))
        self.log_weights: FloatArray = weights - logsumexp(weights)  #: (scales,)
        lower = cholesky(noise, lower=True)
        inverse = solve_triangular(lower, np.eye(len(noise)), lower=True)
        rotated = inverse @ model @ inverse.T
        sizes, axes = np.linalg.eigh(0.5 * (rotated + rotated.T))
        self.basis: FloatArray = axes.T @ inverse  #: (n, n)
        self.shrink: FloatArray = 1.0 / np.sqrt(1.0 + np.outer(scales**2, np.maximum(sizes, 0.0)))  #: (scales, n)
        log_det = 2.0 * np.log(np.diag(lower)).sum() - 2.0 * np.log(self.shrink).sum(axis=1)
        self.log_norm: FloatArray = log_det + len(noise) * math.log(2.0 * math.pi)  #: (scales,)

    def covariance(self, index: int) -> FloatArray:
        """S + s^2 M at a scale's index, (n, n)."""
        return self.noise + self.scales[index] ** 2 * self.model

    @property
    def coarse(self) -> ErrorModel:
        """Every element off by itself, by its own sigma."""
        return ErrorModel(self.noise + np.eye(len(self.noise)), 0.0 * self.model, np.ones(1))

    def white(self, vectors: FloatArray, index: int) -> FloatArray:
        """Vectors in units of the standard deviation at a scale, decorrelated."""
        shrink = self.shrink[index]
        return np.asarray((self.basis @ vectors) * (shrink if vectors.ndim == 1 else shrink[:, None]))


@dataclass(frozen=True)
class Posterior:
    """What the observations say of the free numbers of a model."""

    total: float  #: log p(y | model) [nats]
    weights: FloatArray = field(repr=False)  #: (scales,)
    mean: FloatArray = field(repr=False)  #: (k,): mixed over the scales
    covariance: FloatArray = field(repr=False)  #: (k, k)
    scale: float  #: of the model's error, the posterior mean of its logarithm
    promised: float  #: `total` with what the next step promises

    @property
    def refused(self) -> float:
        """What the next step promises and no solved point kept, where a fit has ended: it counts for none beside."""
        return self.promised - self.total

    @property
    def leading(self) -> int:
        """Index of the likeliest scale."""
        return int(np.argmax(self.weights))


@dataclass(frozen=True)
class Linear:
    """A model, linear about where it was solved."""

    residual: FloatArray = field(repr=False)  #: (n,): observed - predicted there
    theta: FloatArray = field(repr=False)  #: (k,)
    jacobian: FloatArray = field(repr=False)  #: (n, k)
    width: FloatArray = field(repr=False)  #: (k,): standard deviations of the priors


@dataclass(frozen=True)
class Levels:
    """Columns beside a model at every scale of the model's error, the model's own numbers integrated out."""

    errors: ErrorModel
    rotated: FloatArray  #: (n, c)
    lower: FloatArray  #: (scales, k, k): Cholesky factors of the numbers' inverse covariance, in prior widths
    shared: FloatArray  #: (scales, k, c)

    @classmethod
    def of(cls, errors: ErrorModel, linear: Linear, columns: FloatArray) -> Levels:
        """The model's residual where nothing is off comes first, then what is `beside` it, (n, c - 1)."""
        scaled = errors.basis @ (linear.jacobian * linear.width)
        offset = linear.residual + linear.jacobian @ linear.theta
        rotated = errors.basis @ np.column_stack([offset, columns])
        weighted = np.swapaxes(scaled[None] * errors.shrink[:, :, None] ** 2, 1, 2)
        lower = np.asarray(np.linalg.cholesky(weighted @ scaled + np.eye(scaled.shape[1])), float)
        return cls(errors, rotated, lower, np.linalg.solve(lower, weighted @ rotated))

    @property
    def half_det(self) -> FloatArray:
        """Half the logarithm of the numbers' inverse covariance's determinant, (scales,)."""
        return np.asarray(np.log(np.diagonal(self.lower, axis1=1, axis2=2)).sum(axis=1))

    def product(self, columns: slice) -> FloatArray:
        """Products of some columns with each other, the residual first among them, (scales, 1 + c, 1 + c)."""
        chosen = [0, *range(columns.start, columns.stop)]
        part, shared = self.rotated[:, chosen], self.shared[:, :, chosen]
        weighted = np.swapaxes(part[None] * self.errors.shrink[:, :, None] ** 2, 1, 2)
        return np.asarray(weighted @ part - np.swapaxes(shared, 1, 2) @ shared)

    def mean(self, level: int, at: slice, weights: FloatArray) -> FloatArray:
        """The model's own numbers beside columns with some weights, in prior widths, (k,)."""
        shared = self.shared[level]
        return np.asarray(np.linalg.solve(self.lower[level].T, shared[:, 0] - shared[:, at] @ weights))


def posterior(errors: ErrorModel, linear: Linear) -> Posterior:
    """Evidence and posterior of the free numbers.

    What a step promises that was never solved is no evidence: at the likeliest scale the quadratic form at the solved
    point counts, and the other scales keep their distance to it.
    """
    width = linear.width
    levels = Levels.of(errors, linear, linear.residual)
    square = levels.product(slice(1, 1))[:, 0, 0]
    solved = errors.shrink**2 @ levels.rotated[:, 1] ** 2 + np.sum((linear.theta / width) ** 2)
    weighted = -0.5 * (square + errors.log_norm) - levels.half_det + errors.log_weights
    total = float(logsumexp(weighted))
    weights = np.exp(weighted - total)
    inverse = np.linalg.inv(levels.lower)
    means = np.einsum("lji,lj->li", inverse, levels.shared[:, :, 0]) * width
    mean = weights @ means
    moved = (means - mean) * np.sqrt(weights)[:, None]
    spread = np.tensordot(weights, np.swapaxes(inverse, 1, 2) @ inverse, 1)
    covariance = spread * np.outer(width, width) + moved.T @ moved
    scale = float(np.exp(weights @ np.log(errors.scales)))
    promised = 0.5 * float((solved - square)[int(np.argmax(weights))])
    return Posterior(total - promised, weights, mean, covariance, scale, total)
