"""Covariance of H where nothing repeats: residuals are all there is."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray


def complex_to_real_covariance(hermitian: ComplexArray) -> FloatArray:
    """Covariance of [Re h, Im h] from E[e e^H] of circular errors, (2 m, 2 m); `hermitian` (m, m)."""
    real = 0.5 * np.block([[hermitian.real, -hermitian.imag], [hermitian.imag, hermitian.real]])
    return 0.5 * (real + real.T)  # rounding apart, it is symmetric


def homoscedastic(D: ComplexArray, residual: ComplexArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariance (8, 8) and dof (8,) of a weighted regression; `D`, `residual` (n, 2), `weights` (n,)."""
    spare = max(float(weights.sum()) - 2.0, 1e-12)
    scatter = (weights[:, None] * residual).T @ residual.conj() / spare
    inverse = np.linalg.inv((weights[:, None] * D.conj()).T @ D)
    # Two real residuals per spare complex one; both parts of a row share its scale.
    return complex_to_real_covariance(np.kron(scatter, inverse)), np.full(8, max(2.0 * spare, 1.0))
