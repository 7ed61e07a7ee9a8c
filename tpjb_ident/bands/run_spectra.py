"""One broadband run as phasors: of every period of a periodic excitation, or of the whole record.

A periodic excitation needs no window and measures its own noise. Its generator has a clock of its own, so that a period
need not hold a whole number of samples; the record is then resampled, all channels alike, to one that does.

What a period leaves is what the record changes from any stretch to its repeats. Beats of few tones all but repeat
sooner, and multiples leave no more: the period is the smallest that leaves no more than the best does but by chance (F
test of nested models). Every other that is no multiple must be less likely by far, else noise hides which it is. Noise
repeats by chance: a period's lines must stand above the bins beside them (F test along the band, joined by Fisher's sum
of logarithms), at a chance that all lags looked at share.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter1d, uniform_filter1d
from scipy.special import betainc, fdtri, gammaincc

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.bands.samples import (
    LEFT_OUT,
    LEFT_OUT_OF_PERIOD,
    Samples,
    bins_taken,
    find_disturbances,
    interpolated,
    read_samples,
    without_disturbances,
    without_periodic,
)
from tpjb_ident.conditions import Conditions, merged
from tpjb_ident.phasors.compensation import compensated, filled_channels, unstated_filters
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_data import SHORT, PhasorSettings, RunPhasors, beginning_of
from tpjb_ident.phasors.whole_record import local_maxima
from tpjb_ident.runs.point_data import mean_temperatures

#: Periods that a record must hold.
_MIN_PERIODS = 3
#: Periods by which one shows: what is held so often and no more is told with its length.
_REPEATED = 2
#: Chance that a record without period shows one, and that its noise hides a period behind a multiple of it.
_CHANCE = 1e-3
#: Likelihood over that of any other lag that is no multiple, and part of a cycle at the band's top within which two
#: lags are one.
_CLEAR, _ONE_LAG = 20.0, 1 / 4
#: Part of a cycle at the top of the band by which lags are first moved, and of the last multiple's in the end.
_FIRST_MOVE, _LAST_MOVE = 1 / 8, 1 / 64
#: Points of a cycle at the top of the band from which splines leave nothing of note [share].
_POINTS, _UNSEEN = 32, 1e-5
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
    frequency = 0.5 * step * np.arange(n + 1)
    inside = (
        (frequency > band[0] - 2 * step) & (frequency < band[1] + 2 * step) & ~bins_taken(frequency, lines, 1 / step)
    )
    window = np.hanning(n)  # under which the lines of an excitation end with the band
    rows = _filtered(clean.signals() * window, inside)
    first = int(clean.rate / band[0])
    finer = math.ceil(_POINTS * band[1] / clean.rate)
    pairs = (rows * window, rows * window), (rows**2, window[None] ** 2)
    alike, power = (_correlation(*pair, finer) for pair in pairs)
    part = alike[::finer][first : n // _REPEATED + 1]
    lags = local_maxima(part, 0.0) + first
    if not len(lags):
        return None
    periods, remainder = _combed((alike, power), lags, clean.rate / band[1], finer)
    freedom = _WINDOWED * inside.sum() * (1 - periods / n)
    least = freedom[np.argmin(remainder)]
    more = np.maximum(freedom - least, 1.0)
    allowed = (least + more * fdtri(more, least, 1 - _CHANCE)) / (least + more)
    k = np.argmax(remainder <= remainder.min() * allowed)
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
        product, power = (map_coordinates(s, [finer * at], prefilter=False).sum(axis=2) for s in splines)
        low, middle, high = (1 - product / power).T
        bend = np.maximum(low - 2 * middle + high, 1e-300)
        periods[active] += move * np.clip(0.5 * (low - high) / bend, -1.0, 1.0)
        remainder[active] = np.maximum(middle, _UNSEEN)
        move /= 2
        active = active[move * n > _LAST_MOVE * cycle * periods[active]]
    return periods, remainder


def _chance_of_noise(clean: Samples, period: float, band: tuple[float, float], lines: tuple[Line, ...]) -> float:
    """Chance with which noise stands as high at the lines of a period, above the bins beside them."""
    periodic = resampled(clean, period, band[1])
    count = periodic.length // round(period)
    step = periodic.rate / max(periodic.length, 1)
    if count < _REPEATED:
        return 1.0
    power = np.sum(np.abs(np.fft.rfft(periodic.signals(), axis=1)) ** 2, axis=0)
    bins = np.arange(len(power))
    frequency = step * bins
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
    at = np.arange(count * q) * (period / q)
    return samples.mapped(lambda rows: interpolated(rows, at), samples.rate * q / period)


#: Share of the power that a period may leave where none is stated.
_LEFT = 0.5
#: Share of a period's largest line, in motion, force or command, from which another one is driven; below it those of
#: the command are, one after the other, down to a step by so much, or to so little.
_DRIVEN, _STEP, _NOTHING = 0.1, 3.0, 1e-3
#: Lines of a period are looked at up to so many times the band's upper end.
_WIDE = 1.4
#: Kinds that may repeat themselves, and whose records may begin and end in motion; a hammer waits for rest.
OPEN_ENDS = ("multisine", "random", "sweep")


def is_broadband(run: Run) -> bool:
    """Whether a run is excited over a band, not by a sine."""
    return run.excitation_kind != "sine"


@dataclass(frozen=True, repr=False, kw_only=True)
class RunSpectra(RunPhasors):
    """One run over the band: lines are bins, windows are periods, or the whole record is one."""

    command: ComplexArray | None  #: (n_windows, n_bins, 2) complex
    disturbed: BoolArray  #: (n_bins,): bins that lines of shaft or mains may have spoiled
    disturbances: tuple[Line, ...]
    period: float | None
    clean_rms: float = 0.0  #: m: of the motion without disturbing lines
    peak: float = 0.0  #: m: largest motion
    #: (2, 2): unit vector of the drive, and how far it goes to its side: as long where to that only, 0 where to both
    sides: FloatArray = field(default_factory=lambda: np.zeros((2, 2)))
    by_time: RunSpectra | None = None  #: of the record times the time from its middle [s]
    wide: RunSpectra | None = None  #: of a period, and beyond the band, where the film answers
    #: by order n the phasors (1, n_bins, ..) of the record turned n times as fast as the shaft: at f, what is at f - nX
    turned: dict[int, RunSpectra] = field(default_factory=dict)

    @property
    def frequencies(self) -> FloatArray:
        """Of the bins, (n_bins,) [Hz]."""
        return self.lines.frequencies

    @property
    def shaft(self) -> float:
        """Speed at which the shaft is seen to turn, zero where it does not show [Hz]."""
        return next((line.frequency for line in self.disturbances if line.name == "1X"), 0.0)

    @cached_property
    def driven(self) -> BoolArray:
        """Bins (n_bins,) that the excitation alone drives; of a period the film fills others by its curvature."""
        if self.period is None:
            return ~self.disturbed
        drives = [self.displacement, self.force] if self.command is None else [self.command]
        sizes = [np.linalg.norm(drive.mean(axis=0), axis=1) * ~self.disturbed for drive in drives]
        share = np.max([size / max(size.max(), 1e-300) for size in sizes], axis=0)
        if self.command is None:
            return share >= _DRIVEN
        falling = np.sort(share)[::-1]
        ends = np.flatnonzero((falling[1:] < _DRIVEN) & (falling[:-1] > _STEP * falling[1:]))
        return share >= max(falling[ends[0]] if len(ends) else 0.0, _NOTHING)

    @property
    def amplitude(self) -> float:
        """Of a sine that moves the shaft as much as all bins of the band together do [m]."""
        return float(np.sqrt(np.sum(np.mean(np.abs(self.displacement) ** 2, axis=0))))

    @property
    def rms(self) -> float:
        """Rms of the motion that the excitation makes [m]."""
        if self.period is None:
            return self.clean_rms
        return float(np.linalg.norm(self.displacement.mean(axis=0)[self.driven]) / np.sqrt(2))


def run_spectra(
    run: Run, band: tuple[float, float], seconds: float, settings: PhasorSettings, fast: Mapping[str, float]
) -> RunSpectra:
    """Transform the first `seconds` of a run over a band [Hz]; `fast`: rates of the channels' clocks, relative."""
    with run.opened():
        slower = filled_channels(run)
        samples = read_samples(run, seconds, fast, band[1])
        temperatures = mean_temperatures(run)
        temperature = beginning_of(run, SHORT).mean_temperature() or np.nan
    lines = find_disturbances(samples, run.point.shaft_speed_hz, settings.mains, band[1])
    cut, period = _period(run, samples, band, lines)
    length, width = (cut.length, LEFT_OUT) if period is None else (period, LEFT_OUT_OF_PERIOD)
    clean = without_disturbances(cut, lines, period)
    seconds, mean, motion = length / clean.rate, samples.rows.mean(axis=1), _motion(clean)
    unstated = () if slower or samples.is_finer else _unstated_filters(clean, band[1], period)

    def transformed(record: Samples, places: IntArray) -> RunSpectra:
        z = _bins(record.rows, length, places)
        frequencies = np.fft.rfftfreq(length, 1 / clean.rate)[places]
        none = np.zeros((len(z), len(mean)))
        spectra = RunSpectra(
            run.id,
            run.point,
            run.excitation_direction,
            LineSet(tuple(Line("excitation", f) for f in frequencies.tolist()), (), (), run.point.shaft_speed_hz),
            seconds * np.arange(float(len(z))),
            seconds,
            record.channels,
            z,
            np.tile(mean, (len(z), 1)),
            none,
            none,
            run.housing_mass,
            merged(record.conditions, unstated),
            temperatures=temperatures,
            temperature=temperature,
            command=None if record.command is None else _bins(record.command, length, places),
            disturbed=bins_taken(frequencies, lines, seconds, width),
            disturbances=lines,
            period=None if period is None else seconds,
            clean_rms=motion[0],
            peak=motion[1],
            sides=motion[2],
        )
        return compensated(spectra, run, slower, settings.delays)

    places = _places(clean.rate, length, band)
    spectra = transformed(clean, places)
    if period is not None:
        beyond = _places(clean.rate, length, (0.0, _WIDE * band[1]))
        return replace(spectra, wide=_turned(transformed(clean, beyond), clean, beyond))
    spectra = _turned(spectra, clean, places)
    time = (np.arange(clean.length) - 0.5 * (clean.length - 1)) / clean.rate  # from the middle of the record
    return replace(spectra, by_time=transformed(clean.mapped(lambda rows: rows * time), places))


