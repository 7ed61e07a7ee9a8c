"""What one pass over a run's samples leaves for the checks that compare runs, of whatever kind.

Of its excitation by the phasors of identification; of a band strong lines.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.manifest.fields import MAINS_FREQUENCIES
from rigdata.problem import RigDataError, Severity
from rigdata.run import Run
from rigdata.vector import Directed, directions, inverse_directions
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.signals import ALWAYS_NEEDED, check_clock, check_signal, needed
from tpjb_ident.conditions import Conditions
from tpjb_ident.errors import TpjbError
from tpjb_ident.phasors.line_fit import LineFitter, white_noise, window_median
from tpjb_ident.phasors.lines import RecordTooShortError
from tpjb_ident.phasors.run_data import RunPhasors, by_channel, with_kept_beginning
from tpjb_ident.phasors.run_phasors import run_phasors

#: Lines of a band that are looked at, the strongest of as many parts of it.
_BAND_LINES = 8
#: Bins to either side of a disturbing line that are left alone.
_CLEAR_OF = 5
#: Noise is looked at from this many times the band's top on.
_ABOVE = 1.3
#: What turns with the shaft, of which probes show run-out, the higher the order the less of it motion.
SHAFT_LINES = ("1X", "2X", "3X")
#: A part of the 1X force counts from this many standard errors of its windows.
_CLEAR = 8.0


@dataclass(frozen=True)
class RecordLines:
    """What a run's m channels show; NaN where they do not."""

    mean: FloatArray  #: (m,)
    floor: FloatArray  #: (m,): amplitude that noise alone makes of a line
    scatter: FloatArray  #: (m,): standard deviation of what is left
    omega: FloatArray = field(default_factory=lambda: np.empty(0))  #: (k,), rad/s: lines of the excitation
    rows: ComplexArray = field(default_factory=lambda: np.empty((0, 0), complex))  #: (k, m): phasors there

    @staticmethod
    def none(channels: int) -> RecordLines:
        """Of channels that show nothing."""
        return RecordLines(*np.full((3, channels), np.nan))

    @property
    def phasor(self) -> ComplexArray:
        """The first line, (m,)."""
        return self.rows[0] if len(self.rows) else np.full(len(self.mean), np.nan + 0j)


def excitation_line(phasors: RunPhasors, line: int, channels: Sequence[Channel]) -> RecordLines:
    """One excitation line as identification has it."""
    values = phasors.mean, np.abs(phasors.residual[line]), phasors.scale
    mean, floor, scatter = (by_channel(window_median(rows), phasors.channels, channels) for rows in values)
    row = by_channel(phasors.record[line], phasors.channels, channels)
    omega = 2 * np.pi * phasors.lines.excitation[line].frequency
    return RecordLines(mean, floor, scatter, np.array([omega]), row[None])


def shaft_lines(phasors: RunPhasors, channels: Sequence[Channel]) -> tuple[FloatArray, float]:
    """Sizes of 1X to 3X in every channel (3, m), and the sense of the force at 1X, see `_sense`.

    NaN where they are not told from the excitation. The faint third is that of the whole record.
    """
    sizes = np.full((3, len(channels)), np.nan)
    first = phasors.lines.place("1X")
    values = [*phasors.z.swapaxes(0, 1), *phasors.record[phasors.z.shape[1] :, None]]
    for line, rows in zip(phasors.lines.whole, values):
        if line.name in SHAFT_LINES:
            size = window_median(np.abs(rows))
            sizes[SHAFT_LINES.index(line.name)] = by_channel(size, phasors.channels, channels)
    return sizes, math.nan if first is None else _sense(phasors.plane("force", phasors.z[:, first]))


def _sense(force: ComplexArray) -> float:
    """Logarithm of the 1X force's counter-clockwise part over its clockwise one; NaN where neither is clear.

    What is out of balance turns with the shaft, and so does the force that the film passes on. The cells are asked,
    not the probes: run-out, which differs from probe to probe, can turn an orbit of a micrometre round.

    `force` (n, 2): X and Y in every window.
    """
    force = force[np.isfinite(force).all(axis=1)]
    if len(force) < 2:
        return math.nan
    parts = np.abs(force[:, :1] + np.array([1j, -1j]) * force[:, 1:])
    forward, backward = parts.mean(axis=0)
    if not max(forward, backward) > _CLEAR * parts.std(axis=0).max() / math.sqrt(len(force)):
        return math.nan
    return math.log(forward / max(backward, 1e-3 * forward))


