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
from tpjb_ident.dynamic.broadband.responses import end_columns, place_in_line
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra
from tpjb_ident.dynamic.estimators.r_matrix import complex_to_real_covariance

#: Highest power of frequency, over the bins of a line.
_ORDER = 2
#: Condition number of the motions from which they are along one line.
_ONE_LINE = 1e8


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
    D, F, ends_columns, place = _rows(spectra, bins, ends)
    n = len(D)
    order = 0 if spectra[0].period is not None else _ORDER
    basis = np.linalg.qr(np.concatenate([_sloped(D, place, order), ends_columns], axis=1))[0]
    flat_D, flat_F = (rows - basis @ (basis.conj().T @ rows) for rows in (D, F))
    scale = np.sqrt(np.mean(np.abs(np.concatenate([flat_D, flat_F], axis=1)) ** 2, axis=0))
    freedom = n - basis.shape[1] - 2
    if freedom < 1 or not (scale > 0).all() or not np.linalg.cond(flat_D / scale[:2]) < _ONE_LINE:
        return ClassicLine({}, np.full((8, 8), np.nan), 1.0, np.full(2, np.nan), n)
    inverse = np.linalg.pinv(flat_D)
    h1 = (inverse @ flat_F).T
    remaining = flat_F - flat_D @ h1.T
    noise = remaining.T @ remaining.conj() / freedom
    covariance = complex_to_real_covariance(np.kron(noise, inverse @ inverse.conj().T))
    power = np.sum(np.abs(flat_F) ** 2, axis=0) / max(n - basis.shape[1], 1)
    coherence = np.clip(1 - np.diag(noise).real / power, 0.0, 1.0)
    signal = np.linalg.svd(np.concatenate([flat_D, flat_F], axis=1) / scale, full_matrices=False)[2][:2] * scale
    X = np.concatenate([D, _sloped(D, place, order), ends_columns], axis=1)
    Z = np.concatenate([F, _sloped(F, place, order), ends_columns], axis=1)
    h: dict[str, ComplexArray] = {"h1": h1, "h2": np.asarray(np.linalg.solve(Z.conj().T @ X, Z.conj().T @ F)[:2].T)}
    h["hv"] = np.linalg.solve(signal[:, :2], signal[:, 2:]).T
    return ClassicLine(h, covariance, 2.0 * freedom, coherence, n)


def _sloped(rows: ComplexArray, place: FloatArray, order: int) -> ComplexArray:
    """Rows (n, 2) times powers of their place (n,), (n, 2 order)."""
    powers = [rows * place[:, None] ** power for power in range(1, order + 1)]
    return np.concatenate(powers, axis=1) if powers else np.zeros((len(rows), 0), complex)


def _rows(
    spectra: Sequence[RunSpectra], bins: IntArray, ends: bool
) -> tuple[ComplexArray, ComplexArray, ComplexArray, FloatArray]:
    """Displacement and force of all runs' rows (n, 2), columns of the records' ends (n, k), place in the line (n,)."""
    D = np.concatenate([s.D[:, bins].reshape(-1, 2) for s in spectra])
    F = np.concatenate([s.F[:, bins].reshape(-1, 2) for s in spectra])
    if spectra[0].period is not None:
        return D, F, np.zeros((len(D), 0), complex), np.zeros(len(D))
    place = place_in_line(spectra[0].frequencies[bins])
    columns = end_columns(len(spectra), place, _ORDER)[:, : None if ends else 0]
    return D, F, columns, np.tile(place, len(spectra))
