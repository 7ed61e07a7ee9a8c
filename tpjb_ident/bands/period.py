"""Whether an excitation repeats itself, and after how many samples.

A periodic excitation needs no window and measures its own noise. Its generator has a clock of its own, so that a period
need not hold a whole number of samples; the record is then resampled, all channels alike, to one that does.

What a period leaves is what the record changes from any stretch to its repeats. Beats of few tones all but repeat
sooner, and multiples leave no more: the period is the smallest that leaves no more than the best does but by chance (F
test of nested models). Every other that is no multiple must be less likely by far, else noise hides which it is. Noise
repeats by chance: a period's lines must stand above the bins beside them (F test along the band, joined by Fisher's sum
of logarithms), at a chance that all lags looked at share.
"""

import math

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter1d, uniform_filter1d
from scipy.signal import find_peaks
from scipy.special import betainc, fdtri, gammaincc

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.bands.disturbing_lines import LEFT_OUT_OF_PERIOD, bins_taken
from tpjb_ident.bands.samples import Samples, interpolated
from tpjb_ident.phasors.lines import Line

#: Periods that a record must hold.
_MIN_PERIODS = 3
#: Chance that a record without period shows one, and that its noise hides a period behind a multiple of it.
_CHANCE = 1e-3
#: Likelihood over that of any other lag that is no multiple, and part of a cycle at the band's top within which two
#: lags are one.
_CLEAR, _ONE_LAG = 20.0, 1 / 4
#: Part of a cycle at the top of the band by which lags are first moved, and of the last multiple's in the end.
_FIRST_MOVE, _LAST_MOVE = 1 / 8, 1 / 64
#: Points of a cycle at the top of the band from which splines leave nothing of note [share].
_POINTS, _NOTHING = 32, 1e-5
#: Share of the bins' degrees of freedom that two windows leave to a difference of variances.
_WINDOWED = 0.4
#: Bins on either side of a line that tell the noise there, and so many at least for one line or some together.
_BESIDE = 4
#: Phase [rad] by which the top of the band may run off over the record before it is resampled.
_MAX_SLIP = 0.01
#: Power within a band, over a cycle of its lowest frequency and of what is usual, below which nothing drives.
_QUIET = 0.05


def driven_part(clean: Samples, band: tuple[float, float]) -> slice:
    """Samples from where the drive of a band begins to where it ends, of a record without shaft and mains."""
    frequency = np.fft.rfftfreq(2 * clean.length, 1 / clean.rate)
    rows = _filtered(clean.signals(), (frequency > band[0]) & (frequency < band[1]))
    power = uniform_filter1d(np.sum(rows**2, axis=0), int(clean.rate / band[0]))
    driven = np.flatnonzero(power >= _QUIET * np.quantile(power, 0.9))
    return slice(int(driven[0]), int(driven[-1]) + 1)


