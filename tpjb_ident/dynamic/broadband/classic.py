"""What analysers make of a line's rows: H1, H2, Hv and the coherence, beside the estimate that counts.

H1 = S_FD S_DD^-1 holds where only the force is noisy, H2 = S_FF S_DF^-1 where only the displacement is, Hv (total least
squares, every channel in units of its own size) where both are alike. Bendat and Piersol, Random Data, 4th ed. 2010,
chapter 9; Rocklin, Crowley and Vold 1985 for Hv. Slope and curvature of h over the bins, and what the ends of the
records leak, are taken off first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra

#: Highest power of frequency, over the bins of a line.
_ORDER = 2


@dataclass(frozen=True)
class ClassicLine:
    """One line by the methods of analysers."""

    h: dict[str, ComplexArray]  #: (2, 2) by method, N/m; none where the rows do not tell it
    covariance: FloatArray  #: (8, 8), N^2/m^2: that of H1
    freedom: float  #: real degrees of freedom of the noise
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int


def classic_line(spectra: Sequence[RunSpectra], bins: IntArray, ends: bool) -> ClassicLine:
    """H1, H2, Hv and coherence over all rows of a line: periods, or bins."""
    D, F, nuisance = _rows(spectra, bins, ends)
    n, spent = len(D), nuisance.shape[1]
    total = n - (spent - 2 * _ORDER if spent else 0)
    basis = np.linalg.qr(nuisance)[0]
    D, F = (rows - basis @ (basis.conj().T @ rows) for rows in (D, F))
    scale = np.sqrt(np.mean(np.abs(np.concatenate([D, F], axis=1)) ** 2, axis=0))
    freedom = n - spent - 2
    if freedom < 1 or not (scale > 0).all() or not np.linalg.cond(D / scale[:2]) < 1e8:
        return ClassicLine({}, np.full((8, 8), np.nan), 1.0, np.full(2, np.nan), n)
    inverse = np.linalg.pinv(D)
    h1 = (inverse @ F).T
    remaining = F - D @ h1.T
    noise = remaining.T @ remaining.conj() / freedom
    covariance = real_covariance(np.kron(noise, inverse @ inverse.conj().T))
    power = np.sum(np.abs(F) ** 2, axis=0) / max(total - 2 * _ORDER, 1)
    coherence = np.clip(1 - np.diag(noise).real / power, 0.0, 1.0)
    signal = np.linalg.svd(np.concatenate([D, F], axis=1) / scale, full_matrices=False)[2][:2] * scale
    h = {"h1": h1, "h2": np.linalg.solve(F.conj().T @ D, F.conj().T @ F).T}
    h["hv"] = np.linalg.solve(signal[:, :2], signal[:, 2:]).T
    return ClassicLine(h, covariance, 2.0 * freedom, coherence, n)


def _rows(spectra: Sequence[RunSpectra], bins: IntArray, ends: bool) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Displacement and force of all runs' rows (n, 2), and columns of what is to be taken off them (n, k)."""
    D = np.concatenate([s.D[:, bins].reshape(-1, 2) for s in spectra])
    F = np.concatenate([s.F[:, bins].reshape(-1, 2) for s in spectra])
    if spectra[0].period is not None:
        return D, F, np.zeros((len(D), 0), complex)
    place = spectra[0].frequencies[bins] - spectra[0].frequencies[bins].mean()
    place = place / np.abs(place).max()
    columns = [D * np.tile(place, len(spectra))[:, None] ** power for power in range(1, _ORDER + 1)]
    for r in range(len(spectra) if ends else 0):
        own = np.zeros((len(spectra), len(bins), _ORDER + 1), complex)
        own[r] = place[:, None] ** np.arange(_ORDER + 1)
        columns.append(own.reshape(-1, _ORDER + 1))
    return D, F, np.concatenate(columns, axis=1)


def real_covariance(gamma: ComplexArray) -> FloatArray:
    """Covariance of real and imaginary parts, (2 m, 2 m), of circular complex errors (m, m)."""
    half = 0.5 * gamma
    return np.block([[half.real, -half.imag], [half.imag, half.real]])
