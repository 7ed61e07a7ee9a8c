"""Phasors of all known lines, window by window and channel by channel, by a joint least-squares fit.

Convention: a channel is Re{ z exp(+i omega t) } with t = 0 at the start of the run, so that windows
of one run are repeats of one phasor as long as the drive is locked to the recorder's clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from tpjb_ident.phasors.bad_samples import (
    BAD_LIMIT,
    SCALE_LIMIT,
    is_present,
    robust_deviation,
    robust_fit,
    with_flanks,
)
from tpjb_ident.phasors.windows import line_design

#: Outlying samples up to this share are left out again and again until fit and verdict agree.
_FEW = 0.1
_FEW_ROUNDS = 8
#: Samples of a block.
BLOCK = 256
#: Samples of a long window that are multiplied at once.
_AT_ONCE = 256


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
class WindowFit:
    """Lines of some channels in some windows of one run."""

    z: ComplexArray  #: (n_windows, n_lines, n_channels) complex: phasors; NaN where a window gives none
    mean: FloatArray  #: (n_windows, n_channels)
    scale: FloatArray  #: (n_windows, n_channels): robust standard deviation of what the lines leave
    lost: FloatArray  #: (n_windows, n_channels): share of the samples left out (bad or missing)

    def put(self, window: int, channels: slice, single: WindowFit) -> None:
        """Put the fit of one window and some channels in the place of what is there."""
        self.z[window, :, channels], self.mean[window, channels] = single.z[0], single.mean[0]
        self.scale[window, channels], self.lost[window, channels] = single.scale[0], single.lost[0]


def joined(fits: list[WindowFit], channels: bool = False) -> WindowFit:
    """Windows of one run one after the other, or the channels of the same windows side by side."""
    z = np.concatenate([fit.z for fit in fits], axis=2 if channels else 0)
    others = ("mean", "scale", "lost")
    return WindowFit(z, *(np.concatenate([getattr(f, n) for f in fits], axis=int(channels)) for n in others))


def no_windows(count: int, lines: int, channels: int) -> WindowFit:
    """Windows of which nothing was recorded."""
    none = np.full((count, channels), np.nan)
    return WindowFit(np.full((count, lines, channels), np.nan + 0j), none, none.copy(), np.ones((count, channels)))


class LineFitter:
    """Joint fit of lines and a drift on equal windows of an even grid: one pseudo-inverse for all of them."""

    def __init__(self, length: int, rate: float, frequencies: FloatArray, drift_order: int = 1) -> None:
        self.length, self.rate = length, rate
        self.frequencies = np.asarray(frequencies, dtype=float)
        self.design = even_design(length, rate, self.frequencies, drift_order)
        # Lines that a window tells apart leave a well-conditioned Gram matrix; its size is a dozen.
        self._gram_inverse = np.linalg.pinv(_products(self.design, self.design), rcond=1e-12, hermitian=True)
        self._level = _level(self.design, self.frequencies, length / rate)
        in_blocks = length >= 2 * BLOCK and drift_order == 1
        self._blocks = WaveBlocks(length, rate, self.frequencies) if in_blocks else None
        # The scale of the residual needs no more than a few hundred samples.
        self._stride = max(1, length // 512)

    def fit(self, rows: FloatArray, start: FloatArray, usual: FloatArray | None = None) -> WindowFit:
        """Fit windows; `rows` (n_channels, n_windows, length), `start` (n_windows,), `usual` (n_channels,)."""
        return self.fit_with_residual(rows, start, usual)[0]

    def fit_with_residual(
        self, rows: FloatArray, start: FloatArray, usual: FloatArray | None = None
    ) -> tuple[WindowFit, FloatArray]:
        """Fit windows, and give what is left of them, (n_channels, n_windows, length), with bad samples as zero."""
        q, n = rows.shape[:2]
        stack = rows.reshape(q * n, self.length)
        offset = _mean_of_present(stack[:, :: self._stride])
        residual = stack - offset
        coefficients = self._solve_and_subtract(residual)
        holed = np.flatnonzero(~np.isfinite(coefficients).all(axis=1))
        filled = np.where(is_present(stack[holed]), stack[holed] - offset[holed], 0.0)
        coefficients[holed], residual[holed] = self._solve_and_subtract(filled), filled
        scale = 1.4826 * np.median(np.abs(residual[:, :: self._stride]), axis=1)
        scale[holed] = np.inf  # what is filled in is left out first
        scale = scale.reshape(q, n)
        usual = usual_scale(scale.T) if usual is None else usual
        lost = np.zeros((q, n))
        bad = np.isinf(scale) | self._unclean(residual, scale, usual, np.abs(coefficients).sum(axis=1))
        coefficients, offset = coefficients.reshape(q, n, -1), offset.reshape(q, n)
        residual = residual.reshape(q, n, -1)
        for k, i in np.argwhere(bad):
            gaps = ~is_present(rows[k, i])
            robust = self._without_few(residual[k, i], gaps, coefficients[k, i], scale[k, i], float(usual[k]))
            if robust is None:
                fit = robust_fit(self.design, rows[k, i] - offset[k, i], float(usual[k]))
                robust = fit.coefficients, fit.scale, fit.lost
            coefficients[k, i], scale[k, i], lost[k, i] = robust
            remainder = rows[k, i] - offset[k, i] - self.design @ coefficients[k, i]
            residual[k, i] = np.where(np.abs(remainder) <= BAD_LIMIT * scale[k, i], remainder, 0.0)
        mean = coefficients @ self._level + offset
        z = _phasors(coefficients, self.frequencies, start)
        return WindowFit(z, *(np.ascontiguousarray(values.T) for values in (mean, scale, lost))), residual

    def _unclean(self, residual: FloatArray, scale: FloatArray, usual: FloatArray, size: FloatArray) -> BoolArray:
        """Windows that hold bad samples (q, n): by a sample of theirs, or by their scale.

        A long disturbance pulls the whole fit and hides in the window's own scale: the run's tells. The rounding of a
        noise-free record is no bad sample. A missing value makes the comparisons false.

        `residual` (q n, length), `scale` (q, n), `usual` (q,), `size` (q n,): sum of the coefficients.
        """
        largest = np.maximum(residual.max(axis=1), -residual.min(axis=1)).reshape(scale.shape)
        rounding = 1e-10 * size.reshape(scale.shape)
        clean = largest <= np.maximum(BAD_LIMIT * scale, rounding)
        clean &= scale <= np.maximum(SCALE_LIMIT * usual[:, None], rounding)
        return ~clean

    def _solve_and_subtract(self, rows: FloatArray) -> FloatArray:
        """Coefficients of every row, (k, n_columns); the rows become residuals."""
        if self._blocks is None:
            coefficients = _products(rows.T, self.design) @ self._gram_inverse
            for first in range(0, self.length, _AT_ONCE):
                part = slice(first, first + _AT_ONCE)
                rows[:, part] -= coefficients @ self.design[part].T
        else:
            coefficients = self._blocks.project(rows) @ self._gram_inverse
            self._blocks.subtract(rows, coefficients)
        return coefficients

    def _without_few(
        self, residual: FloatArray, gaps: BoolArray, coefficients: FloatArray, scale: float, usual: float
    ) -> tuple[FloatArray, float, float] | None:
        """Leave the few outlying samples out of a window's fit until no verdict changes; None where it cannot.

        Their rows are taken off the normal equations: no need to go through all samples again.

        `residual` (length,), `gaps` (length,) where there is no value, `coefficients` (n_columns,); `scale` is infinite
        where these rest on what fills the gaps.
        """
        first, limit = scale, SCALE_LIMIT * usual
        if limit < first < np.inf:
            return None
        gram = np.linalg.inv(self._gram_inverse)
        size, solution, left_out = np.abs(residual), coefficients, None
        for _ in range(_FEW_ROUNDS):
            previous, left_out = left_out, np.flatnonzero(gaps | with_flanks(size > BAD_LIMIT * scale))
            if previous is not None and np.array_equal(previous, left_out):
                return (solution, scale, len(left_out) / self.length) if min(first, scale) <= limit else None
            if len(left_out) > _FEW * self.length:
                return None
            rows = self.design[left_out]
            # the residual of the left-out samples is what they contributed beyond the fit
            try:
                change = np.linalg.solve(gram - rows.T @ rows, residual[left_out] @ rows)
            except np.linalg.LinAlgError:  # what is left does not tell its lines apart
                return None
            solution = coefficients - change
            size = np.where(gaps, 0.0, np.abs(residual + self.design @ change))
            scale = robust_deviation(size[~gaps])
        return None


def _products(first: FloatArray, second: FloatArray) -> FloatArray:
    """Inner products of all columns, part by part: a tall product at once is shared out among threads, at a loss."""
    stretches = [slice(k, k + _AT_ONCE) for k in range(0, len(first), _AT_ONCE)]
    return np.asarray(np.sum([first[part].T @ second[part] for part in stretches], axis=0))


def even_design(length: int, rate: float, frequencies: FloatArray, drift_order: int = 1) -> FloatArray:
    """The columns of `line_design` on an even grid: waves of one block, turned from block to block."""
    if length < 2 * BLOCK:
        return line_design(np.arange(length) / rate, frequencies, drift_order)
    tau, starts = np.arange(BLOCK) / rate, np.arange(0, length, BLOCK) / rate
    design = np.empty((length, 2 * len(frequencies) + drift_order + 1))
    for k, frequency in enumerate(frequencies):
        turn = np.exp(2j * np.pi * frequency * starts)
        wave = np.multiply.outer(turn, np.exp(2j * np.pi * frequency * tau)).ravel()[:length]
        design[:, 2 * k], design[:, 2 * k + 1] = wave.real, -wave.imag
    design[:, 2 * len(frequencies) :] = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, length), drift_order)
    return design


def _phasors(coefficients: FloatArray, frequencies: FloatArray, start: FloatArray) -> ComplexArray:
    """From (q, n, n_columns) to phasors (n, n_lines, q), turned from the windows' own starts to that of the run."""
    n = 2 * len(frequencies)
    local = coefficients[:, :, 0:n:2] + 1j * coefficients[:, :, 1:n:2]
    turn = np.exp(-2j * np.pi * np.multiply.outer(start, frequencies))
    return np.ascontiguousarray((local * turn).transpose(1, 2, 0))