def steady_level(values: FloatArray, rate: float, frequencies: Sequence[float]) -> RecordLines:
    """Mean and scatter of a run without an excitation line, others taken off; `values` (n, m)."""
    positive = np.array([f for f in frequencies if f > 0])
    fit = LineFitter(len(values), rate, positive).fit(np.ascontiguousarray(values.T)[:, None], np.zeros(1))
    return RecordLines(fit.mean[0], np.full(values.shape[1], np.nan), fit.scale[0])


def band_lines(run: Run, level: RecordLines, values: FloatArray, force: Sequence[int]) -> RecordLines:
    """The level of a run with strong lines of its excitation over a band, and what noise makes of a line.

    What channels owe one another (two planes of probes, cells and accelerometers) holds at every line, so a few that
    stand clear of the noise, away from shaft and mains, serve the checks as the one line of a sine does.

    `values` (n, m), `force`: places of the cells.
    """
    finite = np.isfinite(values)
    if run.band is None or not len(force) or not finite.any(axis=0).all():
        return level
    window = np.hanning(len(values))
    centred = np.where(finite, values - np.nanmedian(values, axis=0), 0.0)
    spectrum = np.fft.rfft(centred * window[:, None], axis=0) * (2 / window.sum())
    frequency = np.fft.rfftfreq(len(values), 1 / run.sample_rate)
    free = np.ones(len(frequency), dtype=bool)
    for line in filter(None, (run.point.shaft_speed_hz, *MAINS_FREQUENCIES)):
        nearest = line * np.maximum(np.round(frequency / line), 1)
        free &= np.abs(frequency - nearest) > _CLEAR_OF * frequency[1]
    inside = np.flatnonzero(free & (frequency >= run.band[0]) & (frequency <= run.band[1]))
    above = free & (frequency > _ABOVE * run.band[1]) & (frequency < 0.45 * run.sample_rate)
    if len(inside) < _BAND_LINES or above.sum() < _BAND_LINES:
        return level
    power = np.sum(np.abs(spectrum[:, force]) ** 2, axis=1)
    chosen = [part[np.argmax(power[part])] for part in np.array_split(inside, _BAND_LINES)]
    floor = np.median(np.abs(spectrum[above]), axis=0)
    omega = np.asarray(2 * np.pi * frequency[chosen], dtype=float)
    return RecordLines(level.mean, floor, level.scatter, omega, spectrum[chosen])


#: Samples read at a time; signs and lines are judged on the first block [samples].
_BLOCK = 2**19
_FITTED = 2**16
_DECIMATED = 4000
#: Key of the finding that a record was computed without noise.
NO_NOISE = "no noise"
#: Samples that tell the quantiles of a channel, and whether it has noise.
_SPREAD = 8192
#: Share of the force below which the housing's inertia is not missed.
_NO_INERTIA = 1e-3
#: Inertia over force below which a housing stands on its cells.
_ON_CELLS = 0.1


@dataclass(frozen=True, repr=False)
class Observation(Directed):
    """One run, seen once: m vector channels that show something, none where it cannot be read."""

    run: Run
    report: Reporter
    channels: tuple[Channel, ...] = ()
    lines: RecordLines = field(default_factory=lambda: RecordLines.none(0))
    #: (3, m): 2 %, 50 % and 98 % quantiles of `channels`, SI
    spread: FloatArray = field(default_factory=lambda: np.empty((3, 0)))
    #: (n, m): thinned to a few thousand, SI; kept of clearance runs only
    samples: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    digest: str = ""
    speed: float = math.nan
    seconds: float = math.nan  #: how long the record is
    #: (3, m): sizes of 1X to 3X, SI; empty where nothing tells them
    shaft_lines: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    shaft_force: float = math.nan  #: sense of the 1X force, see `_sense`
    conditions: Conditions = ()  #: of its phasors

    def of(self, quantity: str) -> list[Channel]:
        """Channels of `quantity`."""
        return [c for c in self.channels if c.quantity == quantity]

    def names(self, quantity: str) -> list[str]:
        """Names of the channels of `quantity`."""
        return [c.name for c in self.of(quantity)]

    def mean(self, quantity: str) -> FloatArray:
        """X, Y of a quantity's mean (2,); NaN where its channels do not tell it."""
        return self.plane(quantity, self.lines.mean).real

    def line(self, quantity: str) -> ComplexArray:
        """X, Y of a quantity at the excitation line (2,); NaN where its channels do not tell it."""
        return self.plane(quantity, self.lines.phasor)

    @property
    def inertia(self) -> ComplexArray:
        """Of the housing at the excitation line, m_h a_h (2,) [N]; none where a is unknown."""
        return np.nan_to_num(self.run.housing_mass * self.line("acceleration"))

    @property
    def film_force(self) -> ComplexArray:
        """Force phasor of the film on the housing, F_cell + m_h a_h (2,) [N]."""
        return self.line("force") + self.inertia

    def shows(self, quantity: str) -> bool:
        """Whether a channel of a quantity shows the excitation line above its noise."""
        places = self.pick(quantity)
        size = np.abs(self.lines.phasor[places])
        return bool(np.any((size > 8 * self.lines.floor[places]) & (size > 0)))