def _turned(spectra: RunSpectra, samples: Samples, places: IntArray) -> RunSpectra:
    """The spectra with those of the record turned as fast as the shaft and twice as fast, where the shaft shows."""
    turned = {}
    orders = (1, 2) if spectra.period is not None else (2,)  # what is at f - X meets lines of a period alone
    for order in orders if spectra.shaft else ():
        wave = np.exp(2j * np.pi * order * spectra.shaft / samples.rate * np.arange(samples.length))
        bins = np.fft.fft(samples.rows * wave, axis=1)[:, places * len(spectra.start)]
        turned[order] = replace(spectra, z=bins.T[None] * (2 / samples.length))
    return replace(spectra, turned=turned)


def _unstated_filters(samples: Samples, top: float, period: int | None) -> Conditions:
    """What the noise says of filters: above the band, or in all of what a period leaves."""
    noise = without_periodic(samples.rows, period) * np.hanning(samples.length)
    lowest = _WIDE * top if period is None else 0.0
    spectrum = np.fft.rfft(noise, axis=1).T
    return unstated_filters(samples.channels, spectrum, samples.length / samples.rate, (lowest, top))


def _motion(samples: Samples) -> tuple[float, float, FloatArray]:
    """Rms and peak of the motion [m], and the sides to which the drive goes, as of `RunSpectra`."""
    motion = samples.plane("displacement", samples.rows.T).real.T
    size = np.linalg.norm(motion, axis=0)
    drive = motion if samples.command is None else samples.command
    axis = np.linalg.eigh(drive @ drive.T)[1][:, -1]
    along = axis @ drive
    skew = np.mean(along**3) / max(np.mean(np.abs(along) ** 3), 1e-300)
    return float(np.sqrt(np.mean(size**2))), float(size.max()), np.array([axis, skew * axis])


