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


def posterior(errors: ErrorModel, linear: Linear) -> Posterior:
    """Evidence and posterior of the free numbers.

    What a step promises that was never solved is no evidence: at the likeliest scale the quadratic form at the solved
    point counts, and the other scales keep their distance to it.
    """
    width = linear.width
    offset = linear.residual + linear.jacobian @ linear.theta
    rotated = errors.basis @ np.column_stack([offset, linear.residual, linear.jacobian * width])
    prior_cost = float(np.sum((linear.theta / width) ** 2))
    count, numbers = len(errors.scales), len(width)
    logs, promised = np.zeros(count), np.zeros(count)
    means, spreads = np.zeros((count, numbers)), np.zeros((count, numbers, numbers))
    for index, shrink in enumerate(errors.shrink):
        white = rotated * shrink[:, None]
        target, at_point, columns = white[:, 0], white[:, 1], white[:, 2:]
        lower = np.linalg.cholesky(columns.T @ columns + np.eye(numbers))
        explained = np.linalg.solve(lower, columns.T @ target)
        inverse = np.linalg.inv(lower)
        means[index] = (inverse.T @ explained) * width
        spreads[index] = (inverse.T @ inverse) * np.outer(width, width)
        square = float(target @ target - explained @ explained)
        promised[index] = 0.5 * (float(at_point @ at_point) + prior_cost - square)
        logs[index] = -0.5 * (square + errors.log_norm[index] + 2.0 * np.log(np.diag(lower)).sum())
    weighted = logs + errors.log_weights
    total = float(logsumexp(weighted))
    weights = np.exp(weighted - total)
    mean = weights @ means
    moved = (means - mean) * np.sqrt(weights)[:, None]
    covariance = np.tensordot(weights, spreads, 1) + moved.T @ moved
    scale = float(np.exp(weights @ np.log(errors.scales)))
    return Posterior(total - float(promised[int(np.argmax(weights))]), weights, mean, covariance, scale, total)
