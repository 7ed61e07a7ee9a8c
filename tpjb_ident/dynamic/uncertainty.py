"""From residuals to the 8x8 covariance of H and its degrees of freedom.

Two sources of random error are told apart. *Repeat noise*: windows of one direction scatter about
their mean. *Direction effects*: the means of the directions scatter about F = H D by more than
their repeats explain (the static load misses its set point differently in every run, mains sits on
the line); they do not average out within a run, and intervals that leave them out do not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.dynamic.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.phasor_table import PhasorTable


@dataclass(frozen=True)
class DirectionMeans:
    """What the directions say, each averaged over its good windows.

    Attributes
    ----------
    D, F : (g, 2) complex ndarray
    count : (g,) ndarray
        Effective number of windows behind each.
    """

    D: ComplexArray
    F: ComplexArray
    count: FloatArray

    def __len__(self) -> int:
        return len(self.count)


def complex_to_real_covariance(hermitian: ComplexArray, pseudo: ComplexArray | None = None) -> FloatArray:
    """Covariance of [Re h, Im h] from E[e e^H] and E[e e^T].

    Parameters
    ----------
    hermitian : (m, m) complex ndarray
    pseudo : (m, m) complex ndarray, optional
        Zero for circular errors.

    Returns
    -------
    (2 m, 2 m) ndarray
    """
    P = np.zeros_like(hermitian) if pseudo is None else pseudo
    real = 0.5 * np.block(
        [
            [(hermitian + P).real, (P - hermitian).imag],
            [(P + hermitian).imag, (hermitian - P).real],
        ]
    )
    return 0.5 * (real + real.T)  # rounding apart, it is symmetric


def information(D: ComplexArray, D_star: ComplexArray, inverse: ComplexArray) -> ComplexArray:
    """Sum over directions of V_g^-1 (x) conj(D*_g) D_g^T, for h ordered xx, xy, yx, yy.

    Parameters
    ----------
    D, D_star : (g, 2) complex ndarray
        Regressors and (for errors in variables) their estimated true values.
    inverse : (g, 2, 2) complex ndarray
        V_g^-1.
    """
    return np.einsum("gac,gb,gd->abcd", inverse, D_star.conj(), D).reshape(4, 4)


def direction_effect(residual: ComplexArray, means: DirectionMeans, noise: ComplexArray) -> tuple[ComplexArray, float]:
    """Between-direction covariance per unit |D|^2, by moments, never negative.

    Parameters
    ----------
    residual : (g, 2) complex ndarray
        F - H D of the direction means, H from a fit weighted by `count`.
    means : DirectionMeans
    noise : (2, 2) complex ndarray
        Covariance of one window's F - H D.

    Returns
    -------
    T : (2, 2) complex ndarray
        The residual of direction g has covariance noise / count_g + T |D_g|^2.
    chi_square : float
        Reduced chi-square of the residuals against repeat noise alone; NaN without spare directions.
    """
    g = len(means)
    if g <= 2:
        return np.zeros((2, 2), dtype=complex), np.nan
    moment = (means.count[:, None] * residual).T @ residual.conj()
    gram = (means.count[:, None] * means.D.conj()).T @ means.D
    leverage = means.count * np.einsum("ga,ab,gb->g", means.D, np.linalg.inv(gram), means.D.conj()).real
    power = np.einsum("ga,ga->g", means.D, means.D.conj()).real
    gain = float(((1 - leverage) * means.count * power).sum())
    # In coordinates where the repeat noise is the unit matrix, truncation keeps the axes' freedom.
    root = np.linalg.cholesky(noise)
    inverse_root = np.linalg.inv(root)
    white = inverse_root @ moment @ inverse_root.conj().T
    chi_square = float(np.trace(white).real / (2 * (g - 2)))
    values, vectors = np.linalg.eigh(white - (g - 2) * np.eye(2))
    T_white = (vectors * np.maximum(values, 0.0)) @ vectors.conj().T / gain
    return root @ T_white @ root.conj().T, chi_square


def direction_covariances(means: DirectionMeans, noise: ComplexArray, T: ComplexArray) -> ComplexArray:
    """V_g = noise / count_g + T |D_g|^2, shape (g, 2, 2)."""
    power = np.einsum("ga,ga->g", means.D, means.D.conj()).real
    return noise / means.count[:, None, None] + T * power[:, None, None]


def mixed_dof(total: FloatArray, repeat: FloatArray, dof_repeat: float, dof_between: float) -> FloatArray:
    """Welch-Satterthwaite degrees of freedom of variances made of two parts.

    Parameters
    ----------
    total, repeat : (8,) ndarray
        Whole variance, and what repeat noise alone would give.
    dof_repeat, dof_between : float
        Degrees of freedom behind either part.
    """
    between = np.maximum(total - repeat, 0.0)
    spread = repeat**2 / max(dof_repeat, 1.0) + between**2 / max(dof_between, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        dof = total**2 / spread
    return np.where(np.isfinite(dof), np.maximum(dof, 1.0), max(dof_repeat, 1.0))


def homoscedastic(
    D: ComplexArray, residual: ComplexArray, weights: FloatArray, correction: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Covariance and dof of a (weighted) regression without repeats: residuals are all there is.

    Parameters
    ----------
    D, residual : (n, 2) complex ndarray
    weights : (n,) ndarray
        Robust weights; their sum is the effective number of windows.
    correction : float
        Factor on the variance (efficiency of the estimator).

    Returns
    -------
    (8, 8) ndarray, (8,) ndarray
    """
    spare = max(float(weights.sum()) - 2.0, 1e-12)
    scatter = (weights[:, None] * residual).T @ residual.conj() / spare
    inverse = np.linalg.inv((weights[:, None] * D.conj()).T @ D)
    hermitian = correction * np.kron(scatter, inverse)
    # Two real residuals per spare complex one; both parts of a row share its scale.
    return complex_to_real_covariance(hermitian), np.full(8, max(2.0 * spare, 1.0))


