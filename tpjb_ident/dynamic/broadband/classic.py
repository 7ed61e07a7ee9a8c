"""H1, H2 and Hv of one line, as analysers give them, from averaged spectra with two inputs and two outputs.

S_FD is the sum of F D^H over the rows. H1 = S_FD S_DD^-1 holds where only the force is noisy, H2 = S_FF S_DF^-1 where
only the displacement is, Hv (total least squares, every channel in units of its own size) where both are alike.
Bendat and Piersol, Random Data, 4th ed. 2010, chapter 9; Rocklin, Crowley and Vold 1985 for Hv.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.local_regression import local_fit, without_slopes


def h1_fit(rows: LineRows) -> LineFit:
    """Least squares of force on displacement: noise on the displacement pulls it towards zero.

    Parameters
    ----------
    rows : LineRows
    """
    return local_fit(rows, order=_order(rows))


def h2_fit(rows: LineRows) -> LineFit:
    """The force as instrument: noise on the force pushes it away from zero.

    Parameters
    ----------
    rows : LineRows
    """
    return local_fit(rows, rows.F, order=_order(rows))


def hv_fit(rows: LineRows, first: LineFit) -> LineFit:
    """Total least squares, with the leverage and noise of H1 behind its interval.

    Parameters
    ----------
    rows : LineRows
    first : LineFit
        H1 of these rows.
    """
    if not first.found:
        return first
    flat = without_slopes(rows, first)
    z = np.concatenate([flat.D, flat.F], axis=1)
    scale = np.sqrt(np.mean(np.abs(z) ** 2, axis=0))
    signal = np.linalg.svd(z / scale, full_matrices=False)[2][:2] * scale
    h = np.linalg.solve(signal[:, :2], signal[:, 2:]).T
    return replace(first, h=h)


def coherence(rows: LineRows, fit: LineFit) -> FloatArray:
    """Multiple coherence of the force along X and Y with the displacements, (2,), free of the few rows' bias.

    Parameters
    ----------
    rows : LineRows
    fit : LineFit
        Any of these rows, for how h changes over them.
    """
    flat = without_slopes(rows, fit)
    basis = np.linalg.qr(flat.D)[0]
    left = flat.F - basis @ (basis.conj().T @ flat.F)
    n, spent = len(rows.D), _spent(rows)
    power = np.mean(np.abs(flat.F) ** 2, axis=0) * n / max(n - spent, 1)
    noise = np.sum(np.abs(left) ** 2, axis=0) / max(n - spent - 2, 1)
    with np.errstate(invalid="ignore", divide="ignore"):  # no force at all has no coherence
        return np.asarray(np.clip(1 - noise / power, 0.0, 1.0))


def spectra(rows: LineRows) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """S_FF, S_FD and S_DD summed over the rows, (2, 2) each.

    Parameters
    ----------
    rows : LineRows
    """
    D, F = rows.D, rows.F
    return (
        np.einsum("ni,nk->ik", F, F.conj()),
        np.einsum("ni,nk->ik", F, D.conj()),
        np.einsum("ni,nk->ik", D, D.conj()),
    )


def _order(rows: LineRows) -> int:
    return 0 if rows.repeated else 2


def _spent(rows: LineRows) -> int:
    return 3 * rows.n_runs if rows.ends else 0
