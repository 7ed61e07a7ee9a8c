"""From residuals to the 8x8 covariance of H and its degrees of freedom.

Two sources of random error are told apart. *Repeat noise*: windows of one direction scatter about
their mean. *Direction effects*: the means of the directions scatter about F = H D by more than
their repeats explain (the static load misses its set point differently in every run, mains sits on
the line); they do not average out within a run, and intervals that leave them out do not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.estimators.r_matrix import PhasorTable
from tpjb_ident.estimate.scatter import mixed_dof

#: Up to so many directions their effects are pooled over directions and axes: a jackknife of three or four is none.
_FEW_DIRECTIONS = 5
#: Degrees of freedom per spare direction of the pooled variance: effects are real gains as a rule, not circular noise.
_POOLED_DOF = 3.0


@dataclass(frozen=True)
class DirectionMeans:
    """What the directions say, each averaged over its good windows."""

    D: ComplexArray  #: `D`, `F` (g, 2) complex
    F: ComplexArray
    count: FloatArray  #: (g,): effective number of windows behind each

    def __len__(self) -> int:
        return len(self.count)


def complex_to_real_covariance(hermitian: ComplexArray) -> FloatArray:
    """Covariance of [Re h, Im h] from E[e e^H] of circular errors, (2 m, 2 m); `hermitian` (m, m)."""
    real = 0.5 * np.block([[hermitian.real, -hermitian.imag], [hermitian.imag, hermitian.real]])
    return 0.5 * (real + real.T)  # rounding apart, it is symmetric


def information(D: ComplexArray, D_star: ComplexArray, inverse: ComplexArray) -> ComplexArray:
    """Sum over directions of V_g^-1 (x) conj(D*_g) D_g^T, for h ordered xx, xy, yx, yy.

    `D`, `D_star` (g, 2), `inverse` (g, 2, 2).
    """
    return np.einsum("gac,gb,gd->abcd", inverse, D_star.conj(), D).reshape(4, 4)


def direction_chi_square(residual: ComplexArray, means: DirectionMeans, noise: ComplexArray) -> float:
    """Reduced chi-square of the directions' residuals (g, 2) against the repeats' own `noise` (2, 2)."""
    spare = len(means) - 2
    if spare <= 0:
        return np.nan
    moment = (means.count[:, None] * residual).T @ residual.conj()
    return float(np.trace(np.linalg.solve(noise, moment)).real) / (2 * spare)


@dataclass(frozen=True)
class VarianceByDirection:
    """What every direction contributes to the estimating equations of h, and what their repeats say."""

    score: ComplexArray  #: (g, 4) complex: to the equations
    parts: ComplexArray  #: (g, 4, 4) complex: to their matrix
    repeat: ComplexArray  #: (4, 4) complex
    dof_repeat: float
    pooled: FloatArray | None = None  #: (8, 8)


def spread_of(shares: VarianceByDirection, chi_square: float) -> tuple[FloatArray, FloatArray]:
    """Repeat noise as known, plus what leaving out one direction at a time shows beyond it.

    A direction effect is no circular noise: a static load that is off changes K and hardly C, one entry
    more than another. So its share is not modelled but taken from the directions themselves
    (delete-one jackknife, i.e. cluster-robust with its small-sample correction), as far as the
    chi-square of the direction means says that there is any.

    Gives covariance (8, 8) and dof (8,).
    """
    score, parts, pooled, dof_repeat = shares.score, shares.parts, shares.pooled, shares.dof_repeat
    repeat_noise = _positive(complex_to_real_covariance(shares.repeat))
    g = len(score)
    spare = 4.0 * (g - 2)
    if g <= 2 or not chi_square > 1.0:
        return repeat_noise, np.full(8, max(dof_repeat, 1.0))
    limit = 2.0 * gammaincinv(spare / 2, 0.95) / spare
    certain = min(1.0, (chi_square - 1.0) / (limit - 1.0))
    moved = np.linalg.solve(parts.sum(axis=0) - parts, score[:, :, None])[:, :, 0]
    moved = np.concatenate([moved.real, moved.imag], axis=1)
    jackknife = (g - 1) / g * moved.T @ moved
    if pooled is not None and g <= _FEW_DIRECTIONS:
        # an effect that strikes one entry alone shows in the jackknife, and is spread over all in the pooled variance
        stretch = np.sqrt(np.maximum(np.diag(jackknife) / np.diag(pooled), 1.0))
        total = repeat_noise + certain * pooled * np.outer(stretch, stretch)
        between = np.full(8, _POOLED_DOF * (g - 2))
        return total, mixed_dof(np.diag(total), np.diag(repeat_noise), dof_repeat, between)
    # Beyond repeat noise, in coordinates where that is the unit matrix; never negative.
    root = np.linalg.cholesky(repeat_noise)
    white = np.linalg.solve(root, np.linalg.solve(root, jackknife).T)
    values, vectors = np.linalg.eigh(0.5 * (white + white.T))
    extra = root @ (vectors * (certain * np.maximum(values - 1.0, 0.0))) @ vectors.T @ root.T
    total = repeat_noise + extra
    effective = np.maximum((moved**2).sum(axis=0) ** 2 / (moved**4).sum(axis=0) - 1.0, 1.0)
    dof = mixed_dof(np.diag(total), np.diag(repeat_noise), dof_repeat, np.maximum(effective, 0.5 * (g - 1)))
    return 0.5 * (total + total.T), dof


def _positive(covariance: FloatArray) -> FloatArray:
    """A covariance without what rounding makes of it where directions contradict one another a million times."""
    values, vectors = np.linalg.eigh(covariance)
    least = 1e-9 * float(np.abs(values).max())
    if values[0] >= least:
        return covariance
    return np.asarray((vectors * np.maximum(values, least)) @ vectors.T)


def pooled_effect(residual: ComplexArray, means: DirectionMeans) -> FloatArray:
    """Covariance of H from one relative variance of the directions' residuals, pooled over directions and axes.

    `residual` (g, 2).
    """
    power = np.einsum("ga,ga->g", means.F, means.F.conj()).real
    share = float((np.abs(residual) ** 2 / power[:, None]).sum() / (2 * (len(means) - 2)))
    weighted = means.D.conj() * means.count[:, None]
    inverse = np.linalg.inv(weighted.T @ means.D)
    spread = (weighted * power[:, None]).T @ weighted.conj()
    return complex_to_real_covariance(np.kron(np.eye(2), share * inverse @ spread @ inverse.conj().T))


def homoscedastic(
    D: ComplexArray, residual: ComplexArray, weights: FloatArray, correction: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Covariance and dof of a (weighted) regression without repeats: residuals are all there is.

    `D`, `residual` (n, 2), `weights` (n,), gives (8, 8) and (8,).
    """
    spare = max(float(weights.sum()) - 2.0, 1e-12)
    scatter = (weights[:, None] * residual).T @ residual.conj() / spare
    inverse = np.linalg.inv((weights[:, None] * D.conj()).T @ D)
    hermitian = np.asarray(correction * np.kron(scatter, inverse), dtype=complex)
    # Two real residuals per spare complex one; both parts of a row share its scale.
    return complex_to_real_covariance(hermitian), np.full(8, max(2.0 * spare, 1.0))


