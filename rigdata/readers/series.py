"""One column of a foreign file on its own clock: which columns are times, and how several clocks come onto one."""

from __future__ import annotations

import functools
import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import MAX_REQUEST, rate_of_time

#: Channels larger than this wait in a file without a name, and are read from there in pieces [bytes].
SET_ASIDE = 2**23
#: Two clocks whose samples lie this share of a step apart count as one.
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

    values: dict[str, FloatArray] = field(repr=False)
    units: dict[str, str]
    time: FloatArray | None = field(repr=False, default=None)
    notes: tuple[str, ...] = ()

    @property
    def nbytes(self) -> int:
        """Size of all channels [bytes], in memory or set aside."""
        return sum(a.nbytes for a in self.values.values()) + (0 if self.time is None else self.time.nbytes)

    @property
    def length(self) -> int:
        """Samples per channel."""
        return len(next(iter(self.values.values()))) if self.values else 0


def set_aside(values: FloatArray) -> FloatArray:
    """Move a long channel out of memory: it is in a file without a name, which goes when nobody holds it any more."""
    if values.nbytes <= SET_ASIDE or isinstance(values, np.memmap):
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
    return set_aside(seconds)


def without_twins(series: Sequence[Series]) -> list[Series]:
    """Give channels of one name in several groups the group's name as a prefix; number what is still alike."""
    counts: dict[str, int] = {}
    for one in series:
        counts[one.name] = counts.get(one.name, 0) + 1
    named = [replace(s, name=f"{s.group}.{s.name}") if counts[s.name] > 1 and s.group else s for s in series]
    seen: dict[str, int] = {}
    out = []
    for one in named:
        seen[one.name] = seen.get(one.name, 0) + 1
        out.append(one if seen[one.name] == 1 else replace(one, name=f"{one.name}_{seen[one.name]}"))
    return out


def on_one_clock(series: Sequence[Series], file: str, run: str | None = None) -> Columns:
    """Bring channels of several clocks onto that of the fastest one.

    Slower channels (temperatures beside displacements) are interpolated linearly between their samples and missing
    (NaN) before their first and after their last one.
    """
    chosen = without_twins(series)
    if not chosen:
        raise _refuse(file, run, "holds no channel of numbers", "Export the run again, with its channels")
    timed = [s for s in chosen if s.time is not None and len(s) > 1]
    lengths = {len(s) for s in chosen}
    if not timed:
        if len(lengths) > 1:
            what = f"has channels of {len(lengths)} different lengths and no times"
            raise _refuse(file, run, what, "Export with a time channel, or channels of one length")
        values = {s.name: s.values for s in chosen}
        return Columns(values, {s.name: s.unit for s in chosen})
    master = max(timed, key=lambda s: (s.rate, len(s)))
    clock = _checked(master, file, run)
    if len(clock) * len(chosen) > MAX_REQUEST:
        raise _refuse(file, run, f"has {len(clock)} samples of {len(chosen)} channels", "Split the run")
    values, moved = {}, []
    for one in chosen:
        if one.time is None:
            if len(one) != len(clock):
                what = f"channel {one.name} has {len(one)} samples and no times, {master.name} has {len(clock)}"
                raise _refuse(file, run, what, "Export it with its time channel")
            values[one.name] = one.values
        elif _alike(one.time, clock):
            values[one.name] = one.values
        else:
            values[one.name] = _interpolated(one, clock, file, run)
            moved.append(f"{one.name} ({one.rate:.4g} Hz)")
    notes: tuple[str, ...] = ()
    if moved:
        notes = (f"interpolated onto the clock of {master.name} ({master.rate:.6g} Hz): {', '.join(moved[:8])}",)
    return Columns(values, {s.name: s.unit for s in chosen}, clock, notes)


def _checked(one: Series, file: str, run: str | None) -> FloatArray:
    assert one.time is not None
    time = np.asarray(one.time, dtype=float)
    if not np.isfinite(time).all() or np.any(np.diff(time) < 0):
        what = f"the times of {one.name} have gaps or run backwards"
        raise _refuse(file, run, what, "Sort or split the run, or export without times and state sample_rate")
    return time


def _alike(time: FloatArray, clock: FloatArray) -> bool:
    if time is clock:
        return True
    if len(time) != len(clock):
        return False
    step = (clock[-1] - clock[0]) / max(len(clock) - 1, 1)
    return bool(np.all(np.abs(time - clock) <= _SAME * step))


def _interpolated(one: Series, clock: FloatArray, file: str, run: str | None) -> FloatArray:
    time = _checked(one, file, run)
    known = np.isfinite(one.values)
    if not known.any():
        return np.full(len(clock), np.nan)
    return set_aside(np.interp(clock, time[known], one.values[known], left=np.nan, right=np.nan))


def _refuse(file: str, run: str | None, what: str, cure: str) -> RigDataError:
    return RigDataError(Problem("error", file, "", what, cure, run))


def is_time(name: str) -> bool:
    """Whether a column of this name holds times.

    >>> [is_time(n) for n in ("Zeit", "Time  1 - default sample rate", "t", "T", "T1", "Temperature")]
    [True, True, True, False, False, False]
    """
    return bool(_TIME.match(name.strip()))


def seconds(values: FloatArray, unit: str) -> FloatArray:
    """Times in seconds; an unknown unit counts as seconds."""
    return values * _FACTORS.get(unit.strip().strip("[]()"), 1.0)
