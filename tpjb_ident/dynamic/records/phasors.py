"""Phasors of the excitation lines, window by window, by a joint least-squares fit of all known lines.

Convention: a channel is Re{ z exp(+i omega t) } with t = 0 at the start of the run, so that windows
of one run are repeats of one phasor as long as the drive is locked to the recorder's clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.records.line_fit import GLITCH_LIMIT, SCALE_LIMIT, beside, fit_without_glitches
from tpjb_ident.dynamic.records.windows import line_design

#: Outlying samples up to this share are told by leaving them out, again and again, until fit and verdict agree.
_FEW = 0.1
_FEW_ROUNDS = 8
#: Samples of a block.
BLOCK = 256


class WaveBlocks:
    """The columns of `line_design` on an even grid, with a linear drift.

    exp(i omega (t_b + tau)) = exp(i omega t_b) exp(i omega tau): over a short block every window of an even grid sees
    the same few waves in tau, turned by one factor per block. The waves of one block stay in a core's first cache,
    where those of a long window do not, which makes projection and synthesis several times quicker.
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
        """Inner products with every column, (k, length) -> (k, 2 m + 2)."""
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
        """Take the sum of all columns, times their (k, 2 m + 2) coefficients, off (k, length) rows in place."""
        lines = (coefficients[:, 0:-2:2] + 1j * coefficients[:, 1:-2:2])[:, None, :] * self._turn
        local = np.empty((len(rows), len(self._turn), self._waves.shape[1]))
        local[:, :, 0:-2:2], local[:, :, 1:-2:2] = lines.real, lines.imag
        local[:, :, -2] = coefficients[:, None, -2] + coefficients[:, None, -1] * self._place
        local[:, :, -1] = coefficients[:, None, -1] * self._slope
        main = rows[:, : self.full * BLOCK].reshape(len(rows), self.full, BLOCK)
        main -= local[:, : self.full] @ self._rows
        if self.rest:
            rows[:, self.full * BLOCK :] -= local[:, self.full] @ self._rows[:, : self.rest]


@dataclass(frozen=True)
class PhasorBlock:
    """Phasors of one vector quantity in some windows of one run."""

    phasors: ComplexArray  #: (n_windows, n_lines, 2) complex: X and Y at every line, SI; NaN where a window gave none
    mean: FloatArray  #: (n_windows, 2): mean of the quantity, SI
    noise: FloatArray  #: (n_windows, 2): robust standard deviation of what the lines leave
    lost: FloatArray  #: (n_windows,): share of the samples left out (glitches, missing values)


