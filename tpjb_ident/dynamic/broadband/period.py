"""Whether an excitation repeats itself, and after how many samples.

A periodic excitation needs no window and measures its own noise. Its generator has a clock of its own, so that a period
need not hold a whole number of samples; the record is then resampled, all channels alike, to one that does.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.broadband.disturbing_lines import bins_taken, without_disturbances
from tpjb_ident.dynamic.broadband.samples import Samples, interpolated
from tpjb_ident.phasors.lines import Line

#: Periods that a record must hold.
_MIN_PERIODS = 3
#: Share of the band's power that may be left by a period, beyond what chance repeats,
_LEFT = 0.5
#: so many times what the best lag leaves, and this: beats of few tones all but repeat sooner, without one of them.
_MORE_LEFT, _LOST = 1.5, 0.003
#: Phase [rad] by which the top of the band may run off over the record before it is resampled.
_MAX_SLIP = 0.01


def find_period(samples: Samples, band: tuple[float, float], lines: tuple[Line, ...]) -> float | None:
    """Smallest period in samples of what excites the band, None where nothing repeats; `lines` of shaft and mains."""
    step = samples.rate / samples.length
    frequency = step * np.arange(samples.length // 2 + 1)
    keep = (frequency > band[0] - 1.5 * step) & (frequency < band[1] + 1.5 * step)
    keep &= ~bins_taken(frequency, lines, 1 / step)
    # first taken off, as a notch leaves what has leaked from them; then all of their bins, which drift leaves
    excited = without_disturbances(samples, lines).each(samples.rate, lambda rows: _kept(rows, keep))
    least, most = int(samples.rate / band[0]), samples.length // _MIN_PERIODS
    lags, best = _peaks(_correlation(excited.signals()), least, most + 1)
    limit = min(_LEFT, _MORE_LEFT * _left(excited, best, band[1])[0] + _LOST) if best else 0.0
    for lag in lags:
        left, period = _left(excited, lag, band[1])
        if left <= limit:
            return period
    return None


def _kept(rows: FloatArray, keep: BoolArray) -> FloatArray:
    """What some bins (n // 2 + 1,) hold of rows (k, n)."""
    return np.asarray(np.fft.irfft(np.where(keep, np.fft.rfft(rows, axis=1), 0.0), rows.shape[1], axis=1))


def _correlation(rows: FloatArray) -> FloatArray:
    """Correlation of rows (k, n) with themselves over the lag in samples, 1 where all repeats."""
    n = rows.shape[1]
    padded = np.fft.rfft(rows, 2 * n, axis=1)
    correlation = np.fft.irfft(np.sum(np.abs(padded) ** 2, axis=0))[:n]
    energy = np.cumsum(np.sum(rows**2, axis=0))
    # power of the two stretches that overlap at each lag
    first, last = energy[::-1], energy[-1] - np.concatenate([[0.0], energy[:-1]])
    return np.asarray(correlation / np.maximum(np.sqrt(first * last), 1e-300))


def _peaks(correlation: FloatArray, least: int, most: int) -> tuple[IntArray, int]:
    """Lags at which nearly as much repeats as anywhere, and the one at which most does, 0 where nothing does."""
    part = correlation[least:most]
    if not len(part) or not part.max() > 0.3:
        return np.zeros(0, dtype=int), 0
    peaks = np.flatnonzero((part[1:-1] >= part[:-2]) & (part[1:-1] >= part[2:])) + 1
    high = peaks[part[peaks] > 0.93 * part.max()] if len(peaks) else peaks
    return high + least, int(high[np.argmax(part[high])]) + least if len(high) else 0


def _left(samples: Samples, lag: int, top: float) -> tuple[float, float]:
    """Share of the power that does not repeat, beyond chance, with a period near the lag, and that period."""
    period = _sharpened(samples, lag)
    if samples.length < _MIN_PERIODS * period:
        return 1.0, period
    Z = _periods(resampled(samples, period, top), round(period))
    total = float(np.sum(np.abs(Z) ** 2))
    share = float(np.sum(np.abs(Z.mean(axis=1)) ** 2) * Z.shape[1] / total) if total > 0 else 0.0
    return (1 - share) / (1 - period / samples.length), period


def _sharpened(samples: Samples, samples_each: int) -> float:
    """The period by the phase that the band's lines gain from one stretch of the lag to the next."""
    period = float(samples_each)
    for _ in range(2):
        Z = _periods(samples, samples_each)
        if Z.shape[1] < 2:
            return period
        turn = np.sum(Z[:, 1:] * Z[:, :-1].conj(), axis=(0, 1))
        f = np.fft.rfftfreq(samples_each, 1 / samples.rate)
        weight = np.abs(turn)
        # a period of p samples seen through stretches of q gains 2 pi f (q - p) / rate
        slope = float(np.sum(weight * f * np.angle(turn)) / max(float(np.sum(weight * f**2)), 1e-300))
        period = samples_each - slope * samples.rate / (2 * np.pi)
        if round(period) == samples_each:
            return period
        samples_each = round(period)
    return period


def _periods(samples: Samples, whole: int) -> ComplexArray:
    """Spectra of stretches of so many samples, (k, n_stretches, n_bins)."""
    rows = samples.signals()
    count = rows.shape[1] // whole
    return np.asarray(np.fft.rfft(rows[:, : count * whole].reshape(len(rows), count, whole), axis=2))


def resampled(samples: Samples, period: float, top: float) -> Samples:
    """The record cut to whole periods of a whole number of samples each."""
    q = round(period)
    count = int((samples.length + 1e-6 * period) // period)
    slip = 2 * np.pi * top / samples.rate * abs(period - q) * count
    if slip <= _MAX_SLIP:
        count = samples.length // q
        return samples.each(samples.rate, lambda rows: rows[:, : count * q])
    at = np.asarray(np.arange(count * q) * (period / q), dtype=float)
    return samples.each(samples.rate * q / period, lambda rows: interpolated(rows, at))