def with_repeats(
    table: PhasorTable, h: ComplexArray, weights: FloatArray, correction: float = 1.0
) -> tuple[FloatArray, FloatArray, float] | None:
    """Covariance, dof and chi-square of a weighted regression whose directions have repeats.

    Parameters
    ----------
    table : PhasorTable
    h : (2, 2) complex ndarray
    weights : (n,) ndarray
    correction : float
        Factor on the repeat noise (efficiency of the estimator).

    Returns
    -------
    tuple or None
        None when there are fewer than four spare repeats: the residuals alone must do then.
    """
    g = table.n_directions
    one_hot = np.zeros((g, len(table)))
    one_hot[table.direction, np.arange(len(table))] = weights
    count = one_hot.sum(axis=1)
    kept = count > 1e-6
    residual = table.F - table.D @ h.T
    mean = one_hot @ np.concatenate([table.D, table.F, residual], axis=1) / np.maximum(count, 1e-12)[:, None]
    deviation = residual - mean[table.direction, 4:]
    spare = float(np.maximum(count - 1, 0).sum())
    noise = (weights[:, None] * deviation).T @ deviation.conj() / max(spare, 1e-12)
    if spare < 4.0 or np.linalg.eigvalsh(noise)[0] <= 0:
        return None
    means = DirectionMeans(mean[kept, :2], mean[kept, 2:4], count[kept])
    T, chi_square = direction_effect(mean[kept, 4:], means, noise)
    V = direction_covariances(means, correction * noise, T)
    identity = np.broadcast_to(np.eye(2, dtype=complex), (len(means), 2, 2))
    bread = np.linalg.inv(
        information(
            table.D * np.sqrt(weights)[:, None],
            table.D * np.sqrt(weights)[:, None],
            np.broadcast_to(np.eye(2, dtype=complex), (len(table), 2, 2)),
        )
    )
    scaled = means.D * means.count[:, None]
    covariance = complex_to_real_covariance(bread @ information(scaled, scaled, V) @ bread.conj().T)
    small = correction * identity @ noise / means.count[:, None, None]
    repeat_only = np.diag(complex_to_real_covariance(bread @ information(scaled, scaled, small) @ bread.conj().T))
    dof = mixed_dof(np.diag(covariance), repeat_only, 2 * spare, max(2.0 * (len(means) - 2), 1.0))
    return covariance, dof, chi_square
