"""The whole record in one fit: its phasors, and what the lines leave of it as a spectrum.

Windows tell outliers from the rest; only the whole record tells lines one resolution cell apart, and how large the
noise is in the cells around a line.

Lines in a record that nobody mentioned: other excitations, a neighbouring machine, a loose cable, a beat of drives.
They are found in what the fit of the known lines leaves of the forces and displacements, and fitted along. Several
excitation frequencies in one record show up here too: each run of the manifest then gives its own line, the others are
fitted beside it. Within the resolution of a window windows see a beat, which looks like a drive that wanders, or like
clocks that differ. The whole record tells a line from that down to one resolution cell: beside the excitation and its
slow change, one more line explains what is left.

The mains frequency is as the manifest states it, else as the records show it. It matters where an excitation stands
on 50 or 60 Hz; elsewhere a mains line of either frequency is found like any other. So only then a few records are
looked at, those in which nothing else stands there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from rigdata.campaign import Campaign
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.phasors.frequency import exact_frequencies
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.lines import HIGHEST, LineSet
from tpjb_ident.phasors.run_data import RunPhasors, device_readers

#: Noise of a line is looked at in the bins so far from it [1 / record length],
_BESIDE = (3, 14)
#: and farther than this from all other lines.
_CLEAR_OF = 1.2
#: Share of the largest difference between readings below which one is a residue of arithmetic, no converter's step;
#: largest square of a line by rounding, over the third power of the step over the amplitude (4 / pi^4 over 2^0.5).
_NO_STEP, _LARGEST = 1e-6, 0.029
#: Steps from which a second difference is noise enough.
_DITHERED = 3.0
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
        frequencies = exact_frequencies(replace(result, sample_rate=reader.rate), places)
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


def _bend(row: FloatArray, step: float) -> float:
    """Mean square of the second differences of readings (n,) in steps: of whole steps a median tells nothing."""
    bends = np.diff(row, 2)
    bends /= step
    np.clip(bends, -_DITHERED, _DITHERED, out=bends)
    return float(np.nansum(bends**2) / len(bends)) if len(bends) else 0.0


def _rounding(rows: FloatArray) -> FloatArray:
    """Largest square that a converter's steps put on a line of readings (n_channels, n): of a Bessel function.

    Noise dithers them: of one of half a step nothing is left. What the steps themselves add to it dithers nothing.
    """
    moves = np.abs(np.diff(rows))
    largest = np.nanmax(moves, axis=1, keepdims=True, initial=0.0)
    step = np.where(moves > _NO_STEP * largest, moves, largest).min(axis=1) + np.finfo(float).tiny
    noise = np.array([_bend(row, size) for row, size in zip(rows, step)]) / 6 - 1 / 12
    dithered = np.exp(-((2 * np.pi) ** 2) * np.maximum(noise, 0.0))
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


#: A line stands this many times above the noise floor around it,
_PROMINENCE = 15.0
#: has at least this share of the excitation's amplitude (less cannot bend its phasor),
MIN_SHARE = 2e-3
#: and lies below this many times the highest excitation frequency.
REACH = 4.0
MAX_LINES = 10
#: Bins of the Hann window's main lobe about a known line that tell nothing.
_LOBE = 4.0


def unexpected_lines(
    records: tuple[WholeRecord, ...], result: RunPhasors, images: FloatArray
) -> tuple[tuple[float, ...], Conditions]:
    """Frequencies of lines beside those of the windows [Hz], and what to say about the ones that nobody expects.

    `images` (m,): frequencies at which lines stand that are none [Hz].
    """
    listed_lines = result.lines.whole_frequencies
    frequencies: list[float] = []
    for quantity in ("force", "displacement"):
        places = result.pick(quantity)
        sizes = np.linalg.norm(result.z[:, : len(result.lines.excitation)][:, :, places], axis=2)
        if np.isfinite(sizes).any():
            smallest = MIN_SHARE * np.nanmedian(sizes)
            for record in records:
                columns = [k for k, place in enumerate(record.places) if place in places]
                frequencies += _peaks(record, columns, np.append(listed_lines, frequencies), smallest)
    top = REACH * max(result.lines.driven)
    lobe = _LOBE / records[0].duration
    frequencies = [f for f in frequencies if f < top and np.all(np.abs(images - f) > lobe)]
    strange = tuple(sorted(f for f in frequencies if f not in listed_lines))[:MAX_LINES]
    if not strange:  # what leaks from lines that nobody expects makes faint ones stand out
        return tuple(sorted(set(frequencies))), ()
    conditions = [lines_beside(strange)]
    for line in result.lines.excitation:
        coincident = [f for f in strange if abs(2 * f - line.frequency) < 0.05]
        if coincident:
            conditions.append(
                Condition(
                    "harmonic on excitation line",
                    f"the second harmonic of the line at {coincident[0]:.4g} Hz falls on the excitation",
                )
            )
    return strange, tuple(conditions)


def lines_beside(frequencies: tuple[float, ...]) -> Condition:
    """What to say of lines that nobody expects."""
    listed = ", ".join(f"{f:.4g}" for f in frequencies)
    return Condition("unexpected lines", f"lines at {listed} Hz; fitted along")


def _peaks(record: WholeRecord, columns: list[int], lines: FloatArray, smallest: float) -> list[float]:
    """Frequencies [Hz] of lines above `smallest` in some channels: faint ones fitted, and peaks of the residual."""
    amplitude = np.linalg.norm(hann_amplitude(record.spectrum[:, columns]), axis=1)
    step = 1 / record.duration
    least = np.maximum(_PROMINENCE * noise_floor(amplitude), smallest)
    tops = local_maxima(amplitude, least)
    tops = tops[np.abs(tops[:, None] * step - [0.0, *lines]).min(axis=1) >= _LOBE * step]
    peaks = [float(i * step + step * vertex(amplitude[i - 1 : i + 2])) for i in tops]
    faint = record.lines.faint
    sizes = np.linalg.norm(record.z[len(record.z) - len(faint) :, columns], axis=1)
    at = np.minimum(np.round([line.frequency * record.duration for line in faint]).astype(int), len(least) - 1)
    return peaks + [line.frequency for line, size, limit in zip(faint, sizes, least[at]) if size > limit]


def local_maxima(values: FloatArray, least: FloatArray | float = -np.inf) -> IntArray:
    """Where values of a least size top their neighbours, (m,): `scipy.signal` takes longer to import than this."""
    is_top = (values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])
    return 1 + np.flatnonzero(is_top & (values >= least)[1:-1])


def vertex(three: FloatArray) -> float:
    """Offset of the top of the parabola through the logarithms of three neighbours [bins]."""
    a, b, c = np.log(np.maximum(three, np.finfo(float).tiny))
    curvature = a - 2 * b + c
    return float(0.5 * (a - c) / curvature) if curvature < 0 else 0.0


#: Windows that tell a line beside the excitation from its slow change, at least.
_LEAST = 6
#: Windows that its slow change and a line take of them,
_TAKEN = 4
#: distances from the excitation at which a line is looked for [1 / record length]: a bound at one would hold a line
#: there that stands at 0.9,
_NEAREST, _FARTHEST, _STEP = 0.75, 4.5, 0.1
#: power over that of the noise that it must explain, a channel,
_CLEAR_POWER = 25.0
#: and share of it that may be left a window: sidebands of a drive that changes come in pairs, steps leave more.
_LEFT = 0.004


def near_line(result: RunPhasors, driven: int, duration: float) -> tuple[float, float] | None:
    """Frequencies [Hz] of an excitation line of a record of `duration` [s] and of a line close beside it, if there is.

    Its beat shows in the windows' phasors. A drive that is off its set point, or changes slowly, has none.
    """
    frequency = result.lines.excitation[driven].frequency
    others = (np.delete(result.lines.frequencies, driven) - frequency) * duration
    noise = result.noise
    live = np.isfinite(noise)
    z = result.z[:, driven, live] / noise[live]
    good = np.isfinite(z).all(axis=1)
    if good.sum() < _LEAST:
        return None
    windows, time = z[good], (result.start[good] + 0.5 * result.length) / duration
    count, channels = windows.shape
    smallest = max(_CLEAR_POWER * channels, count * (MIN_SHARE * np.median(np.linalg.norm(windows, axis=1))) ** 2)
    if _left(windows, time, np.zeros((1, 1)))[0] < smallest:
        return None
    # beyond half a turn from window to window phases say nothing
    alone = _least(windows, time, np.arange(-0.45 * count, 0.45 * count, _STEP)[:, None])
    distances = np.arange(-_FARTHEST, _FARTHEST, _STEP)
    for drive in (0.0, float(alone[0])):
        apart = np.abs(np.subtract.outer(drive + distances, np.append(drive, others))).min(axis=1) >= _NEAREST
        pair = _least(windows, time, drive + np.multiply.outer(distances[apart], [0.0, 1.0]))
        if drive:
            pair = minimize(lambda places: _left(windows, time, places[None])[0], pair, method="Nelder-Mead").x
        remainder = float(_left(windows, time, pair[None])[0])
        power = _left(windows, time, np.array([alone, pair[:1]])).min() - remainder
        is_told = power > smallest and remainder - count * channels < _LEFT * (count - _TAKEN) * power
        if is_told and abs(pair[1] - pair[0]) > _NEAREST - 0.5 * _STEP:  # at the bound it is the drive's own change
            exact, near = (frequency + pair / duration).tolist()
            return exact, near
    return None


def _left(windows: ComplexArray, time: FloatArray, places: FloatArray) -> FloatArray:
    """Power that a drive which changes slowly, and a steady line beside it, leave of windows (n, m), (k,).

    `time` (n,) over the record's length, `places` (k, 1 or 2) of drive and line from the set point [1 / record length].
    """
    waves = np.exp(2j * np.pi * time[:, None] * places[:, None, :])
    basis = np.linalg.qr(np.concatenate([np.vander(time - 0.5, 3) * waves[..., :1], waves[..., 1:]], axis=2))[0]
    explained = np.sum(np.abs(basis.conj().swapaxes(1, 2) @ windows) ** 2, axis=(1, 2))
    return np.sum(np.abs(windows) ** 2) - explained


def _least(windows: ComplexArray, time: FloatArray, places: FloatArray) -> FloatArray:
    """Places (1 or 2,) that leave least: of some (k, 1 or 2), then with the last one between these."""
    for step in _STEP / 4.0 ** np.arange(5):
        best = places[np.argmin(_left(windows, time, places))]
        places = np.tile(best, (9, 1))
        places[:, -1] += step * np.linspace(-1.0, 1.0, 9)
    return best


#: Excitations this near to one of them make the question matter [Hz].
_NEAR = 0.3
#: Runs and samples that are looked at.
_MAX_RUNS, _LOOK = 6, 2**14
#: A line stands this many times above what is around it,
_CLEAR = 6.0
#: other lines are farther away than this [Hz].
_APART = 1.0


def mains_frequency(campaign: Campaign, usual: float) -> float:
    """Frequency of the mains [Hz]."""
    if campaign.mains is not None:
        return campaign.mains
    driven = np.array([run.point.excitation_hz for run in campaign.of_kind("dynamic")])
    coincident = [c for c in MAINS_FREQUENCIES if (np.abs(driven - c) < _NEAR).any()]
    if not coincident or usual not in MAINS_FREQUENCIES:
        return usual
    votes = {c: _votes(campaign.runs, c) for c in MAINS_FREQUENCIES}
    best = max(MAINS_FREQUENCIES, key=lambda c: (votes[c], c == usual))
    if votes[best] == 0 and len(coincident) == 1:
        return coincident[0]  # it cannot be ruled out, and must be named
    return best


def _votes(runs: Sequence[Run], choice: float) -> int:
    """In how many runs a line stands at `choice` [Hz] where nothing else does."""
    lines: list[bool] = []
    for run in runs:
        point = run.point
        multiples = np.outer(np.arange(1, 7), [point.excitation_hz, point.shaft_speed_hz])
        multiples[3:, 0] = np.inf  # higher harmonics of a drive are faint
        if len(lines) < _MAX_RUNS and (np.abs(multiples - choice) >= _APART).all():
            lines += _line_at(run, choice)
    return sum(lines)


def _line_at(run: Run, choice: float) -> list[bool]:
    """Whether forces or displacements of a run show a line at `choice` [Hz]; nothing where they cannot."""
    try:
        records = [run.vector(q, 0, min(run.length, _LOOK)) for q in ("displacement", "force")]
    except RigDataError:  # the run's own reading says so
        return []
    shown = []
    for record in records:
        if record.rate >= 3 * choice and len(record) >= record.rate:
            # a missing value leaves no spectrum, and no line in it
            amplitude = np.linalg.norm(hann_amplitude(np.fft.rfft(record.values, axis=0)), axis=1)
            step = record.rate / len(record)
            away, width = np.abs(step * np.arange(len(amplitude)) - choice), max(0.2, 2 * step)
            around = (away > 2 * width) & (away < 2 * width + 4.0)
            shown.append(bool(amplitude[away <= width].max() > _CLEAR * np.median(amplitude[around])))
    return [any(shown)] if shown else []