class LineFitter:
    """Joint fit of lines on equal windows of an even grid: one pseudo-inverse for all of them."""

    def __init__(self, length: int, rate: float, frequencies: FloatArray) -> None:
        self.length, self.rate = length, rate
        self.frequencies = np.asarray(frequencies, dtype=float)
        self.design = line_design(np.arange(length) / rate, self.frequencies)
        # Lines that a window tells apart leave a well-conditioned Gram matrix; its size is a dozen.
        self._gram_inverse = np.linalg.pinv(self.design.T @ self.design, rcond=1e-12, hermitian=True)
        self._blocks = WaveBlocks(length, rate, self.frequencies) if length >= 2 * BLOCK else None
        # The scale of the residual needs no more than a few hundred samples.
        self._stride = max(1, length // 512)

    def fit(self, rows: FloatArray, start: FloatArray, usual: FloatArray | None = None) -> PhasorBlock:
        """Fit windows of a vector record; `rows` (2, n_windows, length), `start` (n_windows,), `usual` (2,)."""
        n = rows.shape[1]
        stack = rows.reshape(2 * n, self.length)
        offset = _mean_of_present(stack[:, :: self._stride])
        residual = stack - offset
        coefficients = self._solve_and_subtract(residual)
        size = np.abs(coefficients).sum(axis=1)
        largest = _by_window(_largest(residual))
        scale = _by_window(1.4826 * np.median(np.abs(residual[:, :: self._stride]), axis=1))
        usual = usual_scale(scale) if usual is None else usual
        # A long glitch pulls the whole fit and hides in the window's own scale: the run's tells.
        # A NaN in the window makes both comparisons false: refit those too.
        # (The rounding of a noise-free record is no glitch either.)
        rounding = 1e-10 * _by_window(size)
        clean = (largest <= np.maximum(GLITCH_LIMIT * scale, rounding)) & (
            scale <= np.maximum(SCALE_LIMIT * usual, rounding)
        )
        clean = np.asarray(clean.all(axis=1))
        lost = np.zeros(n)
        coefficients = coefficients.reshape(2, n, -1).transpose(1, 0, 2).copy()
        offset = _by_window(offset[:, 0])
        for i in np.flatnonzero(~clean):
            pair = rows[:, i].T - offset[i]
            quick = self._without_few(residual.reshape(2, n, -1)[:, i], coefficients[i], scale[i], usual)
            coefficients[i], scale[i], lost[i] = _refit(self.design, pair, usual) if quick is None else quick
        mean = coefficients[:, :, 2 * len(self.frequencies)] + offset
        return PhasorBlock(self._phasors(coefficients, start), mean, scale, lost)

    def _solve_and_subtract(self, rows: FloatArray) -> FloatArray:
        """Coefficients of every row, (k, n_columns); the rows become residuals."""
        if self._blocks is None:
            coefficients = (rows @ self.design) @ self._gram_inverse
            rows -= coefficients @ self.design.T
        else:
            coefficients = self._blocks.project(rows) @ self._gram_inverse
            self._blocks.subtract(rows, coefficients)
        return coefficients

    def _without_few(
        self, residual: FloatArray, coefficients: FloatArray, scale: FloatArray, usual: FloatArray
    ) -> tuple[FloatArray, FloatArray, float] | None:
        """Leave the few outlying samples out of a long window's fit until no verdict changes; None where it cannot.

        Their rows are taken off the normal equations: no need to go through all samples again.

        `residual` (2, length), `coefficients` (2, n_columns), `scale`, `usual` (2,), gives (2, n_columns) and (2,).
        """
        if self._blocks is None or not (scale <= SCALE_LIMIT * usual).all():
            return None
        gram = np.linalg.inv(self._gram_inverse)
        size, solution, left_out = np.abs(residual), coefficients, None
        for _ in range(_FEW_ROUNDS):
            previous, left_out = left_out, beside(size > GLITCH_LIMIT * scale[:, None])
            if previous is not None and np.array_equal(previous, left_out):
                return solution, scale, len(left_out) / self.length
            if len(left_out) > _FEW * self.length:
                return None
            rows = self.design[left_out]
            # the residual of the left-out samples is what they contributed beyond the fit
            change = residual[:, left_out] @ rows @ np.linalg.inv(gram - rows.T @ rows)
            solution = coefficients - change
            size = np.abs(residual + change @ self.design.T)
            scale = 1.4826 * np.median(size, axis=1)
        return None

    def _phasors(self, coefficients: FloatArray, start: FloatArray) -> ComplexArray:
        n = 2 * len(self.frequencies)
        local = coefficients[:, :, 0:n:2] + 1j * coefficients[:, :, 1:n:2]
        return _to_run_origin(local.transpose(0, 2, 1), self.frequencies, start)


def _largest(rows: FloatArray) -> FloatArray:
    """Largest modulus in every row; NaN where one is missing."""
    return np.maximum(rows.max(axis=1), -rows.min(axis=1))


def _by_window(values: FloatArray) -> FloatArray:
    """From (2 n,), all X before all Y, to (n, 2)."""
    return np.ascontiguousarray(values.reshape(2, -1).T)


def usual_scale(scale: FloatArray) -> FloatArray:
    """Median over the windows with a scale, X and Y; infinite where none has; `scale` (n_windows, 2)."""
    finite_values = scale[np.isfinite(scale).all(axis=1)]
    return np.median(finite_values, axis=0) if len(finite_values) else np.full(2, np.inf)


def _mean_of_present(rows: FloatArray) -> FloatArray:
    """Mean of the finite values of every row, (n, 1); zero where a row has none."""
    present = np.isfinite(rows)
    total = np.where(present, rows, 0.0).sum(axis=1, keepdims=True)
    return np.asarray(total / np.maximum(present.sum(axis=1, keepdims=True), 1))


def _to_run_origin(local: ComplexArray, frequencies: FloatArray, start: FloatArray) -> ComplexArray:
    """Turn phasors from the windows' own starts to the start of the run."""
    return local * np.exp(-2j * np.pi * np.multiply.outer(start, frequencies))[:, :, None]


def fit_uneven(values: FloatArray, time: FloatArray, frequencies: FloatArray, origin: float) -> PhasorBlock:
    """Fit one window with its own time stamps (jitter, gaps).

    `values` (n, 2), `time` (n,) [s], `frequencies` (n_lines,) [Hz].
    """
    offset = _mean_of_present(values.T)[:, 0]
    local_time = time - time[0]
    coefficients, scale, lost = _refit(line_design(local_time, frequencies), values - offset, np.full(2, np.inf))
    n = 2 * len(frequencies)
    local = (coefficients[:, 0:n:2] + 1j * coefficients[:, 1:n:2]).T[None]
    return PhasorBlock(
        _to_run_origin(local, frequencies, np.array([time[0] - origin])),
        (coefficients[:, n] + offset)[None],
        scale[None],
        np.array([lost]),
    )


def _refit(design: FloatArray, values: FloatArray, usual: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Fit one window without its glitches: coefficients (2, n_columns), residual scale (2,), share of samples lost."""
    robust_lines = fit_without_glitches(design, values, usual)
    return robust_lines.coefficients, robust_lines.scale, robust_lines.lost
