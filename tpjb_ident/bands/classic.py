"""What analysers make of a line's rows: H1, H2, Hv and the coherence, beside the estimate that counts.

H1 = S_FD S_DD^-1 holds where only the force is noisy, H2 = S_FF S_DF^-1 where only the displacement is, Hv (total least
squares, every channel in units of its own size) where both are alike. Bendat and Piersol, Random Data, 4th ed. 2010,
chapter 9; Rocklin, Crowley and Vold 1985 for Hv. The slope of h over the bins of a group, and what the ends of the
records leak, are taken off first, as they are from the responses that count.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.responses import nuisance, orthogonal
from tpjb_ident.bands.run_spectra import RunSpectra

#: Condition number of the motions' power from which they are along one line.
_ONE_LINE = 1e12


@dataclass(frozen=True)
class ClassicLine:
    """One line by the methods of analysers."""

    h: dict[str, ComplexArray]  #: (2, 2) by method, N/m; none where the rows do not tell it
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int


def classic_line(spectra: Sequence[RunSpectra], bins: IntArray, ends: bool) -> ClassicLine:
    """H1, H2, Hv and coherence over all rows of a line: periods, or bins."""
    rows, used = _rows(spectra, bins, ends)
    S, n, freedom = rows.T @ rows.conj(), len(rows), len(rows) - used - 2
    size = np.sqrt(np.diag(S).real)
    if freedom < 1 or not (size > 0).all() or not np.linalg.cond(S[:2, :2] / np.outer(size, size)[:2, :2]) < _ONE_LINE:
        return ClassicLine({}, np.full(2, np.nan), n)
    h1, h2 = S[2:, :2] @ np.linalg.inv(S[:2, :2]), S[2:, 2:] @ np.linalg.inv(S[:2, 2:])
    signal = np.linalg.eigh(S / np.outer(size, size))[1][:, 2:] * size[:, None]
    noise = (freedom + 2) / freedom * np.diag(S[2:, 2:] - h1 @ S[:2, 2:]).real
    h = {"h1": h1, "h2": h2, "hv": signal[2:] @ np.linalg.inv(signal[:2])}
    return ClassicLine(h, np.clip(1 - noise / size[2:] ** 2, 0.0, 1.0), n)


def _rows(spectra: Sequence[RunSpectra], bins: IntArray, ends: bool) -> tuple[ComplexArray, int]:
    """Displacement and force of all runs' rows (n, 4) without slope and leakage, and how many columns that took."""
    rows = np.concatenate([np.concatenate([s.D[:, bins], s.F[:, bins]], axis=2).reshape(-1, 4) for s in spectra])
    if spectra[0].period is not None:
        return rows, 0
    basis = np.linalg.qr(nuisance(spectra, bins, rows[:, :2], ends))[0]
    return orthogonal(rows, basis), basis.shape[1]
