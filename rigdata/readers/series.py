"""One column of a file at its own times, and which columns are times."""

from __future__ import annotations

import functools
import re
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem
from rigdata.readers.base import rate_of_time

#: Longer channels are in a file without a name, and are read from there in pieces [bytes].
IN_MEMORY = 2**23
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
    """Channels of one length."""

    values: dict[str, FloatArray] = field(repr=False)  #: (n,) each
    problems: tuple[Problem, ...] = ()

    @property
    def nbytes(self) -> int:
        """Size of all channels [bytes], in memory or in temporary files."""
        return sum(a.nbytes for a in self.values.values())

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


def is_time(name: str) -> bool:
    """Whether a column of this name holds times.

    >>> [is_time(n) for n in ("Zeit", "Time  1 - default sample rate", "t", "T", "T1", "Temperature")]
    [True, True, True, False, False, False]
    """
    return bool(_TIME.match(name.strip()))


def seconds(values: FloatArray, unit: str) -> FloatArray:
    """Times (n,) in seconds; an unknown unit counts as seconds."""
    return values * _FACTORS.get(unit.strip().strip("[]()"), 1.0)
