"""Whether an excitation repeats itself, and after how many samples.

A periodic excitation needs no window and measures its own noise. Its generator has a clock of its own, so that a period
need not hold a whole number of samples; the record is then resampled, all channels alike, to one that does.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.samples import Samples, interpolated

#: Periods that a record must hold.
_MIN_PERIODS = 3
#: Share of the band's power that must repeat, beyond what chance repeats.
_REPEATS = 0.5
#: Phase [rad] by which the top of the band may run off over the record before it is resampled.
_MAX_SLIP = 0.01


def find_period(samples: Samples, band: tuple[float, float], disturbed: BoolArray) -> float | None:
    """Period in samples of what excites the band, None where it does not repeat; `disturbed` (n // 2 + 1,)."""
    least, most = int(2 * samples.rate / band[0]), samples.length // _MIN_PERIODS
    best = _first_peak(_correlation(samples, band, disturbed), least // 2, most + 1)
    if best is None:
        return None
    period = _sharpened(samples, best, band)
    share = _repeating_share(samples, period, band, disturbed)
    count = int(samples.length // period)
    chance = 1.0 / max(count, 1)
    if count < _MIN_PERIODS or share < chance + _REPEATS * (1 - chance):
        return None
    return period


def _inside(samples: Samples, band: tuple[float, float]) -> BoolArray:
    frequency = np.fft.rfftfreq(samples.length, 1 / samples.rate)
    return np.asarray((frequency >= band[0]) & (frequency <= band[1]))


def _correlation(samples: Samples, band: tuple[float, float], disturbed: BoolArray) -> FloatArray:
    """Correlation of the band-limited signals with themselves over the lag in samples, 1 where all repeats."""
    n = samples.length
    keep = _inside(samples, band) & ~disturbed
    limited = np.fft.irfft(np.where(keep, np.fft.rfft(samples.signals(), axis=1), 0.0), n, axis=1)
    padded = np.fft.rfft(limited, 2 * n, axis=1)
    correlation = np.fft.irfft(np.sum(np.abs(padded) ** 2, axis=0))[:n]
    energy = np.cumsum(np.sum(limited**2, axis=0))
    # power of the two stretches that overlap at each lag
    first, last = energy[::-1], energy[-1] - np.concatenate([[0.0], energy[:-1]])
    return np.asarray(correlation / np.maximum(np.sqrt(first * last), 1e-300))


def _first_peak(correlation: FloatArray, least: int, most: int) -> int | None:
    """Smallest lag at which nearly as much repeats as anywhere."""
    part = correlation[least:most]
    if not len(part) or not part.max() > 0.3:
        return None
    peaks = np.flatnonzero((part[1:-1] >= part[:-2]) & (part[1:-1] >= part[2:])) + 1
    high = peaks[part[peaks] > 0.93 * part.max()] if len(peaks) else peaks
    return None if not len(high) else int(high[0]) + least


def _sharpened(samples: Samples, samples_each: int, band: tuple[float, float]) -> float:
    """The period by the phase that the band's lines gain from one stretch of `whole` samples to the next."""
    period = float(samples_each)
    for _ in range(2):
        Z, f = _periods(samples, samples_each, band)
        if Z.shape[1] < 2:
            return period
        turn = np.sum(Z[:, 1:] * Z[:, :-1].conj(), axis=(0, 1))
        weight = np.abs(turn)
        # a period of p samples seen through stretches of q gains 2 pi f (q - p) / rate
        slope = float(np.sum(weight * f * np.angle(turn)) / max(float(np.sum(weight * f**2)), 1e-300))
        period = samples_each - slope * samples.rate / (2 * np.pi)
        if round(period) == samples_each:
            return period
        samples_each = round(period)
    return period


def _periods(samples: Samples, whole: int, band: tuple[float, float]) -> tuple[ComplexArray, FloatArray]:
    rows = samples.signals()
    count = rows.shape[1] // whole
    folded = rows[:, : count * whole].reshape(len(rows), count, whole)
    frequency = np.fft.rfftfreq(whole, 1 / samples.rate)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return np.fft.rfft(folded, axis=2)[:, :, inside], np.asarray(frequency[inside], dtype=float)


def _repeating_share(samples: Samples, period: float, band: tuple[float, float], disturbed: BoolArray) -> float:
    whole = resampled(samples, period, band[1])
    q = round(period)
    Z, f = _periods(whole, q, band)
    wide = np.interp(f, np.fft.rfftfreq(samples.length, 1 / samples.rate), disturbed.astype(float)) > 0
    Z = Z[:, :, ~wide]
    total = float(np.sum(np.abs(Z) ** 2))
    return float(np.sum(np.abs(Z.mean(axis=1)) ** 2) * Z.shape[1] / total) if total > 0 else 0.0


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
