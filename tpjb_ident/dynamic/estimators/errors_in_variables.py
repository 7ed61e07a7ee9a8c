"""Maximum-likelihood errors-in-variables fit of F = H D, noise covariance taken from the repeats.

Displacements are noisy, and every regression of F on X is pulled towards zero by that. With repeats
of each direction the noise of (Fx, Fy, X, Y) is known from the data themselves: direction means
and their pooled 4x4 covariance give a generalised total-least-squares problem with a closed
solution (Gleser 1981), refined for direction effects by solving its score equation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from tpjb_ident.dynamic.estimators.r_matrix import PhasorTable
from tpjb_ident.dynamic.estimators.uncertainty import (
    DirectionMeans,
    VarianceByDirection,
    direction_covariances,
    direction_effect,
    information,
    pooled_effect,
    spread_of,
)
from tpjb_ident.estimate.robust_constants import trimming_limits, trimming_weight
from tpjb_ident.estimate.window_means import aligned
from tpjb_ident.phasors.line_means import complex_median

#: Fewer spare repeats than this cannot give a 4x4 complex covariance worth using.
_MIN_SPARE_REPEATS = 8.0
#: A direction with less than this share of its windows accepted counts as rejected.
_REJECTED = 0.2
#: Share of its windows that must agree with one another for it to be a candidate.
_AGREEING = 0.6
#: How improbable its distance must be for the rejection to stand.
_SIGNIFICANCE = 1e-4
_MIN_OTHERS = 4


@dataclass(frozen=True)
class Repeats:
    """Direction means and the noise of a single window, from good windows only."""

    means: DirectionMeans
    noise: ComplexArray  #: (4, 4) complex: covariance of one window's (X, Y, Fx, Fy) about its direction
    spare: float
    weights: FloatArray  #: (n,): final window weights
    wandering: int = 0


@dataclass(frozen=True)
class EivFit:
    """Result of the fit in the table's scale."""

    h: ComplexArray  #: (2, 2) complex
    covariance: FloatArray  #: (8, 8)
    dof: FloatArray  #: (8,)
    chi_square: float
    attenuation: FloatArray  #: (2,)


def repeats(table: PhasorTable, weights: FloatArray, rounds: int = 2) -> Repeats | None:
    """Average each direction's good windows and pool their noise; `weights` (n,)."""
    good = (weights > 0.2).astype(float)
    z, wandering = aligned(np.concatenate([table.D, table.F], axis=1), table.direction, good)
    state = _pooled(z, table, good, 1.0)
    lower, upper, shrinkage = trimming_limits(8)
    for _ in range(rounds):
        if state is None:
            return None
        mean, noise, _ = state
        deviation = z - mean[table.direction]
        solved = np.linalg.solve(noise, deviation.T)
        u2 = 2.0 * np.einsum("na,an->n", deviation.conj(), solved).real
        size = np.bincount(table.direction, weights=good, minlength=len(mean))[table.direction]
        # A window inside its own mean lies closer to it by (1 - 1/n).
        inside = np.where(good > 0, 1 - 1 / np.maximum(size, 2.0), 1 + 1 / np.maximum(size, 1.0))
        good = np.where(size > 0, trimming_weight(u2 / inside, lower, upper), 0.0)
        state = _pooled(z, table, good, shrinkage)
    if state is None:
        return None
    mean, noise, spare = state
    count = np.bincount(table.direction, weights=good, minlength=len(mean)).astype(float)
    used = count >= 0.5
    return Repeats(DirectionMeans(mean[used, :2], mean[used, 2:], count[used]), noise, spare, good, wandering)


