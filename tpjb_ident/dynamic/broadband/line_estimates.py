"""All estimates of one line, and which of them counts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.dynamic.broadband.classic import coherence, h1_fit, h2_fit, hv_fit
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.local_regression import H_ORDER, local_fit
from tpjb_ident.dynamic.broadband.repeated_periods import periods_fit

#: F ratio from which an excitation tells the displacements from their noise.
STRONG = 10.0
#: Coherence of the force with the displacements that a line needs where nothing else tells signal from noise.
LEAST_COHERENCE = 0.5


@dataclass(frozen=True)
class LineEstimates:
    """What the methods say at one line.

    Attributes
    ----------
    omega : float
        [rad/s]
    method : str
        The one that counts: ``"periods"``, ``"iv"`` or ``"hv"``.
    fits : dict of str to LineFit
        By method, ``"h1"``, ``"h2"`` and ``"hv"`` among them.
    coherence : (2,) ndarray
        Of the force along X and Y with the displacements.
    n_rows : int
    """

    omega: float
    method: str
    fits: dict[str, LineFit] = field(repr=False)
    coherence: FloatArray
    n_rows: int

    @property
    def fit(self) -> LineFit:
        """By the method that counts."""
        return self.fits[self.method]

    @property
    def usable(self) -> bool:
        """Whether the line was excited enough for its interval to hold."""
        fit = self.fit
        if not fit.found:
            return False
        if self.method == "hv":
            return bool(np.nanmin(self.coherence) > LEAST_COHERENCE)
        return fit.strength > STRONG

    @property
    def bracket(self) -> FloatArray:
        """How far H1 or H2 is from the estimate that counts, (8,) [N/m]: truth lies between them."""
        away = [np.abs(_vector(self.fits[name]) - _vector(self.fit)) for name in ("h1", "h2")]
        return np.asarray(np.max(away, axis=0))


def _vector(fit: LineFit) -> FloatArray:
    return np.concatenate([fit.h.real.ravel(), fit.h.imag.ravel()])


def estimate_line(rows: LineRows, classic: bool = True) -> LineEstimates:
    """Estimate h at one line by every method that applies.

    Parameters
    ----------
    rows : LineRows
    classic : bool, optional
        Whether H1, H2 and Hv are wanted beside a better one.
    """
    order = 0 if rows.repeated else H_ORDER
    fits = {}
    if rows.repeated and rows.n_runs > 1:
        fits["periods"] = periods_fit(rows)
    if rows.command is not None:
        fits["iv"] = local_fit(rows, rows.command, order)
    if classic or not fits:
        fits["h1"], fits["h2"] = h1_fit(rows), h2_fit(rows)
        fits["hv"] = hv_fit(rows, fits["h1"])
    method = next(name for name in ("periods", "iv", "hv") if name in fits)
    explained = coherence(rows, fits["h1"]) if "h1" in fits else np.full(2, np.nan)
    return LineEstimates(rows.omega, method, fits, explained, len(rows.D))