def find_period(clean: Samples, band: tuple[float, float], lines: tuple[Line, ...], most: float) -> float | None:
    """Smallest period in samples of what excites the band, None where it does not repeat.

    `lines` of shaft and mains are taken off; `most` is the share of the power that may not repeat.
    """
    n, step = clean.length, clean.rate / clean.length
    frequency = np.asarray(0.5 * step * np.arange(n + 1), dtype=float)
    inside = (
        (frequency > band[0] - 2 * step) & (frequency < band[1] + 2 * step) & ~bins_taken(frequency, lines, 1 / step)
    )
    window = np.hanning(n)  # under which the lines of an excitation end with the band
    rows = _filtered(clean.signals() * window, inside)
    first = int(clean.rate / band[0])
    finer = math.ceil(_POINTS * band[1] / clean.rate)
    pairs = (rows * window, rows * window), (rows**2, window[None] ** 2)
    alike, power = (_correlation(*pair, finer) for pair in pairs)
    part = alike[::finer][first : n // _MIN_PERIODS + 1]
    lags = find_peaks(part, height=0.0)[0] + first
    if not len(lags):
        return None
    periods, remainder = _combed((alike, power), lags, clean.rate / band[1], finer)
    freedom = _WINDOWED * inside.sum() * (1 - periods / n)
    least = freedom[np.argmin(remainder)]
    more = np.maximum(freedom - least, 1.0)
    allowed = (least + more * fdtri(more, least, 1 - _CHANCE)) / (least + more)
    k = int(np.argmax(remainder <= remainder.min() * allowed))
    ratio = periods / periods[k]
    foreign = np.abs(ratio - np.round(ratio)) * periods[k] > _ONE_LAG * clean.rate / band[1]
    unclear = (freedom * np.log(remainder / remainder[k]) < math.log(_CLEAR))[foreign].any()
    if unclear or remainder[k] > most or _chance_of_noise(clean, float(periods[k]), band, lines) > _CHANCE / len(part):
        return None
    return float(periods[k])


def _filtered(rows: FloatArray, inside: BoolArray) -> FloatArray:
    """Rows (k, n) of the frequencies to keep alone, (n + 1,) of them."""
    n = rows.shape[1]
    return np.fft.irfft(np.where(inside, np.fft.rfft(rows, 2 * n, axis=1), 0.0), axis=1)[:, :n]


def _correlation(first: FloatArray, second: FloatArray, finer: int) -> FloatArray:
    """Sum over rows (k, n) of their products at lags of both signs alike, `finer` of them a sample, (finer n,)."""
    n = first.shape[1]
    spectra = [np.fft.rfft(rows, 2 * n, axis=1) for rows in (first, second)]
    product = np.sum(spectra[0] * spectra[1].conj(), axis=0).real
    return np.fft.irfft(product, 2 * n * finer)[: n * finer]


def _combed(
    pair: tuple[FloatArray, FloatArray], lags: IntArray, cycle: float, finer: int
) -> tuple[FloatArray, FloatArray]:
    """Periods near lags (k,) which leave least, and the share that they leave at all their multiples together, (k,).

    `pair` (finer n,): correlation over the lag, and power of the stretches that overlap; `cycle` [samples] of the
    band's top. Ever more multiples tell by ever finer moves.
    """
    splines = [spline_filter1d(values) for values in pair]
    n = len(pair[0]) // finer
    periods, remainder = lags.astype(float), np.ones(len(lags))
    move, active = _FIRST_MOVE * cycle, np.arange(len(lags))
    while len(active):
        near = periods[active, None] + move * np.array([-1.0, 0.0, 1.0])
        multiples = np.arange(1, int(max(min(_FIRST_MOVE * cycle / move, n / near.min()), 1)) + 1)
        at = near[:, :, None] * multiples
        # beyond the record nothing overlaps
        product, power = (
            map_coordinates(s, [finer * at], mode="constant", prefilter=False).sum(axis=2) for s in splines
        )
        low, middle, high = (1 - product / power).T
        bend = np.maximum(low - 2 * middle + high, 1e-300)
        periods[active] += move * np.clip(0.5 * (low - high) / bend, -1.0, 1.0)
        remainder[active] = np.maximum(middle, _NOTHING)
        move /= 2
        active = active[move * n > _LAST_MOVE * cycle * periods[active]]
    return periods, remainder


def _chance_of_noise(clean: Samples, period: float, band: tuple[float, float], lines: tuple[Line, ...]) -> float:
    """Chance with which noise stands as high at the lines of a period, above the bins beside them."""
    periodic = resampled(clean, period, band[1])
    count = periodic.length // round(period)
    step = periodic.rate / max(periodic.length, 1)
    if count < _MIN_PERIODS:
        return 1.0
    power = np.sum(np.abs(np.fft.rfft(periodic.signals(), axis=1)) ** 2, axis=0)
    bins = np.arange(len(power))
    frequency = np.asarray(step * bins, dtype=float)
    inside = (frequency > band[0] - 0.5 * step) & (frequency < band[1] + 0.5 * step)
    away = np.abs((bins + count // 2) % count - count // 2)
    at_lines = inside & (away == 0) & ~bins_taken(frequency, lines, 1 / (count * step), LEFT_OUT_OF_PERIOD)
    between = inside & (away > 0) & (away <= _BESIDE)
    block = (bins + count // 2) // (count * math.ceil(_BESIDE / min(count - 1, 2 * _BESIDE)))
    sums = [np.bincount(block, weights) for weights in (at_lines, between, at_lines * power, between * power)]
    held, spare, high, noise = np.array(sums)[:, (sums[0] > 0) & (sums[1] > 0)]
    chances = betainc(spare, held, noise / np.maximum(noise + high, 1e-300))
    return float(gammaincc(max(len(chances), 1e-9), -np.log(np.maximum(chances, 1e-300)).sum()))


def resampled(samples: Samples, period: float, top: float) -> Samples:
    """The record cut to whole periods of a whole number of samples each."""
    q = round(period)
    count = int((samples.length + 1e-6 * period) // period)
    slip = 2 * np.pi * top / samples.rate * abs(period - q) * count
    if slip <= _MAX_SLIP:
        count = samples.length // q
        return samples.mapped(lambda rows: rows[:, : count * q])
    at = np.asarray(np.arange(count * q) * (period / q), dtype=float)
    return samples.mapped(lambda rows: interpolated(rows, at), samples.rate * q / period)