def with_repeats(
    table: PhasorTable, h: ComplexArray, weights: FloatArray, correction: float = 1.0
) -> tuple[FloatArray, FloatArray, float] | None:
    """Covariance, dof and chi-square of a weighted regression whose directions have repeats."""
    g = table.n_directions
    one_hot = np.zeros((g, len(table)))
    one_hot[table.direction, np.arange(len(table))] = weights
    count = one_hot.sum(axis=1)
    used = count > 1e-6
    residual = table.F - table.D @ h.T
    mean = one_hot @ np.concatenate([table.D, table.F, residual], axis=1) / np.maximum(count, 1e-12)[:, None]
    deviation = residual - mean[table.direction, 4:]
    spare = float(np.maximum(count - 1, 0).sum())
    noise = (weights[:, None] * deviation).T @ deviation.conj() / max(spare, 1e-12)
    if spare < 4.0 or np.linalg.eigvalsh(noise)[0] <= 0:
        return None
    means = DirectionMeans(mean[used, :2], mean[used, 2:4], count[used])
    chi_square = direction_chi_square(mean[used, 4:], means, noise)
    scaled = means.D * means.count[:, None]
    parts = _regression_parts(table, weights)
    bread = np.linalg.inv(parts.sum(axis=0))
    small = correction * noise / means.count[:, None, None]
    meat = information(scaled, scaled, np.broadcast_to(small, (len(means), 2, 2)))
    score = np.einsum("ga,gb->gab", mean[used, 4:] * means.count[:, None], means.D.conj()).reshape(-1, 4)
    pooled = pooled_effect(mean[used, 4:], means) if used.sum() > 2 else None
    shares = VarianceByDirection(score, parts[used], bread @ meat @ bread.conj().T, 2 * spare, pooled)
    return (*spread_of(shares, chi_square), chi_square)


def _regression_parts(table: PhasorTable, weights: FloatArray) -> ComplexArray:
    """Normal matrix of a weighted regression, direction by direction, shape (g, 4, 4)."""
    gram = np.zeros((table.n_directions, 2, 2), dtype=complex)
    products = weights[:, None, None] * table.D[:, :, None].conj() * table.D[:, None, :]
    np.add.at(gram, table.direction, products)
    return np.asarray(np.kron(np.eye(2), gram))
