"""A folder of exports as a whole: what its records tell of each other and of the sensors' axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.readers.series import Series
from rigdata.survey.axes import (
    Frame,
    along,
    fitted_frame,
    folded,
    line_phasors,
    pairs,
    part_means,
    stated_frame,
    with_axes,
)
from rigdata.survey.channels import OPEN, ChannelGuess, Entry, as_described, guess_channel, quantity_of_unit
from rigdata.survey.exports import Export, in_seconds
from rigdata.survey.runs import NEAR, RunGuess, guess_run, of_quantity, strongest_lines

#: Directions [deg] no farther apart than this are meant to be one; a dry test so near a pad's is toward that pad.
_ALIKE, _TOWARD = 3.0, 15.0
_MAINS_NEAR = 0.005
#: In a clearance sweep the shaft lies in the corners, up to half a pad from where it is pushed [deg].
_CORNERS = 25.0
#: Shares that a sweep is looked at in.
_SWEPT = 120
#: What differs by no more than this factor is one set point; a round number so near is meant.
_ALIKE_FACTORS, _ROUND = {"speed": 1.015, "excitation": 1.015, "load": 1.03}, 0.003
#: Share of the running records in which the shaft speed must show.
_MOST_OF = 0.8
#: A load that a file's name states and the cells contradict by more than this share is to be confirmed.
_CONTRADICTS = 0.1


@dataclass(frozen=True)
class Survey:
    """What was found in a folder of exports."""

    rates: tuple[float, ...]
    channels: dict[str, ChannelGuess]
    runs: tuple[RunGuess, ...]
    clocks: dict[str, Entry] = field(default_factory=dict)  #: unit of every time column, by name
    nameless: int = 0
    per_hertz: dict[str, float] = field(default_factory=dict)


def survey(
    exports: Sequence[Export],
    described: Mapping[str, Mapping[str, Any]] | None = None,
    pivots: Sequence[float] = (),
) -> Survey:
    """Guess channels and runs; `described` are tables of a manifest, `pivots` the angles of the pads [rad]."""
    exports, clocks = in_seconds(exports, described or {})
    folder = _Folder(exports, described or {}, pivots)
    folder.find_loads()
    speed = folder.common_line()
    folder.runs = [_with_lines(run, speed) for run in folder.runs]
    folder.find_other_axes()
    return Survey(
        rates=tuple(e.rate for e in exports),
        channels=folder.channels,
        runs=_set_points(folder.runs),
        per_hertz=folder.tachometers(speed.number),
        clocks=clocks,
        nameless=max((e.nameless for e in exports), default=0),
    )


class _Folder:
    """Channels and runs, of which more is known with every step; `cells` is the frame of the load cells."""

    def __init__(
        self, exports: Sequence[Export], described: Mapping[str, Mapping[str, Any]], pivots: Sequence[float]
    ) -> None:
        self.pivots = pivots
        self.channels: dict[str, ChannelGuess] = {}
        for export in exports:
            for series in export.series:
                if series.name not in self.channels:
                    guess = guess_channel(series.name, series.unit)
                    self.channels[series.name] = as_described(guess, described.get(series.name, {}))
        self.runs = [guess_run(export, self.channels) for export in exports]
        self.cells = self._frame_of_cells()

    def _of_kind(self, *kinds: str) -> list[RunGuess]:
        return [run for run in self.runs if run.kind.value in kinds]

    def _steps(self, names: tuple[str, str]) -> dict[str, FloatArray]:
        """By how much two channels change from the first to the last step of every dry test, by the run's file."""
        steps = {}
        for run in self._of_kind("dry_pivot"):
            series = _pair(run, names)
            change = _change(series) if series else np.zeros(2)
            if np.isfinite(change).all() and change.any():
                steps[run.file] = change
        return steps

    def _pads_toward(self, files: Iterable[str]) -> list[int]:
        """Pads that dry tests load, 0 where that is not known."""
        pads = {run.file: run.pad.value or 0 for run in self.runs}
        return [pads[file] if pads[file] <= len(self.pivots) else 0 for file in files]

    def _frame_of_cells(self) -> Frame | None:
        """Frame of the load cells: typed, told by dry steps toward known pads, or as their names hint."""
        pair = next(iter(pairs(self.channels, "force")), None)
        if pair is None:
            return None
        stated = stated_frame(pair, self.channels)
        if stated is not None and stated.source == "file":
            return stated
        steps = self._steps(pair)
        toward = self._pads_toward(steps)
        readings = np.array([step for step, pad in zip(steps.values(), toward, strict=True) if pad])
        directions = np.array([self.pivots[pad - 1] for pad in toward if pad])
        if len(set(directions)) > 1:
            return fitted_frame(pair, readings, directions, f"{len(readings)} dry steps toward their pads") or stated
        if stated is None or not len(self.pivots) or len(steps) < 2:
            return stated
        readings = np.array(list(steps.values()))
        hinted = stated.direction(readings)
        nearest = np.array([self._nearest_pad(angle)[1] for angle in hinted])
        if np.abs(np.angle(np.exp(1j * (hinted - nearest)))).max() > math.radians(_ALIKE):
            return stated  # the names' directions lead to no pads
        return fitted_frame(pair, readings, nearest, f"its name and {len(steps)} dry steps toward pads") or stated

    def _nearest_pad(self, angle: float) -> tuple[int, float]:
        """Number and angle [rad] of the pad nearest to a direction."""
        number = int(np.argmax(np.cos(np.asarray(self.pivots) - angle)))
        return number + 1, float(self.pivots[number])

    def find_loads(self) -> None:
        """Give the load cells their axes, and the runs direction, load and pad as the cells tell them."""
        if self.cells is not None:
            with_axes(self.channels, self.cells)
            self.runs = [self._loaded(run, self.cells) for run in self.runs]

    def _loaded(self, run: RunGuess, cells: Frame) -> RunGuess:
        series = _pair(run, cells.names)
        if not series or run.kind.value == "clearance":
            return run
        is_dry = run.kind.value == "dry_pivot"
        force = _change(series) if is_dry else part_means(series, 1)[0]
        if not force.any() or not np.isfinite(force).all():
            return run
        angle = float(cells.direction(force))
        source = "guess" if cells.source == "guess" else "records"
        degrees = folded(math.degrees(angle))
        reason = f"cells {degrees:g} deg" + (", if their axes hold" if source == "guess" else "")
        if run.direction.source != "file":
            run = replace(run, direction=Entry(float(round(degrees)), source, reason))
        if is_dry and len(self.pivots):
            number, pivot = self._nearest_pad(angle)
            off = math.degrees(abs(math.remainder(pivot - angle, 2 * math.pi)))
            if off <= _TOWARD and run.pad.value in (None, number):
                pad = run.pad if run.pad.value else Entry(number, source, f"{reason}, {off:.1f} deg from it")
                return replace(run, pad=pad, direction=replace(run.direction, value=folded(math.degrees(pivot))))
            if run.pad.value:
                return replace(run, pad=replace(run.pad, source="guess", reason=f"the file's name; {reason}"))
        newtons = force * [self.channels[name].gain for name in cells.names]
        return run if is_dry or not np.isfinite(newtons).all() else _with_load(run, float(np.hypot(*newtons)))

    def find_other_axes(self) -> None:
        """Axes of probes by dry steps or the sweep, of accelerometers by the excitation; hints where these fail."""
        cells = self.cells
        if cells is None:
            return
        forces = self._steps(cells.names)
        for pair in pairs(self.channels, "displacement"):
            steps = {file: step for file, step in self._steps(pair).items() if file in forces}
            directions = np.array([float(cells.direction(forces[file])) for file in steps])
            toward = self._pads_toward(steps)
            if all(toward):
                directions = np.array([self.pivots[pad - 1] for pad in toward])
            places = np.array([part_means(_pair(run, pair))[-1] for run in self.runs if run.file in steps])
            frames = [
                fitted_frame(pair, np.array(list(steps.values())), directions, f"{len(steps)} dry steps"),
                _frame_by_contacts(pair, places, directions),
                self._frame_by_sweep(pair, cells),
            ]
            if proposals := [frame for frame in frames if frame is not None]:
                with_axes(self.channels, min(proposals, key=lambda frame: frame.error), cells.source)
        for pair in pairs(self.channels, "acceleration"):
            frame = self._frame_by_excitation(pair, cells) or stated_frame(pair, self.channels)
            if frame is not None:
                with_axes(self.channels, frame, cells.source)

    def _frame_by_sweep(self, pair: tuple[str, str], cells: Frame) -> Frame | None:
        """Frame of two probes by a small load that goes around: the shaft follows it from corner to corner."""
        for run in self._of_kind("clearance"):
            probes, forces = _pair(run, pair), _pair(run, cells.names)
            if probes and forces:
                around = []
                for channels in (probes, forces):
                    means = part_means(channels, _SWEPT)
                    around.append(means - 0.5 * (means.max(axis=0) + means.min(axis=0)))
                readings, pushes = around
                return fitted_frame(pair, readings, cells.direction(pushes), "the clearance sweep", _CORNERS)
        return None

    def _frame_by_excitation(self, pair: tuple[str, str], cells: Frame) -> Frame | None:
        """Frame of two accelerometers: the housing gives way to the force on its cells along the excitation."""
        readings, directions = [], []
        for run in self._of_kind("dynamic"):
            housing, forces = _pair(run, pair), _pair(run, cells.names)
            frequency = run.excitation.number
            if housing and forces and frequency > 0:
                force, acceleration = along(line_phasors(forces, frequency), line_phasors(housing, frequency))
                readings.append(acceleration)
                directions.append(float(cells.direction(force)))
        if not readings:
            return None
        reason = f"the excitation of {len(readings)} runs"
        return fitted_frame(pair, np.array(readings), np.array(directions), reason)

    def tachometers(self, line: float) -> dict[str, float]:
        """Reading per hertz of speed channels in volts, where it is one in all running records."""
        per_hertz: dict[str, float] = {}
        if not math.isfinite(line):
            return per_hertz
        ratios: dict[str, list[float]] = {}
        for run in self._of_kind("dynamic", "locus"):
            for series in of_quantity(run.export, self.channels, "speed"):
                if not quantity_of_unit(self.channels[series.name].unit):
                    ratios.setdefault(series.name, []).append(float(np.nanmedian(series.values)) / line)
        for name, values in ratios.items():
            low, high = min(values), max(values)
            if low > 0 and high - low <= NEAR * high:
                per_hertz[name] = sorted(values)[len(values) // 2]
        return per_hertz

    def common_line(self) -> Entry:
        """Shaft speed [Hz]: line of all running records' displacements, besides an excitation that its name states."""
        running = []
        for run in self._of_kind("dynamic", "locus"):
            peaks = strongest_lines(of_quantity(run.export, self.channels, "displacement"))
            driven = run.excitation.number
            running.append([p.frequency for p in peaks if not abs(p.frequency - driven) <= NEAR * p.frequency])
        if len(running) < 2:
            return OPEN
        frequencies = np.sort(np.concatenate(running))
        # the mains are in every record as well, and so may one excitation: the shaft shows twice its speed too
        order = sorted(set(frequencies.tolist()), key=lambda f: (is_mains(f), -_count(frequencies, 2 * f), f))
        least = _MOST_OF * len(running)
        for candidate in order:
            near = frequencies[np.abs(frequencies - candidate) < NEAR * candidate]
            if len(near) < least:
                continue
            half = frequencies[np.abs(2 * frequencies - candidate) < NEAR * candidate]
            speeds = half if 2 * len(half) >= len(near) else near  # an oval shaft shows twice its speed more often
            speed = float(speeds[len(speeds) // 2])
            once, twice = _count(frequencies, speed), _count(frequencies, 2 * speed)
            mains = "; it may be the mains" if is_mains(speed) else ""
            text = f"this line is in {once} of {len(running)} records{mains}"
            if min(once, twice) < least or mains:
                return Entry(speed, "guess", text)
            return Entry(speed, "records", f"{text}, twice it in {twice}")
        return OPEN


def _count(frequencies: FloatArray, frequency: float) -> int:
    """How many of the lines (n,) [Hz] are near a frequency."""
    return int((np.abs(frequencies - frequency) < NEAR * frequency).sum())


def _pair(run: RunGuess, names: tuple[str, str]) -> list[Series]:
    """The two channels of a record; empty where one is missing or both never move."""
    series = {s.name: s for s in run.export.series}
    chosen = [series[name] for name in names if name in series]
    return chosen if len(chosen) == 2 and any(np.isfinite(s.values).any() for s in chosen) else []


def _change(series: Sequence[Series]) -> FloatArray:
    """Difference of two channels (2,) between the last and the first tenth of a record."""
    tenths = part_means(series)
    return np.asarray(tenths[-1] - tenths[0])


def _with_load(run: RunGuess, load: float) -> RunGuess:
    """A run with its load [N] by calibrated cells, in their unit; what a name states stands if they agree."""
    reason, stated = f"cells {load / 1e3:.3g} kN", run.load
    off = abs(load - stated.number)
    agrees = off <= _CONTRADICTS * stated.number
    if stated.source == "file" and agrees:
        return run
    if stated.source == "file" or off <= (_ALIKE_FACTORS["load"] - 1.0) * stated.number:
        source = "records" if agrees else "guess"
        return replace(run, load=replace(stated, source=source, reason=f"the file's name; {reason}"))
    return replace(run, load=Entry(load, "records", reason), load_text="")


def _frame_by_contacts(pair: tuple[str, str], places: FloatArray, directions: FloatArray) -> Frame | None:
    """Frame of two probes by where the shaft lies on the pads (n, 2), pulled in n directions [rad]."""
    if len(places) < 3:
        return None
    apart = np.exp(1j * directions) - np.exp(1j * directions).mean()
    reason = f"where {len(places)} dry steps end"
    return fitted_frame(pair, places - places.mean(axis=0), np.angle(apart), reason)


def _with_lines(run: RunGuess, speed: Entry) -> RunGuess:
    """A run with its speed and excitation: what turns with the shaft is not the excitation."""
    if run.kind.value not in ("dynamic", "locus", None):
        return run
    if run.speed.value is None:
        run = replace(run, speed=speed)
    if run.excitation.value is not None or run.kind.value == "locus":
        return run
    turns = run.speed.number
    lines = [p for p in run.lines if not any(abs(p.frequency - n * turns) <= NEAR * n * turns for n in (1, 2))]
    if lines:
        beside = " beside the shaft's" if len(lines) < len(run.lines) else ""
        return replace(run, excitation=Entry(lines[0].frequency, "records", f"strongest line{beside}"))
    return replace(run, excitation=Entry(None, "", "its only line is the shaft's") if run.lines else OPEN)


def _set_points(runs: Sequence[RunGuess]) -> tuple[RunGuess, ...]:
    """Directions, speeds, frequencies and loads that are nearly alike become the set point that was meant."""
    changed = list(runs)
    for name in ("direction", *_ALIKE_FACTORS):
        entries: list[Entry] = [getattr(run, name) for run in changed]
        movable = [i for i, entry in enumerate(entries) if name != "load" or entry.source == "records"]
        points = _common(name, [entries[i].number for i in movable])
        for i in movable:
            value = points.get(entries[i].number, entries[i].value)
            moved: Any = {name: replace(entries[i], value=value)}
            changed[i] = replace(changed[i], **moved)
    for i, run in enumerate(changed):
        if run.load.source and not run.load_text:
            changed[i] = replace(run, load_text=f"{run.load.number / 1e3:.4g} kN")
    return tuple(changed)


def _common(name: str, values: Sequence[float]) -> dict[float, float]:
    """What every finite value was meant to be: the middle of its group of values that are alike, rounded."""
    groups: list[list[float]] = []
    for value in sorted({v for v in values if math.isfinite(v)}):
        if groups and _is_alike(name, groups[-1], value):
            groups[-1].append(value)
        else:
            groups.append([value])
    set_points: dict[float, float] = {}
    for group in groups:
        members = sorted(v for v in values if v in group)
        set_points |= dict.fromkeys(group, _meant(name, members[len(members) // 2]))
    return set_points


def _is_alike(name: str, group: Sequence[float], value: float) -> bool:
    """Whether a value is of a group of lower ones."""
    if name == "direction":
        return value - group[-1] <= _ALIKE and value - group[0] <= 2 * _ALIKE
    return value <= _ALIKE_FACTORS[name] * group[0]


def _meant(name: str, middle: float) -> float:
    """The round set point near a value; else the value to some digits."""
    if name == "direction":
        nearby = 45.0 * round(middle / 45.0)  # an axis, or between two; pads may be anywhere
        return nearby if abs(nearby - middle) <= _ALIKE / 2 else middle
    nearby = float(f"{middle:.2g}")  # 21.99 Hz was meant to be 22 Hz
    digits = 3 if name == "load" else 4
    return nearby if abs(nearby - middle) <= _ROUND * middle else float(f"{middle:.{digits}g}")


def is_mains(frequency: float) -> bool:
    """Whether a frequency [Hz] is that of the mains."""
    return any(abs(frequency - mains) < _MAINS_NEAR * mains for mains in MAINS_FREQUENCIES)