def _period(
    run: Run, samples: Samples, band: tuple[float, float], lines: tuple[Line, ...]
) -> tuple[Samples, int | None]:
    """The driven whole periods of a record, and their samples; all of it and None where it does not repeat itself."""
    if run.excitation_kind not in OPEN_ENDS:
        return samples, None
    is_stated = run.excitation_kind == "multisine"
    clean = without_disturbances(samples, lines)
    part = driven_part(clean, band)
    clean, driven = (record.mapped(lambda rows: rows[:, part]) for record in (clean, samples))
    period = find_period(clean, band, lines, 1.0 if is_stated else _LEFT)
    if period is not None and _MIN_PERIODS * period <= clean.length:
        return resampled(driven, period, band[1]), round(period)
    if is_stated:
        shown = "its period is not found"
        if period is not None:
            shown = f"the record holds its period of {period / clean.rate:.4g} s {clean.length / period:.2g} times"
        text = f"a multi-sine, but {shown}; three periods are needed"
        cure = 'Record longer; or state excitation = "random" if it does not repeat'
        raise refuse(run.file, "excitation", text, cure, run.id)
    return samples, None


def _places(rate: float, length: int, band: tuple[float, float]) -> IntArray:
    """Numbers of the bins of the band."""
    frequency = np.fft.rfftfreq(length, 1 / rate)
    low, high = band
    edge = 0.02 * rate / length  # clocks of runs differ by some ppm
    return np.flatnonzero((frequency >= low - edge) & (frequency <= high + edge) & (frequency > 0))


def _bins(rows: FloatArray, length: int, places: IntArray) -> ComplexArray:
    """Phasors (n_windows, n_bins, m) of rows (m, n) in stretches of `length` samples."""
    folded = rows.reshape(len(rows), -1, length)
    spectra = np.fft.rfft(folded, axis=2)[:, :, places] * (2.0 / length)
    return spectra.transpose(1, 2, 0)
