"""The whole record in one fit: its phasors, and what the lines leave of it as a spectrum.

Windows tell outliers from the rest; only the whole record tells lines one resolution cell apart, and how large the
noise is in the cells around a line.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.run import Run
from tpjb_ident.phasors.bad_samples import white_noise
from tpjb_ident.phasors.channel_times import device_readers
from tpjb_ident.phasors.frequency import exact_frequencies
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.lines import HIGHEST, LineSet
from tpjb_ident.phasors.run_data import RunPhasors

#: Noise of a line is looked at in the bins so far from it [1 / record length],
_BESIDE = (3, 14)
#: and farther than this from all other lines.
_CLEAR_OF = 1.2
#: Share of the largest difference between readings below which one is a residue of arithmetic, no converter's step;
#: largest square of a line by rounding, over the third power of the step over the amplitude (4 / pi^4 over 2^0.5).
_NO_STEP, _LARGEST = 1e-6, 0.029
#: Order of the polynomial that takes slow movements of the shaft along: a window has 1.
_DRIFT_ORDER = 3


@dataclass(frozen=True)
class WholeRecord:
    """One device's record, fitted as one window."""

    lines: LineSet
    places: list[int]  #: of its channels among those of the run
    z: ComplexArray  #: (n_whole_lines, n_channels): NaN where the rate does not show a line
    used: FloatArray  #: (n_channels,): share of the samples that are neither missing nor bad
    residual: FloatArray  #: (n_channels, n), SI: bad samples are zero
    rate: float
    start: float
    rounding: FloatArray  #: (n_channels,), SI^2: largest square that rounding puts on a line

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.residual.shape[1] / self.rate

    @cached_property
    def spectrum(self) -> ComplexArray:
        """Amplitudes of the residual with phases from t = 0, (n_bins, n_channels), a bin every 1 / duration."""
        used = self.residual.shape[1] * np.where(self.used > 0, self.used, np.nan)
        bins = np.fft.rfft(self.residual, axis=1).T * (2 / used)
        turn = np.exp(-2j * np.pi * np.arange(len(bins)) * self.start / self.duration) if self.start else 1.0
        return bins * np.reshape(turn, (-1, 1))


def hann_amplitude(spectrum: ComplexArray) -> FloatArray:
    """Amplitudes (n_bins, n_channels) with Hann's window, as a sum of neighbours; zero where there is none."""
    bins = np.nan_to_num(spectrum)
    amplitude = np.zeros(bins.shape)
    amplitude[1:-1] = np.abs(bins[1:-1] - 0.5 * (bins[:-2] + bins[2:]))
    return amplitude


def noise_floor(amplitude: FloatArray) -> FloatArray:
    """Noise around every bin of a spectrum (n_bins,): a filling-up by splines leaves none at high frequencies."""
    return median_filter(amplitude, size=min(61, max(len(amplitude) // 10, 3)), mode="nearest")


def whole_records(run: Run, result: RunPhasors) -> tuple[WholeRecord, ...]:
    """Fit every device's record (its stretch of one excitation) in one, with its lines where the windows show them."""
    records = []
    for reader in device_readers(run):
        names = [c.name for c in reader.channels]
        places = [k for k, c in enumerate(result.channels) if c.name in names]
        frequencies = exact_frequencies(result, places, reader.rate)
        first, stop = 0, reader.length
        if result.span is not None:
            first, stop = np.minimum(reader.first_samples(np.array(result.span)), reader.length).tolist()
        time, rows = reader.read(first, stop)
        start = first / reader.rate if time is None or not np.isfinite(time[0]) else float(time[0])
        records.append(fitted_whole(rows, start, reader.rate, result.lines, frequencies, places))
    return tuple(records)


def fitted_whole(
    rows: FloatArray, start: float, rate: float, lines: LineSet, frequencies: FloatArray, places: list[int]
) -> WholeRecord:
    """Fit all samples (n_channels, n) of a device in one; times that stray from an even grid are taken for even."""
    shown = frequencies < HIGHEST * rate
    fitter = LineFitter(rows.shape[1], rate, frequencies[shown], _DRIFT_ORDER)
    fit, residual = fitter.fit_with_residual(rows[:, None], np.array([start]))
    z = np.full((len(shown), len(places)), np.nan + 0j)
    z[shown] = fit.z[0]
    return WholeRecord(lines, places, z, 1 - fit.lost[0], residual[:, 0], rate, start, _rounding(rows))


def _rounding(rows: FloatArray) -> FloatArray:
    """Largest square that a converter's steps put on a line of readings (n_channels, n): of a Bessel function.

    Noise dithers them: of one of half a step nothing is left.
    """
    moves = np.abs(np.diff(rows))
    largest = np.nanmax(moves, axis=1, keepdims=True, initial=0.0)
    step = np.where(moves > _NO_STEP * largest, moves, largest).min(axis=1) + np.finfo(float).tiny
    noise = np.array([white_noise(row) for row in np.nan_to_num(rows)])
    dithered = np.exp(-((2 * np.pi * noise / step) ** 2))
    return _LARGEST * dithered * step**3 / np.fmax(np.std(rows, axis=1), step)


def with_record(result: RunPhasors, records: tuple[WholeRecord, ...]) -> RunPhasors:
    """The run with the phasors of its whole record, and what that leaves around every line."""
    channels = len(result.channels)
    z, rounding = np.full((len(records[0].z), channels), np.nan + 0j), np.zeros(channels)
    for record in records:
        z[:, record.places], rounding[record.places] = record.z, record.rounding
    residual = tuple(_residual_bins(records, i, channels) for i in range(len(z)))
    return replace(result, record=z, residual=residual, rounding=rounding)


def _residual_bins(records: tuple[WholeRecord, ...], line: int, channels: int) -> ComplexArray:
    """Residual (n_bins, n_channels) in the bins around a line, those of other lines left out."""
    first = records[0]
    frequencies = first.lines.whole_frequencies * first.duration
    offsets = np.arange(_BESIDE[0], _BESIDE[1] + 1)
    bins = round(frequencies[line]) + np.concatenate([-offsets[::-1], offsets])
    free = np.abs(bins[:, None] - np.delete(frequencies, line)).min(axis=1, initial=np.inf) > _CLEAR_OF
    bins = bins[free & (bins > 0) & (bins < len(first.spectrum))]
    residual = np.full((len(bins), channels), np.nan + 0j)
    for record in records:
        at = np.round(bins * (record.duration / first.duration)).astype(int)
        within = at < len(record.spectrum)
        residual[np.ix_(within, record.places)] = record.spectrum[at[within]]
    return residual
