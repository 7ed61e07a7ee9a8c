"""One column of a foreign file on its own clock: which columns are times, and how several clocks come onto one."""

from __future__ import annotations

import functools
import re
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, refuse
from rigdata.readers.base import SAMPLE, rate_of_time, refuse_claim

#: Longer channels are in a file without a name, and are read from there in pieces [bytes].
IN_MEMORY = 2**23
#: Two clocks whose samples differ by this share of a step count as one.
_SAME = 0.01
_WORDS = (
    r"date[ /_-]*time|date and time|datum[ /_+-]*(?:und )?(?:uhr)?zeit|time|zeit(?:stempel)?|temps|tempo|tiempo|uhrzeit"
    r"|timestamps?|elapsed ?time|relative ?time"
)
# a lone t is a time, T and T1 are thermometers
_TIME = re.compile(rf"(?:(?i:{_WORDS})\b|t$|t\s*[\[(])")
_FACTORS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Series:
    """One channel as a file holds it.

    Attributes
    ----------
    name : str
    unit : str
        As the file states it; "" if it does not.
    values : (n,) ndarray
        Readings, NaN where missing.
    time : (n,) ndarray or None
        Seconds; None where the file knows no times.
    group : str
        Where in the file, for messages.
    """

    name: str
    unit: str
    values: FloatArray = field(repr=False)
    time: FloatArray | None = field(repr=False, default=None)
    group: str = ""

    def __len__(self) -> int:
        return len(self.values)

    @property
    def rate(self) -> float:
        """Nominal sample rate [Hz]; NaN if the file knows no times."""
        return float("nan") if self.time is None else rate_of_time(self.time)


@dataclass(frozen=True)
class Columns:
    """Channels on one clock."""

    values: dict[str, FloatArray] = field(repr=False)  #: (n,) each
    time: FloatArray | None = field(repr=False, default=None)  #: (n,), s
    problems: tuple[Problem, ...] = ()
    units: dict[str, str] = field(default_factory=dict)  #: as the file states them

    @property
    def nbytes(self) -> int:
        """Size of all channels [bytes], in memory or in temporary files."""
        return sum(a.nbytes for a in self.values.values()) + (0 if self.time is None else self.time.nbytes)

    @property
    def length(self) -> int:
        """Samples per channel."""
        return len(next(iter(self.values.values()))) if self.values else 0


def to_temporary_file(values: FloatArray) -> FloatArray:
    """Move a long channel (n,) out of memory, to a file without a name, which goes when nobody holds it any more."""
    if values.nbytes <= IN_MEMORY or isinstance(values, np.memmap):
        return values
    try:
        with tempfile.TemporaryFile(prefix="tpjb-") as file:
            values.tofile(file)
            file.flush()
            return np.memmap(file, dtype=values.dtype, mode="r", shape=values.shape)
    except OSError:
        return values


@functools.lru_cache(maxsize=1)  # the channels of a file mostly share one clock
def equidistant(count: int, step: float, start: float = 0.0) -> FloatArray:
    """Seconds of `count` samples, `step` apart."""
    seconds = start + step * np.arange(count, dtype=np.float64)
    seconds.flags.writeable = False
    return to_temporary_file(seconds)


def with_unique_names(series: Sequence[Series]) -> list[Series]:
    """Give channels of one name in several groups the group's name as a prefix; number what is still alike."""
    counts = Counter(channel.name for channel in series)
    used: Counter[str] = Counter()
    unique = []
    for channel in series:
        name = channel.name
        if counts[name] > 1 and channel.group:
            name = f"{channel.group}.{name}"
        used[name] += 1
        unique.append(replace(channel, name=name if used[name] == 1 else f"{name}_{used[name]}"))
    return unique


def on_one_clock(series: Sequence[Series], file: str, run: str | None = None) -> Columns:
    """Bring channels of several clocks onto that of the fastest one.

    Slower channels (temperatures compared with displacements) are interpolated linearly between their samples and
    missing (NaN) before their first and after their last one.
    """
    channels = with_unique_names(series)
    if not channels:
        raise refuse(file, "", "holds no channel of numbers", "Export the run again, with its channels", run)
    units = {channel.name: channel.unit for channel in channels}
    timed = [channel for channel in channels if channel.time is not None and len(channel) > 1]
    if not timed:
        lengths = {len(channel) for channel in channels}
        if len(lengths) > 1:
            fault = f"has channels of {len(lengths)} different lengths and no times"
            raise refuse(file, "", fault, "Export with a time channel, or channels of one length", run)
        return Columns({channel.name: channel.values for channel in channels}, units=units)
    master = max(timed, key=lambda channel: (channel.rate, len(channel)))
    clock = _rising_times(master, file, run)
    stored = sum(len(channel) for channel in channels)
    refuse_claim(SAMPLE * len(clock) * len(channels), SAMPLE * stored, file, run)
    values, interpolated = {}, []
    for channel in channels:
        values[channel.name] = channel.values
        if channel.time is None:
            if len(channel) != len(clock):
                fault = f"channel {channel.name} has {len(channel)} samples and no times"
                fault += f", {master.name} has {len(clock)}"
                raise refuse(file, "", fault, "Export it with its time channel", run)
        elif not _alike(channel.time, clock):
            times = _rising_times(channel, file, run)
            values[channel.name] = _interpolated(times, channel.values, clock)
            interpolated.append(f"{channel.name} ({channel.rate:.4g} Hz)")
    problems: tuple[Problem, ...] = ()
    if interpolated:
        names = ", ".join(interpolated[:8])
        fault = f"interpolated onto the clock of {master.name} ({master.rate:.6g} Hz): {names}"
        problems = (Problem("note", file, "", fault, "Nothing, if that is meant", run),)
    return Columns(values, clock, problems, units)


def _rising_times(channel: Series, file: str, run: str | None) -> FloatArray:
    time = np.asarray(channel.time, dtype=float)
    if not np.isfinite(time).all() or np.any(np.diff(time) < 0):
        fault = f"the times of {channel.name} have gaps or run backwards"
        raise refuse(file, "", fault, "Sort or split the run, or export without times and state sample_rate", run)
    return time


def _alike(time: FloatArray, clock: FloatArray) -> bool:
    if time is clock:
        return True
    if len(time) != len(clock):
        return False
    step = (clock[-1] - clock[0]) / max(len(clock) - 1, 1)
    return bool(np.all(np.abs(time - clock) <= _SAME * step))


def _interpolated(time: FloatArray, values: FloatArray, clock: FloatArray) -> FloatArray:
    finite = np.isfinite(values)
    if not finite.any():
        return np.full(len(clock), np.nan)
    return to_temporary_file(np.interp(clock, time[finite], values[finite], left=np.nan, right=np.nan))


def is_time(name: str) -> bool:
    """Whether a column of this name holds times.

    >>> [is_time(n) for n in ("Zeit", "Time  1 - default sample rate", "t", "T", "T1", "Temperature")]
    [True, True, True, False, False, False]
    """
    return bool(_TIME.match(name.strip()))


def seconds(values: FloatArray, unit: str) -> FloatArray:
    """Times (n,) in seconds; an unknown unit counts as seconds."""
    return values * _FACTORS.get(unit.strip().strip("[]()"), 1.0)
