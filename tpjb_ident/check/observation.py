"""What one pass over a run's samples leaves for the checks that compare runs."""

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
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.lines import RecordLines, band_lines, excitation_line, other_line, steady_level
from tpjb_ident.check.rotation import shaft_force
from tpjb_ident.check.signals import check_clock, check_signal, needed
from tpjb_ident.errors import TpjbError
from tpjb_ident.phasors.bad_samples import white_noise
from tpjb_ident.phasors.reading_cache import with_kept_beginning
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.run_phasors import run_phasors
from tpjb_ident.phasors.windows import RecordTooShortError

#: Samples read at a time; signs and lines are judged on the first block [samples].
_BLOCK = 2**19
_FITTED = 2**16
_DECIMATED = 4000
#: Share of the set point by which an excitation may be off.
OFF_SET_POINT = 0.02
#: Key of the finding that a record was computed without noise.
NO_NOISE = "no noise"
#: Samples that tell the quantiles of a channel, and whether it has noise.
_SPREAD = 8192


@dataclass(frozen=True)
class Observation:
    """One run, seen once."""

    run: Run
    channels: tuple[Channel, ...]
    lines: RecordLines | None = field(repr=False)
    spread: FloatArray = field(repr=False)  #: (3, m): 2 %, 50 % and 98 % quantiles of `channels`, SI
    other_line: float
    #: (n, m): thinned to a few thousand, SI; kept of clearance runs only
    samples: FloatArray = field(repr=False)
    speed: float
    digest: str
    report: Reporter = field(repr=False)
    band: ComplexArray = field(default_factory=lambda: np.empty((0, 0), complex), repr=False)  #: (k, m) complex
    omega: FloatArray = field(default_factory=lambda: np.empty(0), repr=False)  #: (k,), rad/s: of `band`
    shaft_force: float = math.nan  #: see `tpjb_ident.check.rotation`

    @property
    def phasors(self) -> list[tuple[float, ComplexArray]]:
        """Frequency [rad/s] and phasors (m,) of `channels` at every line of the excitation that is looked at, SI."""
        if self.run.excitation_kind != "sine" or self.lines is None:
            return list(zip(self.omega.tolist(), self.band))
        return [(self.run.point.excitation, self.lines.phasor)]

    def pick(self, quantity: str) -> list[int]:
        """Places of the channels of `quantity` in `channels`."""
        return [i for i, c in enumerate(self.channels) if c.quantity == quantity]

    def of(self, quantity: str) -> list[Channel]:
        """Channels of `quantity`."""
        return [c for c in self.channels if c.quantity == quantity]


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
        return _blind(run, report)
    time = _usable_time(report, run, length)
    statistics, first, digest = _scan(report, cached, length)
    readable = {n: run.channels[n] for n in first}
    if not readable:
        return _blind(run, report)
    live = tuple(c for n, c in readable.items() if c.quantity in VECTOR_QUANTITIES and not _is_dead(statistics[n]))
    used = np.stack([first[c.name] for c in live], axis=1) if live else np.empty((length, 0))
    if phasors is None and time is not None and run.kind == "dynamic" and run.excitation_kind == "sine":
        phasors = _phasors(report, cached)
    lines = _lines(run, live, used[:_FITTED], phasors, line) if time is not None and live else None
    noise_free = _is_noise_free(run, live, used, lines)
    if noise_free:
        report.say(NO_NOISE, "note", "", "the readings show no noise", "Nothing, if the data are computed")
    alive = [c for name, c in readable.items() if not _is_dead(statistics[name])]
    for name, channel in readable.items():
        check_signal(report, channel, statistics[name], noise_free, alive)
    if time is None or not live:
        return replace(_blind(run, report), digest=digest, speed=_mean_speed(readable, first))
    thin = slice(None, None, max(1, len(time) // _DECIMATED))
    band, omega, lines = _over_band(run, live, used[:_FITTED], lines)
    places = range(len(phasors.lines.excitation)) if phasors is not None else ()
    astray = [k for k in places if phasors is not None and not _near_set_point(run, phasors, k)]
    return Observation(
        run=run,
        channels=live,
        lines=lines,
        spread=_spread(used),
        other_line=other_line(phasors, astray),
        samples=used[thin] if run.kind == "clearance" else np.empty((0, len(live))),
        speed=_mean_speed(readable, first),
        digest=digest,
        report=report,
        band=band,
        omega=omega,
        shaft_force=shaft_force(phasors),
    )


def _over_band(
    run: Run, live: Sequence[Channel], used: FloatArray, lines: RecordLines | None
) -> tuple[ComplexArray, FloatArray, RecordLines | None]:
    """Phasors at some lines of a band, their frequencies [rad/s], and the run's lines with what noise makes of one."""
    if run.excitation_kind == "sine" or lines is None:
        return np.empty((0, len(live)), complex), np.empty(0), lines
    turning = [run.point.shaft_speed_hz] if run.point.shaft_speed > 0 else []
    force = [i for i, c in enumerate(live) if c.quantity == "force"]
    rows, floor, frequencies = band_lines(run, used, force, [*turning, *MAINS_FREQUENCIES])
    first = rows[0] if len(rows) else np.full(len(live), np.nan + 0j)
    return rows, 2 * np.pi * frequencies, replace(lines, phasor=first, floor=floor)


def _usable_time(report: Reporter, run: Run, length: int) -> FloatArray | None:
    try:
        time = run.time(0, min(length, _BLOCK))
        check_clock(report, time)
    except RigDataError as error:
        report.take(error.problems)
        return None
    return time if len(time) > 2 else None


def _scan(report: Reporter, run: Run, length: int) -> tuple[dict[str, ChannelStatistics], dict[str, FloatArray], str]:
    """Read all blocks: statistics per channel, the first block in SI, a digest of the main readings."""
    channels = {n: c for n, c in run.channels.items() if c.quantity != "time"}
    statistics = {name: ChannelStatistics() for name in channels}
    digests = {n: hashlib.sha256() for n, c in channels.items() if c.quantity in {"displacement", "force"}}
    first: dict[str, FloatArray] = {}
    for start in range(0, length, _BLOCK):
        blocks = _read_block(report, run, channels, start, min(start + _BLOCK, length))
        channels = {n: channels[n] for n in blocks}
        for name, block in blocks.items():
            statistics[name].add(block)
            if name in digests:
                digests[name].update(block.tobytes())
            if start == 0:
                first[name] = channels[name].to_si(block)
    first = {n: v for n, v in first.items() if n in channels}
    digest_text = "".join(digests[n].hexdigest() for n in first if n in digests)
    return statistics, first, hashlib.sha256(digest_text.encode()).hexdigest() if digest_text else ""


def _read_block(
    report: Reporter, run: Run, channels: Mapping[str, Channel], start: int, stop: int
) -> dict[str, FloatArray]:
    """Read one block; a channel that fails is reported, by what the run needs, and left out."""
    try:
        return dict(zip(channels, run.reader.read(list(channels), start, stop)))
    except RigDataError:
        blocks: dict[str, FloatArray] = {}  # one by one, to tell all that fail
    for name, channel in channels.items():
        try:
            (blocks[name],) = run.reader.read([name], start, stop)
        except RigDataError as error:
            report.take(error.problems if needed(run, channel) else [_milder(p) for p in error.problems])
    return blocks


def _blind(run: Run, report: Reporter) -> Observation:
    return Observation(run, (), None, np.empty((3, 0)), math.nan, np.empty((0, 0)), math.nan, "", report)


def _milder(problem: Problem) -> Problem:
    """A fault of a channel that the run can do without."""
    return replace(problem, severity="warning" if problem.severity == "error" else problem.severity)


def _is_dead(statistics: ChannelStatistics) -> bool:
    return statistics.values == 0 or statistics.constant


def _is_noise_free(run: Run, live: Sequence[Channel], used: FloatArray, lines: RecordLines | None) -> bool:
    """Whether noise stays below the converter's steps, as in records computed without noise."""
    main = [i for i, c in enumerate(live) if c.quantity in {"displacement", "force"}]
    if not main:
        return run.kind != "dynamic"
    for index in main:
        column = used[:_SPREAD, index]
        column = column[np.isfinite(column)]
        if len(column) < 10:
            return False
        # away from steady running nothing fits, but noise shows in the bends from sample to sample
        fitted = lines is not None and run.kind in {"dynamic", "locus"}
        noise = float(lines.scatter[index]) if fitted and lines is not None else white_noise(column)
        steps = np.diff(np.unique(column[:4000]))
        if not noise <= max(0.7 * float(np.min(steps, initial=np.inf)), 1e-7 * float(np.ptp(column))):
            return False
    return True


def _phasors(report: Reporter, run: Run) -> RunPhasors | None:
    """Phasors as identification extracts them; None where it refuses the run."""
    try:
        return run_phasors(run, 0.0)
    except RecordTooShortError as error:
        report.say("too short", "warning", "time", f"is too short: {error}", "Record longer")
    except (RigDataError, TpjbError):  # the checks of the channels say what is wrong with them
        pass
    return None


def _lines(
    run: Run, channels: Sequence[Channel], values: FloatArray, phasors: RunPhasors | None, line: int
) -> RecordLines | None:
    if phasors is not None:
        lines = excitation_line(phasors, line, channels)
        return lines if _near_set_point(run, phasors, line) else replace(lines, phasor=np.zeros_like(lines.phasor))
    if run.kind == "locus" or (run.kind == "dynamic" and run.excitation_kind != "sine"):
        speed = run.point.shaft_speed_hz
        return steady_level(values, run.sample_rate, [speed, 2 * speed, 50.0])
    return None


def _near_set_point(run: Run, phasors: RunPhasors, line: int) -> bool:
    """Whether a run is excited where it is said to be: a generator is not off by hertz."""
    stated = run.point.excitation_hz
    return abs(phasors.lines.excitation[line].frequency - stated) <= OFF_SET_POINT * max(stated, 1e-9)


def _spread(values: FloatArray) -> FloatArray:
    """Quantiles column by column; NaN where a column has no value."""
    spread = np.full((3, values.shape[1]), np.nan)
    for index, column in enumerate(values[:: max(1, len(values) // _SPREAD)].T):
        finite_values = column[np.isfinite(column)]
        if len(finite_values):
            spread[:, index] = np.quantile(finite_values, [0.02, 0.5, 0.98])
    return spread


def _mean_speed(channels: Mapping[str, Channel], first: Mapping[str, FloatArray]) -> float:
    for name, channel in channels.items():
        if channel.quantity == "speed" and np.isfinite(first[name]).any():
            return float(np.nanmedian(first[name]))
    return math.nan