def _level(design: FloatArray, frequencies: FloatArray, duration: float) -> FloatArray:
    """What the coefficients make of a window's mean, (n_columns,).

    A line that does not turn once in the window is part of it, and so is one that is no turn apart from such a line:
    their columns are told from a constant by their sum alone.
    """
    weights = np.asarray(design.mean(axis=0))
    turns = np.sort(frequencies) * duration
    apart = turns[np.diff(turns, prepend=0.0) >= 1.0]
    told = frequencies * duration >= apart.min(initial=np.inf)
    weights[: 2 * len(frequencies)][np.repeat(told, 2)] = 0.0
    return weights


def usual_scale(scale: FloatArray) -> FloatArray:
    """Median over the windows with a scale; infinite where none has; `scale` (n_windows, q)."""
    if len(scale) and np.isfinite(scale).all():
        return np.asarray(np.median(scale, axis=0))
    usual = np.full(scale.shape[1], np.inf)
    for k, column in enumerate(scale.T):
        finite_values = column[np.isfinite(column)]
        if len(finite_values):
            usual[k] = np.median(finite_values)
    return usual


def _mean_of_present(rows: FloatArray) -> FloatArray:
    """Mean of the values of every row, (n, 1); zero where a row has none."""
    present = is_present(rows)
    if present.all():
        return rows.mean(axis=1, keepdims=True)
    total = np.where(present, rows, 0.0).sum(axis=1, keepdims=True)
    return np.asarray(total / np.maximum(present.sum(axis=1, keepdims=True), 1))


def fit_uneven(rows: FloatArray, time: FloatArray, frequencies: FloatArray, origin: float) -> WindowFit:
    """Fit one window with its own time stamps (jitter, gaps).

    `rows` (q, n), `time` (n,) [s], `frequencies` (n_lines,) [Hz].
    """
    offset = _mean_of_present(rows)
    design = line_design(time - time[0], frequencies)
    fits = [robust_fit(design, row, np.inf) for row in rows - offset]
    coefficients = np.array([[fit.coefficients] for fit in fits])
    mean = coefficients[:, 0] @ _level(design, frequencies, float(time[-1] - time[0])) + offset[:, 0]
    scale, lost = np.array([fit.scale for fit in fits]), np.array([fit.lost for fit in fits])
    z = _phasors(coefficients, frequencies, np.array([time[0] - origin]))
    return WindowFit(z, mean[None], scale[None], lost[None])
