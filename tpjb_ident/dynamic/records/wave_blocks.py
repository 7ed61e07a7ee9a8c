"""Projections on sinusoids over long windows, block by block.

exp(i omega (t_b + tau)) = exp(i omega t_b) exp(i omega tau): over a short block every window of an even grid sees the
same few waves in tau, turned by one factor per block. The waves of one block stay in a core's first cache, where
those of a long window do not, which makes projection and synthesis several times quicker.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.spectral_lines.windows import line_design

#: Samples of a block.
BLOCK = 256


class WaveBlocks:
    """The columns of `line_design` on an even grid, with a linear drift.

    Parameters
    ----------
    length : int
        Samples per window.
    rate : float
        [Hz].
    frequencies : (m,) ndarray
        [Hz].
    """

    def __init__(self, length: int, rate: float, frequencies: FloatArray) -> None:
        self.full = length // BLOCK
        self.rest = length - self.full * BLOCK
        tau = np.arange(BLOCK) / rate
        # line_design's own columns in tau; its drift columns are replaced by 1 and tau
        self._waves = line_design(tau, frequencies, 1)
        self._waves[:, -1] = tau
        self._rows = np.ascontiguousarray(self._waves.T)
        starts = np.arange(self.full + (self.rest > 0)) * BLOCK / rate
        self._turn: ComplexArray = np.exp(2j * np.pi * np.multiply.outer(starts, frequencies))
        half = 0.5 * (length - 1) / rate
        self._place, self._slope = (starts - half) / half, 1 / half

    def project(self, rows: FloatArray) -> FloatArray:
        """Inner products with every column, (k, length) -> (k, 2 m + 2).

        Parameters
        ----------
        rows : (k, length) ndarray
        """
        parts = np.empty((len(rows), len(self._turn), self._waves.shape[1]))
        main = rows[:, : self.full * BLOCK].reshape(len(rows), self.full, BLOCK)
        np.matmul(main, self._waves, out=parts[:, : self.full])
        if self.rest:
            parts[:, self.full] = rows[:, self.full * BLOCK :] @ self._waves[: self.rest]
        sums = np.empty((len(rows), parts.shape[2]))
        lines = np.einsum("kbm,bm->km", parts[:, :, 0:-2:2] + 1j * parts[:, :, 1:-2:2], self._turn.conj())
        sums[:, 0:-2:2], sums[:, 1:-2:2] = lines.real, lines.imag
        sums[:, -2] = parts[:, :, -2].sum(axis=1)
        sums[:, -1] = parts[:, :, -2] @ self._place + parts[:, :, -1].sum(axis=1) * self._slope
        return sums

    def subtract(self, rows: FloatArray, coefficients: FloatArray) -> None:
        """Take the sum of all columns, times their (k, 2 m + 2) coefficients, off (k, length) rows in place.

        Parameters
        ----------
        rows : (k, length) ndarray
            Changed in place.
        coefficients : (k, 2 m + 2) ndarray
            As of `line_design`.
        """
        lines = (coefficients[:, 0:-2:2] + 1j * coefficients[:, 1:-2:2])[:, None, :] * self._turn
        local = np.empty((len(rows), len(self._turn), self._waves.shape[1]))
        local[:, :, 0:-2:2], local[:, :, 1:-2:2] = lines.real, lines.imag
        local[:, :, -2] = coefficients[:, None, -2] + coefficients[:, None, -1] * self._place
        local[:, :, -1] = coefficients[:, None, -1] * self._slope
        main = rows[:, : self.full * BLOCK].reshape(len(rows), self.full, BLOCK)
        main -= local[:, : self.full] @ self._rows
        if self.rest:
            rows[:, self.full * BLOCK :] -= local[:, self.full] @ self._rows[:, : self.rest]
