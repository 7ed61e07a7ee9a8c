"""One run, read window by window, as phasors of displacement and oil force.

Memory does not grow with the record: a chunk of windows is read, fitted and forgotten. A long record's lines are
looked for in its beginning, and small errors of their frequencies put right in the phasors, so that it is read once.

Windows of another excitation, of none, or across the change say nothing of the phasor that the run's longest stretch
has. A change of the drive shows in forces and displacements alike; what shows in one of them is a fault of channels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.calibration import VECTOR_QUANTITIES
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.conditions import merged
from tpjb_ident.phasors.compensation import compensated, filled_channels, unstated_filters
from tpjb_ident.phasors.frequency import DRIFT, ShaftCourse, device_rates, retuned, shaft_speed, tuned
from tpjb_ident.phasors.line_fit import SCALE_LIMIT, LineFitter, WindowFit, usual_scale
from tpjb_ident.phasors.lines import HIGHEST, LineSet, RecordTooShortError, known_lines, plan_windows
from tpjb_ident.phasors.run_data import (
    SHORT,
    DeviceReader,
    PhasorSettings,
    RunPhasors,
    beginning_of,
    complex_median,
    device_readers,
    with_kept_beginning,
)
from tpjb_ident.phasors.whole_record import (
    WholeRecord,
    lines_beside,
    near_line,
    unexpected_lines,
    whole_records,
    with_record,
)

#: Windows of a stretch, at least.
_LEAST = 3
#: Change of the phasors over the larger of two levels, in forces and in displacements,
_CHANGE = 0.25
#: that leaves at most this share of the windows' scatter about their mean.
_LEFT = 0.1
#: A window whose line is below this many deviations of its noise, or this share of the run's, has no drive.
_DEVIATIONS, _QUIET = 3.0, 0.1
#: A window so far from its stretch's level lies across a change.
_ACROSS = 0.05


def longest_stretch(result: RunPhasors) -> RunPhasors:
    """The run with the windows of its longest stretch alone; those of others give no phasor."""
    driven = len(result.lines.excitation)
    noise = result.noise
    quantity = np.array([c.quantity for c in result.channels])
    live = np.isfinite(noise) & (quantity != "acceleration")
    z, quantity = result.z[:, :driven, live] / noise[live], quantity[live]
    good = np.flatnonzero(np.isfinite(z).all(axis=(1, 2)))
    if len(good) < _LEAST or len(set(quantity)) < 2:
        return result
    level = np.sqrt(np.mean(np.abs(z[good]) ** 2, axis=(1, 2)))
    idle = (level < _DEVIATIONS) | (level < _QUIET * np.quantile(level, 0.9))
    if idle.all():
        return result
    driven_windows = good[~idle]
    windows, count = z[driven_windows], len(driven_windows)
    groups = [windows[:, :, quantity == q].reshape(count, -1) for q in ("displacement", "force")]
    cuts = sorted(_cuts(groups, 0, count))
    is_steady = not cuts and not (idle.any() and np.median(level) > _DEVIATIONS)
    if is_steady:
        return result
    repeats = driven_windows[_longest(windows.reshape(count, -1), np.array([0, *cuts, count]))]
    z = np.full_like(result.z, np.nan)
    z[repeats] = result.z[repeats]
    first, last = result.start[repeats[[0, -1]]].tolist()
    return replace(result, z=z, span=(first, last + result.length))


def _cuts(groups: list[ComplexArray], first: int, stop: int) -> list[int]:
    """Windows at which the level of both groups changes between first and stop: halves, and halves of these."""
    if stop - first < 2 * _LEAST:
        return []
    parts = [group[first:stop] for group in groups]
    joined = np.concatenate(parts, axis=1)
    places = range(_LEAST, stop - first - _LEAST + 1)
    remainders = [_scatter(joined[:k]) + _scatter(joined[k:]) for k in places]
    best = places[np.argmin(remainders)]
    if min(remainders) > _LEFT * _scatter(joined):
        return []
    for part in parts:
        before, after = part[:best].mean(axis=0), part[best:].mean(axis=0)
        if np.linalg.norm(after - before) < _CHANGE * max(np.linalg.norm(before), np.linalg.norm(after)):
            return []
    cut = first + best
    return [*_cuts(groups, first, cut), cut, *_cuts(groups, cut, stop)]


def _scatter(windows: ComplexArray) -> float:
    """Sum of squares about the median of some windows (n, m), one of them, the farthest, left out."""
    squares = np.sum(np.abs(windows - complex_median(windows)) ** 2, axis=1)
    return float(squares.sum() - squares.max())


def _longest(windows: ComplexArray, edges: IntArray) -> BoolArray:
    """Windows (n,) of the longest driven stretch that do not lie across a change; `windows` (n, m)."""
    stretch = np.repeat(np.arange(len(edges) - 1), np.diff(edges))
    inside = stretch == np.bincount(stretch).argmax()
    places = np.flatnonzero(inside)
    middle = complex_median(windows[places])
    distance = np.linalg.norm(windows - middle, axis=1)
    for end, inner in ((places[0], places[1:4]), (places[-1], places[-4:-1])):
        if distance[end] > max(_ACROSS * np.linalg.norm(middle), 3 * np.max(distance[inner], initial=0.0)):
            inside[end] = False
    return inside


#: Samples of one channel held at a time: few enough for two channels to stay in a core's cache.
CHUNK = 2**15
#: Time stamps may stray this share of a sample from the even grid before they are used one by one.
MAX_JITTER = 0.02


def extract(
    run: Run,
    lines: LineSet,
    follow: ShaftCourse | None = None,
    clocks: Mapping[str, float] | None = None,
    window: float | None = None,
) -> RunPhasors:
    """Fit all windows of a run, of a stated length [s] or of one that tells the lines apart.

    `clocks`: by how much lines turn faster by a device's clock, relative.
    """
    readers = device_readers(run)
    channels = []
    for reader in readers:
        channels += [(c, reader.device.name) for c in reader.channels]
    channels.sort(key=lambda described: VECTOR_QUANTITIES.index(described[0].quantity))
    length, count = plan_windows(run.length, run.sample_rate, lines, window)
    seconds = length / run.sample_rate
    middles = (np.arange(count) + 0.5) * length / run.sample_rate
    speeds = np.full(count, np.nan) if follow is None else np.interp(middles, *follow)
    fit = WindowFit.empty(count, len(lines.frequencies), len(channels))
    start = np.empty(0)
    with run.opened():
        for k, reader in enumerate(readers):
            firsts, samples = length * np.arange(count), length
            if k and (reader.rate, reader.length) != (readers[0].rate, readers[0].length):
                firsts, samples = reader.first_samples(start), int(seconds * reader.rate + 1e-6)
            fast = (clocks or {}).get(reader.device.name, 0.0)
            (z, *figures), starts, shown = _device_windows(reader, samples, firsts, lines, speeds, 1 + fast)
            # phases count by the lines' common frequencies
            ahead = np.multiply.outer(starts + 0.5 * seconds, fast * lines.frequencies[shown])
            chosen = np.array([c in reader.channels for c, _ in channels])
            fit.z[np.ix_(np.arange(count), shown, chosen)] = z * np.exp(2j * np.pi * ahead)[:, :, None]
            for table, part in zip(fit[1:], figures):
                table[:, chosen] = part
            start = start if k else starts
    return RunPhasors(
        run.id,
        run.point,
        run.excitation_direction,
        lines,
        start,
        seconds,
        tuple(channel for channel, _ in channels),
        *fit,
        run.housing_mass,
        device=tuple(name for _, name in channels),
        sample_rate=run.sample_rate,
    )


def _device_windows(
    reader: DeviceReader, length: int, firsts: IntArray, lines: LineSet, speeds: FloatArray, faster: float
) -> tuple[WindowFit, FloatArray, BoolArray]:
    """Fit of one device's windows, chunk by chunk, their starts (n,) [s], and which lines its rate shows, (n_lines,).

    Those with times or a shaft speed of their own are fitted one by one. Those that are noisier than the run's usual
    one are fitted anew: a chunk alone may hold nothing to compare. Lines turn `faster` by the device's clock, a factor.
    """
    shown = lines.frequencies < HIGHEST * reader.rate
    if not shown[: len(lines.excitation)].all() or length <= 2 * (2 * shown.sum() + 2):
        names, run = ", ".join(c.name for c in reader.channels), reader.run
        fault = f"{reader.rate:g} samples per second cannot show the excitation in windows of {length} samples"
        raise refuse(run.file, f"channels {names}", fault, "Sample them faster, or record longer", run.id)
    fitter = LineFitter(length, reader.rate, faster * lines.frequencies[shown])
    windows = WindowFit.empty(len(firsts), int(shown.sum()), len(reader.channels))
    starts = np.full(len(firsts), np.nan)

    def fit(first: int, stop: int, usual: FloatArray | None = None) -> None:
        begin = firsts[first]
        time, rows = reader.read(begin, firsts[stop - 1] + length)
        if time is None:
            time = np.arange(begin, begin + rows.shape[1]) / reader.rate
        at = (firsts[first:stop] - begin)[:, None] + np.arange(length)
        time, rows = time[at], rows[:, at]
        start = np.where(np.isfinite(time[:, 0]), time[:, 0], firsts[first:stop] / reader.rate)
        part = fitter.fit(rows, start, usual)
        usual = usual_scale(part.scale) if usual is None else usual
        stray = np.abs(time - time[:, :1] - np.arange(length) / reader.rate).max(axis=1)
        uneven = ~(stray <= MAX_JITTER / reader.rate)
        for i in np.flatnonzero(uneven | np.isfinite(speeds[first:stop])).tolist():
            timed, slip = np.isfinite(time[i]), np.nan_to_num(speeds[first + i] - lines.speed)
            if timed.sum() > 2 * fitter.design.shape[1]:
                moved = lines.with_slip(slip)[: len(shown)]
                times = time[i, timed]
                stamps = times if uneven[i] else None
                single = LineFitter(len(times), reader.rate, faster * moved[shown], time=stamps)
                part.put(slice(i, i + 1), single.fit(rows[:, i : i + 1, timed], times[:1], usual))
        windows.put(slice(first, stop), part)
        starts[first:stop] = start

    step = max(1, CHUNK // length)
    recorded = int(np.count_nonzero(firsts + length <= reader.length))
    for first in range(0, recorded, step):
        fit(first, min(first + step, recorded))
    usual = usual_scale(windows.scale)
    with np.errstate(invalid="ignore"):  # a window without phasors has no scale and stays as it is
        loud = (windows.scale > SCALE_LIMIT * usual).any(axis=1)
    for k in np.flatnonzero(loud).tolist() if recorded > step else ():
        fit(k, k + 1, usual)
    return windows, starts, shown


#: Second thoughts about the frequencies, at most.
_TUNINGS = 3


def run_phasors(run: Run, settings: PhasorSettings | None = None) -> RunPhasors:
    """Extract the phasors of one run."""
    settings = settings or PhasorSettings()
    if run.excitation_kind != "sine":
        text = f"is excited by {run.excitation_kind}; coefficients come from sines, one frequency per run"
        raise refuse(run.file, "excitation", text, "Excite with sines, or leave the run out", run.id)
    run = with_kept_beginning(run)
    beginning = beginning_of(run, SHORT) if run.length > SHORT else run
    try:
        fit = _RunFit(beginning, settings)
    except RecordTooShortError:  # the beginning is not enough; all of it may be
        fit = _RunFit(run, settings)
    if fit.run.length < run.length:
        fit.extend(run)
    result, slower = fit.result, fit.slower
    device = tuple(
        f"{slower[c.name].rate:.4g} Hz" if c.name in slower else d for c, d in zip(result.channels, result.device)
    )
    unstated = []
    for record in () if slower else fit.records:  # images are no noise
        channels, band = [result.channels[k] for k in record.places], (0.0, max(result.lines.driven))
        unstated.append(unstated_filters(channels, record.spectrum, record.duration, band))
    conditions = merged(fit.conditions, result.lines.conditions, *unstated)
    temperature = beginning_of(run, SHORT).mean_temperature() or np.nan
    described = replace(result, conditions=conditions, device=device, temperature=temperature)
    return compensated(described, run, slower, settings.delays)


class _RunFit:
    """Fit of a record: lines that nobody mentioned are looked for, wrong frequencies put right, and fitted again."""

    result: RunPhasors
    records: tuple[WholeRecord, ...]
    follow: ShaftCourse | None
    clocks: Mapping[str, float] | None = None

    def __init__(self, run: Run, settings: PhasorSettings) -> None:
        self.run, self.settings = run, settings
        self.driven = settings.excitation_lines or (run.point.excitation_hz,)
        self.speed, self.conditions = shaft_speed(run)
        self._fit(self._lines(self.driven, ()))
        self.slower = filled_channels(run)
        self._add_unexpected()
        self._add_near()
        for _ in range(_TUNINGS):
            better = tuned(run, self.result, self.driven, settings)
            if better is None:
                break
            self.conditions += better.conditions
            self._fit(better.lines, better.follow)
            if better.settled:
                break
        self.clocks = device_rates(self.result)
        if self.clocks:
            self._fit(self.result.lines, self.follow)
        self.result = with_record(self.result, self.records)

    def extend(self, run: Run) -> None:
        """Fit all of a long run with the lines of its beginning."""
        first, share = self.result, np.sqrt(self.run.length / run.length)
        self.run = run
        self._fit_windows(first.lines)
        self.conditions = tuple(c for c in self.conditions if c != DRIFT)
        better = tuned(run, self.result, self.driven, self.settings)
        if better is not None:
            self.conditions += better.conditions
            quick = retuned(self.result, better.lines) if better.follow is None else None
            if quick is None:
                self._fit_windows(better.lines, better.follow)
            else:
                self.result = quick
        # the noise of a phasor of the whole record is less than that of its beginning
        residual = tuple(share * bins for bins in first.residual)
        self.result = replace(self.result, record=first.record, residual=residual, rounding=first.rounding)

    def _lines(self, excitation: tuple[float, ...], extra: tuple[float, ...]) -> LineSet:
        run, rate = self.run, self.run.sample_rate
        beyond = [f for f in excitation if not 0.0 < f < HIGHEST * rate]
        if beyond:
            fault = f"{rate:g} samples per second cannot show an excitation of {beyond[0]:g} Hz"
            cure = "Check sample_rate, the unit of the time column (ms called s?) and excitation_frequency"
            raise refuse(run.file, "time", fault, cure, run.id)
        return known_lines(excitation, self.speed, rate, self.settings.mains, extra, run.length / rate)

    def _fit(self, lines: LineSet, follow: ShaftCourse | None = None) -> None:
        self._fit_windows(lines, follow)
        self.records = whole_records(self.run, self.result)

    def _fit_windows(self, lines: LineSet, follow: ShaftCourse | None = None) -> None:
        """Windows of the run's longest stretch of one excitation."""
        self.follow = follow
        windows = extract(self.run, lines, follow, self.clocks)
        self.result = longest_stretch(windows)

    def _add_unexpected(self) -> None:
        """Fit lines along that stand out of the residual, but for the images of what was filled up."""
        images = [slow.images(self.result.lines.frequencies) for slow in self.slower.values()]
        extra, conditions = unexpected_lines(self.records, self.result, np.ravel(images))
        if extra:
            self.conditions += conditions
            self._fit(self._lines(self.driven, extra))

    def _add_near(self) -> None:
        """Fit lines along that no window tells from the excitation: their beat looks like a drive off its set point."""
        lines, exact, neighbours = self.result.lines, list(self.result.lines.driven), []
        for i in range(len(exact)):
            pair = near_line(self.result, i, self.records[0].duration)
            if pair is not None:
                exact[i] = pair[0]
                neighbours.append(pair[1])
        if neighbours:
            self._fit(self._lines(tuple(exact), (*lines.found, *neighbours)))
            self.conditions += (lines_beside(tuple(neighbours)),)