def observe(run: Run, phasors: RunPhasors | None = None, line: int = 0) -> Observation:
    """Read every channel of `run` once, block by block, and judge each by itself.

    `phasors` are those of identification, of which an excitation line is meant; without them a dynamic run is fitted.
    """
    report = Reporter(run)
    try:
        length, cached = run.length, with_kept_beginning(run)
        report.take(run.reader.problems())
    except RigDataError as error:
        report.take(error.problems)
        return Observation(run, report)
    timed = _is_timed(report, run, length)
    statistics, first, digest = _scan(report, cached, length)
    alive = [run.channels[name] for name in first if statistics[name].values and not statistics[name].constant]
    live = tuple(channel for channel in alive if channel.quantity in VECTOR_QUANTITIES)
    used = np.stack([first[c.name] for c in live], axis=1) if live else np.empty((length, 0))
    lines, timed = RecordLines.none(len(live)), timed and bool(live)
    if phasors is None and timed and run.kind == "dynamic" and run.excitation_kind == "sine":
        phasors = _phasors(report, cached)
    if timed:
        lines = _lines(run, live, used[:_FITTED], phasors, line)
    noise_free = bool(first) and _is_noise_free(run, live, used, lines)
    if noise_free:
        report.ask(NO_NOISE)
    at_rest = frozenset() if phasors is None else _at_rest(phasors)
    for name in first:
        if not (name in at_rest and statistics[name].constant):
            check_signal(report, run.channels[name], statistics[name], noise_free, alive)
    speeds = [first[channel.name] for channel in run.of("speed") if channel.name in first]
    speed = next((float(np.nanmedian(values)) for values in speeds if np.isfinite(values).any()), math.nan)
    if not timed:
        return Observation(run, report, digest=digest, speed=speed)
    samples = used[:: max(1, len(used) // _DECIMATED)] if run.kind == "clearance" else np.empty((0, 0))
    observation = Observation(run, report, live, lines, _spread(used), samples, digest, speed, length / run.sample_rate)
    if phasors is None:
        return observation
    shown, stated = phasors.lines.excitation[line].frequency, run.point.excitation_hz
    report.ask("other frequency", abs(shown / stated - 1), shown=shown, stated=stated)
    turning, sense = shaft_lines(phasors, live)
    return replace(observation, shaft_lines=turning, shaft_force=sense, conditions=phasors.conditions)


def _is_timed(report: Reporter, run: Run, length: int) -> bool:
    """Whether the run's times can be used; what is wrong with them is reported."""
    try:
        time = run.time(0, min(length, _BLOCK))
        check_clock(report, time)
    except RigDataError as error:
        report.take(error.problems)
        return False
    return len(time) > 2


def _scan(report: Reporter, run: Run, length: int) -> tuple[dict[str, ChannelStatistics], dict[str, FloatArray], str]:
    """Read all blocks: statistics per channel, the first block in SI, a digest of the main readings."""
    channels = {n: c for n, c in run.channels.items() if c.quantity != "time"}
    statistics = {name: ChannelStatistics() for name in channels}
    digest, first = hashlib.sha256(), dict[str, FloatArray]()
    for start in range(0, length, _BLOCK):
        blocks = _read_block(report, run, channels, start, min(start + _BLOCK, length))
        channels = {n: channels[n] for n in blocks}
        for name, block in blocks.items():
            statistics[name].add(block)
            if channels[name].quantity in ALWAYS_NEEDED:
                digest.update(block.tobytes())
            if start == 0:
                first[name] = channels[name].to_si(block)
    for device in run.devices[1:]:  # judged at their own times
        for name in channels.keys() & device.channels:
            statistics[name] = ChannelStatistics()
            statistics[name].add(run.reader.read_device([name], 0, device.length)[0])
    first = {n: v for n, v in first.items() if n in channels}
    shown = any(channels[name].quantity in ALWAYS_NEEDED for name in first)
    return statistics, first, digest.hexdigest() if shown else ""


def _read_block(
    report: Reporter, run: Run, channels: Mapping[str, Channel], start: int, stop: int
) -> dict[str, FloatArray]:
    """Read one block; a channel that fails is reported, milder where the run can do without it, and left out."""
    try:
        return dict(zip(channels, run.reader.read(list(channels), start, stop)))
    except RigDataError:
        blocks = {}  # one by one, to tell all that fail
    for name, channel in channels.items():
        try:
            (blocks[name],) = run.reader.read([name], start, stop)
        except RigDataError as error:
            severity: Severity = "error" if needed(run, channel) else "warning"
            report.take([replace(problem, severity=severity) for problem in error.problems])
    return blocks


def _at_rest(phasors: RunPhasors) -> frozenset[str]:
    """Accelerometers along which the cells push so little that the housing's inertia is nothing beside the force.

    What they would show is that of the others, as the forces along both are.
    """
    cells = phasors.pick("force")
    accelerometers = phasors.pick("acceleration")
    if not phasors.z.size or len(cells) < 2 or len(accelerometers) < 2:
        return frozenset()
    line = np.nan_to_num(phasors.z[:, 0])
    force = line[:, cells] @ inverse_directions([phasors.channels[k] for k in cells]).T
    along = directions([phasors.channels[k].axis or 0.0 for k in accelerometers])
    push = np.median(np.abs(force @ along.T), axis=0)
    missed = _NO_INERTIA * np.median(np.linalg.norm(force, axis=1))
    size = phasors.housing_mass * np.median(np.abs(line[:, accelerometers]), axis=0)
    inertia = np.max(size / np.maximum(push, max(missed, 1e-300)))
    # a housing that hangs free moves without a push
    still = (0.0 < inertia < _ON_CELLS) & (inertia * push < missed)
    return frozenset(phasors.channels[k].name for k, rests in zip(accelerometers, still) if rests)


def _is_noise_free(run: Run, live: Sequence[Channel], used: FloatArray, lines: RecordLines) -> bool:
    """Whether noise stays below the converter's steps, as in records computed without noise."""
    main = [i for i, c in enumerate(live) if c.quantity in ALWAYS_NEEDED]
    for index in main:
        column = used[:_SPREAD, index]
        column = column[np.isfinite(column)]
        if len(column) < 10:
            return False
        # away from steady running nothing fits, but noise shows in the bends from sample to sample
        scatter = float(lines.scatter[index])
        noise = scatter if run.kind in {"dynamic", "locus"} and np.isfinite(lines.mean).any() else white_noise(column)
        steps = np.diff(np.unique(column[:4000]))
        if not noise <= max(0.7 * np.min(steps, initial=np.inf), 1e-7 * np.ptp(column)):
            return False
    return bool(main) or run.kind != "dynamic"


def _phasors(report: Reporter, run: Run) -> RunPhasors | None:
    """Phasors as identification extracts them; None where it refuses the run."""
    try:
        return run_phasors(run)
    except RecordTooShortError as error:
        report.ask("too short", error=error)
    except (RigDataError, TpjbError):  # the checks of the channels say what is wrong with them
        pass
    return None


def _lines(
    run: Run, channels: Sequence[Channel], values: FloatArray, phasors: RunPhasors | None, line: int
) -> RecordLines:
    """Excitation line of a sine; level of other running tests."""
    if phasors is not None:
        return excitation_line(phasors, line, channels)
    is_band = run.kind == "dynamic" and run.excitation_kind != "sine"
    if not is_band and run.kind != "locus":
        return RecordLines.none(len(channels))
    speed = run.point.shaft_speed_hz
    level = steady_level(values, run.sample_rate, [speed, 2 * speed, 50.0])
    force = [i for i, c in enumerate(channels) if c.quantity == "force"]
    return band_lines(run, level, values, force)


def _spread(values: FloatArray) -> FloatArray:
    """Quantiles column by column; NaN where a column has no value."""
    spread = np.full((3, values.shape[1]), np.nan)
    for index, column in enumerate(values[:: max(1, len(values) // _SPREAD)].T):
        finite_values = column[np.isfinite(column)]
        if len(finite_values):
            spread[:, index] = np.quantile(finite_values, [0.02, 0.5, 0.98])
    return spread