def _pooled(
    z: ComplexArray, table: PhasorTable, weights: FloatArray, shrinkage: float
) -> tuple[ComplexArray, ComplexArray, float] | None:
    """Weighted direction means, pooled covariance, spare count; None when too few."""
    g = table.n_directions
    one_hot = np.zeros((g, len(z)))
    one_hot[table.direction, np.arange(len(z))] = weights
    count = one_hot.sum(axis=1)
    mean = one_hot @ z / np.maximum(count, 1e-12)[:, None]
    spare = float(np.maximum(count - 1, 0.0).sum())
    if spare < _MIN_SPARE_REPEATS or (count > 0.5).sum() < 2:
        return None
    deviation = z - mean[table.direction]
    noise = (weights[:, None] * deviation).T @ deviation.conj() / (spare * shrinkage)
    # Exact data leave no noise at all, or none but what F = H D lets through; a floor far below any instrument
    # keeps the algebra alive.
    noise = noise + (1e-24 + 1e-12 * float(np.trace(noise).real)) * np.eye(4)
    return mean, noise, spare


def eiv_fit(repeats: Repeats, directions_differ: bool = False) -> EivFit:
    """Errors-in-variables fit of the direction means with their direction effects."""
    means, noise = repeats.means, repeats.noise
    h = _closed_form(means, noise)
    window_noise = _residual_noise(h, noise)
    T, chi_square = direction_effect(means.F - means.D @ h.T, means, window_noise)
    D_true = means.D
    if np.any(T):
        h, D_true = _score_iteration(h, means, noise, T)
        window_noise = _residual_noise(h, noise)
    else:
        D_true = _true_displacement(h, means, noise, T)
    V = direction_covariances(means, window_noise, T)
    inverse = np.asarray(np.linalg.inv(V), dtype=complex)
    fisher = information(D_true, D_true, inverse)
    bread = np.linalg.inv(fisher)
    small = window_noise / means.count[:, None, None]
    meat = information(D_true, D_true, inverse @ small @ inverse)
    residual = means.F - means.D @ h.T
    score = np.einsum("gac,gc,gb->gab", inverse, residual, D_true.conj()).reshape(-1, 4)
    parts = np.einsum("gac,gb,gd->gabcd", inverse, D_true.conj(), D_true).reshape(-1, 4, 4)
    pooled = pooled_effect(residual, means) if len(means) > 2 else None
    repeat = bread @ meat @ bread.conj().T
    shares = VarianceByDirection(score, parts, repeat, 2 * repeats.spare, pooled)
    covariance, dof = spread_of(shares, chi_square, directions_differ)
    return EivFit(h, covariance, dof, chi_square, attenuation(means.D, means.count, noise[:2, :2]))


def attenuation(D: ComplexArray, count: FloatArray, noise: ComplexArray) -> FloatArray:
    """Noise power over total power of the displacements D (g, 2) along their principal directions, larger first."""
    total = count.sum()
    power = (count[:, None] * D).T @ D.conj() / total + noise * (1 - len(D) / total)
    return np.sort(np.linalg.eigvals(np.linalg.solve(power, noise)).real)[::-1]


def _closed_form(means: DirectionMeans, noise: ComplexArray) -> ComplexArray:
    """Signal subspace of the whitened direction means: H = Z_F Z_D^-1."""
    root = np.linalg.cholesky(noise)
    z = np.concatenate([means.D, means.F], axis=1)
    white = np.linalg.solve(root, (np.sqrt(means.count)[:, None] * z).T)
    U = np.linalg.svd(white, full_matrices=False)[0][:, :2]
    signal = root @ U
    h: ComplexArray = np.linalg.solve(signal[:2].T, signal[2:].T).T
    return h


def _residual_noise(h: ComplexArray, noise: ComplexArray) -> ComplexArray:
    """Covariance of one window's F - h D."""
    A = np.concatenate([-h, np.eye(2)], axis=1)
    return np.asarray(A @ noise @ A.conj().T)


