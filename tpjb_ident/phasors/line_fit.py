"""Phasors of all known lines, window by window and channel by channel, by a joint least-squares fit.

Convention: a channel is Re{ z exp(+i omega t) } with t = 0 at the start of the run, so that windows
of one run are repeats of one phasor as long as the drive is locked to the recorder's clock.

Glitches and gaps are told from the lines channel by channel: what is bad in a probe stays good in the cells. An
isolated bad sample takes nothing with it; where several stand close together, it is a disturbance, and its flanks lie
below the limit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.calibration import OVERFLOW
from tpjb_ident.phasors.lines import line_design

#: A residual is no smaller than this share of the largest: what stands still has none, and is not divided by.
_ROUNDING = 1e-100
#: A sample is bad beyond this many robust standard deviations of the fit's residual.
BAD_LIMIT = 5.5
#: A window this many times noisier than its run's median is looked at again.
SCALE_LIMIT = 1.5
#: So many bad samples with at most one good one between neighbours are a disturbance,
_MANY = 3
#: and take so many more on either side with them.
_MARGIN = 3
#: Change of a residual over the usual one at which least absolute deviations have settled.
_SETTLED = 0.02
_LAD_ROUNDS = 15


def robust_deviation(residual: FloatArray) -> float:
    """Standard deviation of a normal residual by its median size."""
    return 1.4826 * float(np.median(np.abs(residual)))


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the noise of single values (n,): steps, levels and ramps drop out of second differences."""
    return robust_deviation(np.diff(values, 2)) / float(np.sqrt(6.0))


