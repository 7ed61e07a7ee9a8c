"""Means and phasors of the known lines of a record, by one least-squares fit that leaves glitches out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.run import Run
from tpjb_ident.dynamic.records.line_fit import GLITCH_LIMIT, fit_without_glitches
from tpjb_ident.dynamic.records.windows import line_design

#: A line whose amplitude may change needs this distance from all others [1 / record length].
_PARTED = 2.5
#: Where the noise beside a line is looked at [half of 1 / record length].
_BESIDE = (5, 7, 9, 11, 15)
#: Samples that tell the scale of what a fit leaves.
_SCALED = 4096
#: Lines of a band that are looked at, the strongest of as many parts of it.
_BAND_LINES = 8
#: Bins to either side of a disturbing line that are left alone.
_CLEAR_OF = 5
#: Noise is looked at from this many times the band's top on.
_ABOVE = 1.3
#: The speed is looked for within this share of the stated one; the check of the speed channel warns from there on.
_WITHIN = 0.03
#: Nearer to another line than this, a speed cannot be found [1 / record length].
_APART = 3.0
#: A line must stand this many times over the median amplitude around it.
_CLEAR = 8.0
#: Longest stretch looked at: its resolution is fine enough for any record [samples].
_LONGEST = 2**16


@dataclass(frozen=True)
class RecordLines:
    """What the fit found, for m channels."""

    mean: FloatArray  #: (m,)
    phasor: ComplexArray  #: (m,) complex: at the first of the frequencies; ``Re(phasor exp(i omega t))``
    floor: FloatArray  #: (m,): amplitude that lines beside it reach by noise alone
    scatter: FloatArray  #: (m,): standard deviation of what is left


def fit_lines(
    time: FloatArray, values: FloatArray, frequencies: Sequence[float], inexact: Sequence[float] = ()
) -> RecordLines:
    """Fit mean, drift and lines to every column; `time` (n,), `values` (n, m)."""
    span = max(float(time[-1] - time[0]), 1e-300)
    distinct: list[float] = []
    for frequency in frequencies:
        if frequency > 0 and all(abs(frequency - f) * span > 0.8 for f in distinct):
            distinct.append(frequency)
    growing = [f for f in inexact if f in distinct[1:] and all(abs(f - k) * span > _PARTED for k in distinct if k != f)]
    design = line_design(time - time[0], np.array(distinct), 1, np.array(growing))
    coefficients, used = _robust(design, values)
    residual = np.where(used, values - design @ coefficients, 0.0)
    counts = np.count_nonzero(used, axis=0)
    defined = np.where(counts > 0, 1.0, np.nan)
    scatter = np.sqrt(np.sum(residual**2, axis=0) / np.maximum(counts, 1)) * defined
    mean = coefficients[2 * len(distinct)]
    if not distinct:
        missing = np.full(values.shape[1], np.nan)
        return RecordLines(mean, missing + 0j, missing, scatter)
    phasor = (coefficients[0] + 1j * coefficients[1]) * np.exp(-2j * math.pi * distinct[0] * time[0])
    floor = _floor(time, residual, distinct[0], span) * len(time) / np.maximum(counts, 1) * defined
    return RecordLines(mean, phasor, floor, scatter)


def _robust(design: FloatArray, values: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Coefficients (k, m) of every channel, NaN where too little is left of it, and the samples (n, m) it rests on.

    As in `tpjb_ident.dynamic.records.phasors`: one solution for all channels that show no glitch, the others one by
    one. Each is judged by itself.
    """
    complete = np.isfinite(values).all(axis=0)
    coefficients, used = np.zeros((design.shape[1], values.shape[1])), np.isfinite(values)
    moment = design.T @ np.where(used, values, 0.0)
    coefficients = np.linalg.pinv(design.T @ design, rcond=1e-12, hermitian=True) @ moment
    size = np.abs(values - design @ coefficients)
    # a few thousand samples tell the scale
    scale = 1.4826 * np.median(size[:: max(1, len(size) // _SCALED)], axis=0)
    clean = size.max(axis=0) <= np.maximum(GLITCH_LIMIT * scale, 1e-10 * np.abs(coefficients).sum(axis=0))
    for k in np.flatnonzero(~(complete & clean)):
        robust_lines = fit_without_glitches(design, values[:, k : k + 1], np.array([np.inf]))
        coefficients[:, k], used[:, k] = robust_lines.coefficients[0], robust_lines.kept
    return coefficients, used


def _floor(time: FloatArray, residual: FloatArray, frequency: float, span: float) -> FloatArray:
    """Median amplitude of what is left, at frequencies around the wanted one, per column."""
    line, half = (np.exp(2j * math.pi * f * (time - time[0])) for f in (frequency, 0.5 / span))
    step, offset = half * half, half
    waves = []
    for halves in range(3, 17, 2):  # 2.5, 3.5, .. of a line's width beside it
        offset = offset * step
        if halves in _BESIDE:
            waves += [line * offset] + ([line * offset.conj()] if frequency > 0.5 * halves / span else [])
    waves_array = np.array(waves)
    return np.asarray(
        np.median(np.hypot(waves_array.real @ residual, waves_array.imag @ residual), axis=0) * 2.0 / len(time)
    )


def strongest_line(time: FloatArray, values: FloatArray, apart_from: Sequence[float]) -> float:
    """Frequency of the strongest line, leaving out some and the slowest [Hz]; NaN where there is none."""
    if len(time) < 16:
        return float("nan")
    filled = np.where(np.isfinite(values), values, np.nanmedian(values)) if np.isfinite(values).any() else None
    if filled is None:
        return float("nan")
    window = np.hanning(len(filled))
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if step <= 0:
        return float("nan")
    power = np.abs(np.fft.rfft((filled - np.median(filled)) * window))
    frequency = np.fft.rfftfreq(len(filled), step)
    allowed = frequency > 4.0 / (step * len(filled))
    for known in apart_from:
        allowed &= np.abs(frequency - known) > 3.0 / (step * len(filled))
    return float(frequency[np.argmax(np.where(allowed, power, 0.0))]) if allowed.any() else float("nan")


def band_lines(
    run: Run, values: FloatArray, force: Sequence[int], disturbing: Sequence[float]
) -> tuple[ComplexArray, FloatArray]:
    """Phasors (k, m) at strong lines of an excitation over a band, and what noise makes of a line (m,).

    What channels owe one another (two planes of probes, cells and accelerometers) holds at every line, so a few that
    stand clear of the noise, away from shaft and mains, serve the checks as the one line of a sine does.

    `values` (n, m).
    """
    none = np.empty((0, values.shape[1]), complex), np.full(values.shape[1], np.nan)
    finite = np.isfinite(values)
    if run.band is None or not len(force) or len(values) < 64 or not finite.any(axis=0).all():
        return none
    middle = np.nanmedian(values, axis=0)
    window = np.hanning(len(values))
    spectrum = np.fft.rfft(np.where(finite, values - middle, 0.0) * window[:, None], axis=0) * (2 / window.sum())
    frequency = np.fft.rfftfreq(len(values), 1 / run.sample_rate)
    free = np.ones(len(frequency), dtype=bool)
    for line in disturbing:
        free &= np.abs(frequency - line * np.maximum(np.round(frequency / line), 1)) > _CLEAR_OF * frequency[1]
    inside = np.flatnonzero(free & (frequency >= run.band[0]) & (frequency <= run.band[1]))
    above = free & (frequency > _ABOVE * run.band[1]) & (frequency < 0.45 * run.sample_rate)
    if len(inside) < _BAND_LINES or above.sum() < _BAND_LINES:
        return none
    power = np.sum(np.abs(spectrum[:, list(force)]) ** 2, axis=1)
    chosen = [part[np.argmax(power[part])] for part in np.array_split(inside, _BAND_LINES)]
    return np.asarray(spectrum[chosen]), np.median(np.abs(spectrum[above]), axis=0)


def turning_frequency(time: FloatArray, values: FloatArray, nominal: float, lines: Sequence[float]) -> float:
    """Frequency of the 1X line [Hz], from the peak of a Hann spectrum summed over the channels.

    `time` (n,), `values` (n, m).
    """
    count = min(len(time), _LONGEST)
    span = float(time[count - 1] - time[0])
    finite = np.isfinite(values[:count]).all(axis=0)
    if nominal <= 0 or count < 64 or span <= 0 or not finite.any() or nominal * span < _APART:
        return nominal
    padded = 4 * count
    step = (count - 1) / span / padded
    reach = max(_WITHIN * nominal, 2.0 / span)
    reach = min([reach, *(abs(line - nominal) - _APART / span for line in lines)])
    low, high = int(np.ceil((nominal - reach) / step)), min(int((nominal + reach) / step), padded // 2)
    if reach <= 0 or low < 1 or high - low < 4:
        return nominal
    columns = values[:count, finite]
    spectrum = np.abs(np.fft.rfft((columns - columns.mean(axis=0)) * np.hanning(count)[:, None], padded, axis=0))
    wide = slice(max(1, low - 40), min(high + 40, len(spectrum)))
    level = np.median(spectrum[wide], axis=0)
    power = np.mean((spectrum / np.maximum(level, 1e-300)) ** 2, axis=1)
    peak = low + int(np.argmax(power[low : high + 1]))
    if not low < peak < high or power[peak] < _CLEAR**2:
        return nominal
    before, top, after = np.log(power[peak - 1 : peak + 2])
    return float((peak + 0.5 * (before - after) / (before - 2 * top + after)) * step)