def _true_displacement(h: ComplexArray, means: DirectionMeans, noise: ComplexArray, T: ComplexArray) -> ComplexArray:
    """Best estimate of the noise-free displacement: measured minus what the residual says of its error."""
    A = np.concatenate([-h, np.eye(2)], axis=1)
    cross = noise[:2] @ A.conj().T
    V = direction_covariances(means, A @ noise @ A.conj().T, T)
    residual = means.F - means.D @ h.T
    solved = np.linalg.solve(V, residual[:, :, None])[:, :, 0]
    return means.D - (solved @ cross.T) / means.count[:, None]


def _score_iteration(
    h: ComplexArray, means: DirectionMeans, noise: ComplexArray, T: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Solve sum_g V_g^-1 (F_g - H D_g) D*_g^H = 0 with D* and V following H."""
    D_true = means.D
    for _ in range(50):
        D_true = _true_displacement(h, means, noise, T)
        inverse = np.asarray(np.linalg.inv(direction_covariances(means, _residual_noise(h, noise), T)), dtype=complex)
        remaining = information(means.D, D_true, inverse)
        moment = np.einsum("gac,gb,gc->ab", inverse, D_true.conj(), means.F).reshape(4)
        h_new = np.asarray(np.linalg.solve(remaining, moment), dtype=complex).reshape(2, 2)
        change = np.abs(h_new - h).max() / np.abs(h).max()
        h = h_new
        if change < 1e-12:
            break
    return h, D_true


def windows_used_again(table: PhasorTable, weights: FloatArray) -> FloatArray:
    """Window weights with consistent directions taken back; `weights` (n,).

    Runs differ a little from one another (their static load does), by more than the noise inside a run. A robust joint
    fit over few runs can then take two or three of them for the truth and reject a sound run with all its windows. A
    run whose windows agree with one another is taken back unless it lies further from what the other runs predict than
    their own disagreement explains. With fewer than four others nobody can say which run is wrong: then all count, and
    the interval shows the discord.
    """
    size = np.bincount(table.direction, minlength=table.n_directions)
    share = np.bincount(table.direction, weights=weights > 0.2, minlength=table.n_directions) / size
    doubtful = np.flatnonzero((share < _REJECTED) & (size >= 3))
    if not len(doubtful):
        return weights
    remaining = repeats(table, np.where(np.isin(table.direction, doubtful), 0.0, weights))
    if remaining is None:
        return weights
    few = len(remaining.means) < _MIN_OTHERS
    result = weights.copy()
    for direction in doubtful:
        core = _agreeing(table, int(direction), remaining)
        if core.sum() >= _AGREEING * size[direction] and (few or _explained(table, core, remaining)):
            result[core] = 1.0
    return result


def _agreeing(table: PhasorTable, direction: int, others: Repeats) -> BoolArray:
    """Windows of a direction that lie together within the noise of the other directions."""
    selected = table.direction == direction
    z = np.concatenate([table.D, table.F], axis=1)
    deviation = z - complex_median(z[selected])
    u2 = 2.0 * np.einsum("na,an->n", deviation.conj(), np.linalg.solve(others.noise, deviation.T)).real
    return np.asarray(selected & (u2 <= 2.0 * trimming_limits(8)[1]))


def _explained(table: PhasorTable, core: BoolArray, remaining: Repeats) -> bool:
    """Whether the others' own disagreement explains how far this direction is off."""
    fit = eiv_fit(remaining)
    residual = table.F[core].mean(axis=0) - fit.h @ table.D[core].mean(axis=0)
    A = np.concatenate([-fit.h, np.eye(2)], axis=1)
    noise = A @ remaining.noise @ A.conj().T
    count = min(float(core.sum()), float(np.mean(remaining.means.count)))
    # The others' chi-square scales the noise to what runs really differ by; 2 for predicting afresh.
    spread = 2.0 * max(fit.chi_square, 1.0) * noise / count
    distance = float((residual.conj() @ np.linalg.solve(spread, residual)).real) / 2.0
    spare = 4.0 * (len(remaining.means) - 2)
    return distance <= float(fdtri(4, spare, 1.0 - _SIGNIFICANCE))