def window_median(values: FloatArray, absent: float = np.nan) -> FloatArray:
    """Median over the windows (n, m) that have a value, `absent` where none has, (m,)."""
    present = np.isfinite(values)
    ranked = np.sort(np.pad(np.where(present, values, np.inf), ((0, 1), (0, 0)), constant_values=np.inf), axis=0)
    count, column = present.sum(axis=0), np.arange(values.shape[1])
    middle = 0.5 * (ranked[(count - 1) // 2, column] + ranked[count // 2, column])
    return np.where(count > 0, middle, absent)


def usual_scale(scale: FloatArray) -> FloatArray:
    """Median over the windows with a scale (n_windows, q); infinite where none has."""
    return window_median(scale, np.inf)


def with_flanks(outlying: BoolArray) -> BoolArray:
    """Bad samples: isolated ones by themselves, disturbances with their flanks; `outlying` (n,)."""
    bad = np.array(outlying)
    at = np.flatnonzero(outlying)
    for group in np.split(at, np.flatnonzero(np.diff(at) > 2) + 1):
        if len(group) >= _MANY:
            bad[max(group[0] - _MARGIN, 0) : group[-1] + _MARGIN + 1] = True
    return bad


def absolute_residual(design: FloatArray, values: FloatArray) -> FloatArray:
    """What least absolute deviations leave of some values (n,): a quarter of them may be wrong.

    By reweighted normal equations: good enough for a first verdict on samples. `design` (n, n_columns).
    """
    weights, size = np.ones(len(values)), np.full(len(values), np.inf)
    for _ in range(_LAD_ROUNDS):
        weighted = design * weights[:, None]
        solution = np.linalg.pinv(weighted.T @ design, rcond=1e-12, hermitian=True) @ (weighted.T @ values)
        previous, size = size, np.abs(values - design @ solution)
        middle = max(np.median(size), _ROUNDING * size.max(initial=0.0), np.finfo(float).tiny)
        if np.abs(size - previous).max() <= _SETTLED * middle:
            break  # nothing moves any more that could make a verdict
        weights = 1 / np.maximum(size / middle, 0.1)
    return size


#: Outlying samples up to this share are few; a window that has lost more than the other gives no phasor.
_FEW, _MAX_LOST = 0.1, 0.5
#: Verdicts on a window's samples, at most.
_ROUNDS = 8
#: Samples of a block of waves.
BLOCK = 256


class WindowFit(NamedTuple):
    """Lines of some channels in some windows of one run."""

    z: ComplexArray  #: (n_windows, n_lines, n_channels) complex: phasors; NaN where a window gives none
    mean: FloatArray  #: (n_windows, n_channels)
    scale: FloatArray  #: (n_windows, n_channels): robust standard deviation of what the lines leave
    lost: FloatArray  #: (n_windows, n_channels): share of the samples left out (bad or missing)

    @staticmethod
    def empty(windows: int, lines: int, channels: int) -> WindowFit:
        """Windows of which nothing was recorded."""
        missing = np.full((windows, channels), np.nan)
        z = np.full((windows, lines, channels), np.nan + 0j)
        return WindowFit(z, missing, missing.copy(), np.ones((windows, channels)))

    def put(self, windows: slice, part: WindowFit) -> None:
        """Put the fit of some windows in the place of what is there."""
        for values, fitted in zip(self, part):
            values[windows] = fitted


class LineFitter:
    """Joint fit of lines and a slow drift to windows of the same columns: one pseudo-inverse for all of them."""

    def __init__(
        self, length: int, rate: float, frequencies: FloatArray, drift_order: int = 1, time: FloatArray | None = None
    ) -> None:
        self.length, self.rate = length, rate
        self.frequencies = np.asarray(frequencies, dtype=float)
        if time is None:
            duration = length / rate
            self.design = even_design(length, rate, self.frequencies, drift_order)
        else:  # (length,) [s]: of samples with jitter or gaps
            duration = float(time[-1] - time[0])
            self.design = line_design(time - time[0], self.frequencies, drift_order)
        self._gram = self.design.T @ self.design
        # Lines that a window tells apart leave a well-conditioned Gram matrix; its size is a dozen.
        self._gram_inverse = np.linalg.pinv(self._gram, rcond=1e-12, hermitian=True)
        self._level = _level(self.design, self.frequencies, duration)

    def fit(self, rows: FloatArray, start: FloatArray, usual: FloatArray | None = None) -> WindowFit:
        """Fit windows; `rows` (n_channels, n_windows, length), `start` (n_windows,), `usual` (n_channels,)."""
        return self.fit_with_residual(rows, start, usual)[0]

    def fit_with_residual(
        self, rows: FloatArray, start: FloatArray, usual: FloatArray | None = None
    ) -> tuple[WindowFit, FloatArray]:
        """Fit windows, and give what is left of them, (n_channels, n_windows, length), with bad samples as zero."""
        q, n = rows.shape[:2]
        stack = rows.reshape(q * n, self.length)
        with np.errstate(invalid="ignore"):  # a NaN compared is what "no value" looks like
            present = np.abs(stack) < OVERFLOW
        count = np.maximum(present.sum(axis=1, keepdims=True), 1)
        offset = np.sum(stack, axis=1, keepdims=True, where=present) / count
        values = np.where(present, stack - offset, 0.0)
        coefficients = values @ self.design @ self._gram_inverse
        residual = values - coefficients @ self.design.T
        # The scale of the residual needs no more than a few hundred samples.
        scale = 1.4826 * np.median(np.abs(residual[:, :: max(1, self.length // 512)]), axis=1)
        scale[~present.all(axis=1)] = np.inf  # what is filled in is left out first
        usual = usual_scale(scale.reshape(q, n).T) if usual is None else usual
        limit = np.repeat(usual, n)
        lost = np.zeros(q * n)
        for k in np.flatnonzero(self._is_unclean(residual, scale, limit, np.abs(coefficients).sum(axis=1))).tolist():
            gaps = ~present[k]
            change, scale[k], lost[k] = self._without_bad(values[k], residual[k], gaps, scale[k], limit[k])
            coefficients[k] -= change
            remainder = np.abs(values[k] - self.design @ coefficients[k])
            is_good = ~gaps & (remainder <= BAD_LIMIT * scale[k])
            residual[k] = np.where(is_good, values[k] - self.design @ coefficients[k], 0.0)
        mean = coefficients @ self._level + offset[:, 0]
        # turned from the windows' own starts to that of the run
        waves = coefficients[:, : 2 * len(self.frequencies)].reshape(q, n, -1)
        turn = np.exp(-2j * np.pi * np.multiply.outer(start, self.frequencies))
        z = np.ascontiguousarray(((waves[:, :, 0::2] + 1j * waves[:, :, 1::2]) * turn).transpose(1, 2, 0))
        figures = (np.ascontiguousarray(part.reshape(q, n).T) for part in (mean, scale, lost))
        return WindowFit(z, *figures), residual.reshape(q, n, -1)

    def _is_unclean(self, residual: FloatArray, scale: FloatArray, usual: FloatArray, size: FloatArray) -> BoolArray:
        """Windows (k,) that hold bad samples: by a sample of theirs, or by their scale.

        A long disturbance pulls the whole fit and hides in the window's own scale: the run's tells. The rounding of a
        noise-free record is no bad sample.

        `residual` (k, length), `scale`, `usual` (k,), `size` (k,): sum of the coefficients.
        """
        largest, rounding = np.maximum(residual.max(axis=1), -residual.min(axis=1)), 1e-10 * size
        clean = np.isfinite(scale) & (largest <= np.maximum(BAD_LIMIT * scale, rounding))
        return ~(clean & (scale <= np.maximum(SCALE_LIMIT * usual, rounding)))

    def _without_bad(
        self, values: FloatArray, residual: FloatArray, gaps: BoolArray, scale: float, usual: float
    ) -> tuple[FloatArray, float, float]:
        """What a window's coefficients lose without its bad samples, its scale, and the share of these.

        Where they are few the plain fit tells them; else least absolute deviations. NaN where too few are left.

        `values`, `residual` (length,), `gaps` (length,) where there is no value; `scale` is infinite where the residual
        rests on what fills the gaps.
        """
        limit = SCALE_LIMIT * usual
        if not limit < scale < np.inf:
            settled = self._settled(residual, gaps, np.abs(residual) > BAD_LIMIT * scale, limit, _FEW)
            if settled is not None:
                return settled
        missing = np.full(self.design.shape[1], np.nan), np.nan
        if gaps.mean() > _MAX_LOST or np.sum(~gaps) <= 2 * self.design.shape[1]:
            return *missing, float(gaps.mean())
        size = absolute_residual(self.design[~gaps], values[~gaps])
        outlying = np.zeros(self.length, dtype=bool)
        outlying[~gaps] = size > BAD_LIMIT * min(robust_deviation(size), limit)
        return self._settled(residual, gaps, outlying, limit, _MAX_LOST) or (*missing, 1.0)

    def _settled(
        self, residual: FloatArray, gaps: BoolArray, outlying: BoolArray, limit: float, most: float
    ) -> tuple[FloatArray, float, float] | None:
        """Leave `outlying` samples out until no verdict changes; None where they are more than a share of `most`.

        Their rows are taken off the normal equations of the plain fit, whose `residual` (length,) is what they
        contribute beyond it: no need to go through all samples again. `limit` of the scale.
        """
        left_out = np.flatnonzero(gaps | with_flanks(outlying))
        for _ in range(_ROUNDS):
            if len(left_out) > most * self.length:
                return None
            rows = self.design[left_out]
            try:
                change = np.asarray(np.linalg.solve(self._gram - rows.T @ rows, residual[left_out] @ rows), dtype=float)
            except np.linalg.LinAlgError:  # what is left does not tell its lines apart
                return None
            size = np.where(gaps, 0.0, np.abs(residual + self.design @ change))
            scale = min(robust_deviation(size[~gaps]), limit)
            previous, left_out = left_out, np.flatnonzero(gaps | with_flanks(size > BAD_LIMIT * scale))
            if np.array_equal(previous, left_out):
                return change, scale, len(left_out) / self.length
        return None if most == _FEW else (change, scale, len(left_out) / self.length)


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


def _level(design: FloatArray, frequencies: FloatArray, duration: float) -> FloatArray:
    """What the coefficients make of a window's mean, (n_columns,).

    A line that does not turn once in the window is part of it, and so is one that is no turn apart from such a line:
    their columns are told from a constant by their sum alone.
    """
    weights = design.mean(axis=0)
    turns = np.sort(frequencies) * duration
    separate = turns[np.diff(turns, prepend=0.0) >= 1.0]
    is_resolved = frequencies * duration >= separate.min(initial=np.inf)
    weights[: 2 * len(frequencies)][np.repeat(is_resolved, 2)] = 0.0
    return weights
