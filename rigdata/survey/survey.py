"""A folder of exports as a whole: what its records tell of each other and of the sensors' axes."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.readers.series import Series
from rigdata.survey.channels import (
    OPEN,
    Entry,
    Frame,
    Guesses,
    Pair,
    Tables,
    along,
    as_described,
    fitted_frame,
    folded,
    guess_channel,
    line_phasors,
    pairs,
    part_means,
    quantity_of_unit,
    stated_frame,
    with_axes,
)
from rigdata.survey.exports import Export, in_seconds
from rigdata.survey.runs import NEAR, RunGuess, guess_run, of_quantity, strongest_lines
from rigdata.vector import wrapped

#: Directions [deg] no farther apart than this lead to one pad; a dry test so near a pad's is toward that pad.
_ALIKE, _TOWARD = 3.0, 15.0
_MAINS_NEAR = 0.005
#: Spread of values that are one set point, absolute and as a share.
_SPREADS = {"direction": (5.0, 0.0), "speed": (0.0, 0.015), "excitation": (0.0, 0.015), "load": (0.0, 0.03)}
#: Share of the running records in which the shaft speed must show.
_MOST_OF = 0.8
#: A load that a file's name states and the cells contradict by more than this share is to be confirmed; cells that show
#: no more than this share of it are in line with the stingers of a stator that hangs: they carry a preload alone.
_CONTRADICTS, _PRELOAD = 0.1, 0.02
#: By so much [deg] the shaft goes beside its pad in dry steps.
_ASIDE = 3.0
_RUNNING = ("dynamic", "locus")
#: Readings (n, 2) of two sensors, the directions (n,) that they had [rad], what tells these, and their error [deg].
_Evidence = tuple[FloatArray, FloatArray, str, float]


@dataclass(frozen=True)
class Survey:
    """What was found in a folder of exports."""

    channels: Guesses
    runs: tuple[RunGuess, ...]
    clocks: dict[str, Entry]  #: unit of every time column, by name


def survey(
    exports: Sequence[Export],
    described: Tables | None = None,
    pivots: Sequence[float] = (),
) -> Survey:
    """Guess channels and runs; `described` are tables of a manifest, `pivots` the angles of the pads [rad]."""
    exports, clocks = in_seconds(exports, described or {})
    folder = _Folder(exports, described or {}, pivots)
    speed = folder.common_line()
    folder.runs = [_with_lines(run, speed) for run in folder.runs]
    folder.find_other_axes()
    if speed.value:
        folder.find_sensitivities(speed.number)
    return Survey(
        channels=folder.channels,
        runs=_set_points(folder.runs),
        clocks=clocks,
    )


class _Folder:
    """Channels and runs, of which more is known with every step; `cells` is the frame of the load cells."""

    def __init__(self, exports: Sequence[Export], described: Tables, pivots: Sequence[float]) -> None:
        self.pivots = np.asarray(pivots, dtype=float)
        self.channels: Guesses = {}
        for export in exports:
            for series in export.series:
                if series.name not in self.channels:
                    guess = guess_channel(series.name, series.unit)
                    self.channels[series.name] = as_described(guess, described.get(series.name, {}))
        self.runs = [guess_run(export, self.channels) for export in exports]
        self.cells = self._frame_of_cells()
        if self.cells is not None:
            with_axes(self.channels, self.cells)
            self.runs = [self._loaded(run, self.cells) for run in self.runs]

    def _with(self, kinds: Sequence[str], *names: Pair) -> Iterator[tuple[RunGuess, list[list[Series]]]]:
        """Runs of some kinds that have these pairs of channels, with their records."""
        for run in self.runs:
            records = [_pair(run, pair) for pair in names]
            if run.kind.value in kinds and all(records):
                yield run, records

    def _dry_tests(self, *names: Pair) -> tuple[FloatArray, FloatArray]:
        """Directions (n,) [rad] of the pads that dry tests load, NaN where these are not known.

        And readings of pairs of channels at their first and their last step (2, n_pairs, n, 2).
        """
        angles = np.append(self.pivots, np.nan)
        toward, readings = [], []
        for run, pairs_of_run in self._with(["dry_pivot"], *names):
            ends = np.array([part_means(series)[[0, -1]] for series in pairs_of_run])
            if np.isfinite(ends).all() and (ends[:, 0] != ends[:, 1]).any(axis=1).all():
                toward.append(angles[min(run.pad.value or 0, len(angles)) - 1])
                readings.append(ends)
        return np.array(toward), np.reshape(readings, (-1, len(names), 2, 2)).transpose(2, 1, 0, 3)

    def _frame_of_cells(self) -> Frame | None:
        """Frame of the load cells: typed, told by dry steps toward known pads, or as their names hint."""
        pair = next(iter(pairs(self.channels, "force")), None)
        if pair is None:
            return None
        frame = stated_frame(pair, self.channels)
        if frame is not None and frame.source == "file":
            return frame
        toward, (first, last) = self._dry_tests(pair)
        readings = (last - first)[0]
        has_pad = np.isfinite(toward)
        if len(set(toward[has_pad])) > 1:
            reason = f"{has_pad.sum()} dry steps toward their pads"
            return fitted_frame(pair, readings[has_pad], toward[has_pad], reason) or frame
        if frame is None or not len(self.pivots) or len(readings) < 2:
            return frame
        hinted = frame.direction(readings)
        nearest = self.pivots[self._nearest_pad(hinted)]
        if np.abs(wrapped(hinted - nearest)).max() > math.radians(_ALIKE):
            return frame  # the names' directions lead to no pads
        return fitted_frame(pair, readings, nearest, f"its name and {len(readings)} dry steps toward pads") or frame

    def _nearest_pad(self, angles: FloatArray | float) -> Any:
        """Indices of the pads nearest to directions [rad]."""
        return np.argmax(np.cos(np.subtract.outer(angles, self.pivots)), axis=-1)

    def _loaded(self, run: RunGuess, cells: Frame) -> RunGuess:
        series, is_dry = _pair(run, cells.names), run.kind.value == "dry_pivot"
        if not series or run.kind.value == "clearance":
            return run
        means = part_means(series, 10 if is_dry else 1)
        force = means[-1] - is_dry * means[0]
        if not force.any() or not np.isfinite(force).all():
            return run
        angle = cells.direction(force)
        degrees, is_guess = folded(math.degrees(angle)), cells.source == "guess"
        reason = f"cells {degrees:g} deg" + ", if their axes hold" * is_guess
        concluded = Entry(float(round(degrees)), "guess" if is_guess else "records", reason)
        if run.direction.source != "file":
            run = replace(run, direction=concluded)
        if is_dry and len(self.pivots):
            nearest = int(self._nearest_pad(angle))
            pivot = math.degrees(self.pivots[nearest])
            distance = abs(folded(pivot - degrees))
            if distance <= _TOWARD and run.pad.value in (None, nearest + 1):
                pad = replace(concluded, value=nearest + 1, reason=f"{reason}, {distance:.1f} deg from it")
                direction = replace(run.direction, value=folded(pivot))
                return replace(run, pad=run.pad if run.pad.value else pad, direction=direction)
            if run.pad.value:
                return replace(run, pad=replace(run.pad, source="guess", reason=f"the file's name; {reason}"))
        newtons = force * [self.channels[name].gain for name in cells.names]
        return run if is_dry or not np.isfinite(newtons).all() else _with_load(run, np.hypot(*newtons))

    def find_other_axes(self) -> None:
        """Axes of probes by dry steps, of accelerometers by the excitation; hints where that fails."""
        cells = self.cells
        if cells is None:
            return
        for pair in pairs(self.channels, "displacement"):
            frames = [fitted_frame(pair, *evidence) for evidence in self._of_dry_tests(pair, cells)]
            proposals = [frame for frame in frames if frame is not None]
            if proposals:
                with_axes(self.channels, min(proposals, key=lambda frame: frame.error), cells.source)
        for pair in pairs(self.channels, "acceleration"):
            frame = fitted_frame(pair, *self._of_excitation(pair, cells)) or stated_frame(pair, self.channels)
            if frame is not None:
                with_axes(self.channels, frame, cells.source)

    def _of_dry_tests(self, pair: Pair, cells: Frame) -> Iterator[_Evidence]:
        """How two probes move in dry tests, and where the shaft then lies on the pads."""
        directions, (first, last) = self._dry_tests(pair, cells.names)
        steps, forces = last - first
        if not np.isfinite(directions).all():
            directions = cells.direction(forces)
        yield steps, directions, f"{len(steps)} dry steps", _ASIDE
        if len(steps) > 2:
            towards = np.exp(1j * directions)
            deviations = np.angle(towards - towards.mean())
            yield last[0] - last[0].mean(axis=0), deviations, f"where {len(steps)} dry steps end", 0.0

    def _of_excitation(self, pair: Pair, cells: Frame) -> _Evidence:
        """How two accelerometers move: the housing gives way to the force on its cells along the excitation."""
        readings, directions = [], []
        for run, (housing, forces) in self._with(["dynamic"], pair, cells.names):
            frequency = run.excitation.number
            if frequency > 0:
                force, acceleration = along(line_phasors(forces, frequency), line_phasors(housing, frequency))
                readings.append(acceleration)
                directions.append(cells.direction(force))
        return np.array(readings), np.array(directions), f"the excitation of {len(readings)} runs", 0.0

    def find_sensitivities(self, line: float) -> None:
        """Reading per hertz of speed channels in volts, where it is one in all running records."""
        ratios = defaultdict(list)
        for run, _ in self._with(_RUNNING):
            for series in of_quantity(run.export, self.channels, "speed"):
                if not quantity_of_unit(self.channels[series.name].unit):
                    ratios[series.name].append(np.nanmedian(series.values) / line)
        for name, values in ratios.items():
            guess, middle = self.channels[name], sorted(values)[len(values) // 2]
            if guess.unit and min(values) > 0 and max(values) - min(values) <= NEAR * max(values):
                reason = "constant over the line that is taken for the shaft's"
                ratio = Entry(f"{middle:.4g} {guess.unit}/Hz", "records", reason)
                self.channels[name] = replace(guess, sensitivity=ratio)

    def common_line(self) -> Entry:
        """Shaft speed [Hz]: line of all running records' displacements, besides an excitation that its name states."""
        running = []
        for run, _ in self._with(_RUNNING):
            peaks = strongest_lines(of_quantity(run.export, self.channels, "displacement"))
            driven = run.excitation.number
            running.append([p.frequency for p in peaks if not abs(p.frequency - driven) <= NEAR * p.frequency])
        if len(running) < 2:
            return OPEN
        frequencies = np.sort(np.concatenate(running))

        def near(frequency: float) -> FloatArray:
            return frequencies[np.abs(frequencies - frequency) < NEAR * frequency]

        # the mains are in every record as well, and so may one excitation: the shaft shows twice its speed too
        order = sorted(set(frequencies.tolist()), key=lambda f: (is_mains(f), -len(near(2 * f)), f))
        least = _MOST_OF * len(running)
        for candidate in order:
            speeds = near(candidate)
            if len(speeds) < least:
                continue
            speed = speeds[len(speeds) // 2]
            once, twice = len(near(speed)), len(near(2 * speed))
            text = f"this line is in {once} of {len(running)} records"
            if is_mains(speed):
                return Entry(speed, "guess", f"{text}; it may be the mains")
            sure = min(once, twice) >= least
            return Entry(speed, "records", f"{text}, twice it in {twice}") if sure else Entry(speed, "guess", text)
        return OPEN


def _pair(run: RunGuess, names: Pair) -> list[Series]:
    """The two channels of a record; empty where one is missing or both never move."""
    series = {s.name: s for s in run.export.series}
    chosen = [series[name] for name in names if name in series]
    return chosen if len(chosen) == 2 and any(np.isfinite(s.values).any() for s in chosen) else []


def _with_load(run: RunGuess, load: float) -> RunGuess:
    """A run with its load [N] by calibrated cells, in their unit; what a name states stands if they agree."""
    reason, entry = f"cells {load / 1e3:.3g} kN", run.load
    deviation = abs(load - entry.number)
    agrees = deviation <= _CONTRADICTS * entry.number
    if entry.source == "file" and agrees:
        return run
    if entry.source == "file" or deviation <= _SPREADS["load"][1] * entry.number or load < _PRELOAD * entry.number:
        source = "records" if agrees else "guess"
        return replace(run, load=replace(entry, source=source, reason=f"the file's name; {reason}"))
    return replace(run, load=Entry(load, "records", reason))


def _with_lines(run: RunGuess, speed: Entry) -> RunGuess:
    """A run with its speed and excitation: what turns with the shaft is not the excitation."""
    if run.speed.value is None:
        run = replace(run, speed=speed)
    if run.excitation.value is not None or run.kind.value == "locus" or not run.lines:
        return run
    lines = list(run.lines)
    for turns in (run.speed.number, 2 * run.speed.number):
        lines = [line for line in lines if not abs(line.frequency - turns) <= NEAR * turns]
    if not lines:
        return run
    remark = " beside the shaft's" if len(lines) < len(run.lines) else ""
    return replace(run, excitation=Entry(lines[0].frequency, "records", f"strongest line{remark}"))


def _set_points(runs: Sequence[RunGuess]) -> tuple[RunGuess, ...]:
    """Directions, speeds, frequencies and loads that are nearly alike become the set point that was meant."""
    changed = list(runs)
    for name in _SPREADS:
        entries = [getattr(run, name) for run in changed]
        movable = [i for i, entry in enumerate(entries) if name != "load" or entry.source == "records"]
        points = _common(name, [entries[i].number for i in movable])
        for i in movable:
            value = points.get(entries[i].number, entries[i].value)
            changed[i] = replace(changed[i], **{name: replace(entries[i], value=value)})
    for i, run in enumerate(changed):
        if run.load.source and not run.load.text:
            changed[i] = replace(run, load=replace(run.load, text=f"{run.load.number / 1e3:.4g} kN"))
    return tuple(changed)


def _common(name: str, values: Sequence[float]) -> dict[float, float]:
    """What every finite value was meant to be: the middle of its group of values that are alike, rounded."""
    absolute, share = _SPREADS[name]
    groups: list[list[float]] = []
    for value in sorted(v for v in values if math.isfinite(v)):
        if not groups or value > groups[-1][0] * (1.0 + share) + absolute:
            groups.append([])
        groups[-1].append(value)
    set_points: dict[float, float] = {}
    for group in groups:
        middle = group[len(group) // 2]
        nearby, near = float(f"{middle:.2g}"), 0.003 * middle  # 21.99 Hz was meant to be 22 Hz
        exact = float(f"{middle:.4g}")
        if name == "direction":
            nearby, near = 45.0 * round(middle / 45.0), 0.5 * _ALIKE  # an axis, or between two; pads may be anywhere
        set_points |= dict.fromkeys(group, nearby if abs(nearby - middle) <= near else exact)
    return set_points


def is_mains(frequency: float) -> bool:
    """Whether a frequency [Hz] is that of the mains."""
    return any(abs(frequency - mains) < _MAINS_NEAR * mains for mains in MAINS_FREQUENCIES)
