"""Columns of a file at their own times: which are times, which serves which, and what is sampled together.

Nothing is interpolated: a slow channel's samples are its cells that are not empty, in order.
"""

import functools
import re
import tempfile
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import OVERFLOW, UNDESCRIBED, Channels
from rigdata.device import RATE_MISS, rate_of_time
from rigdata.problem import Problem
from rigdata.readers.base import RecordFile
from rigdata.units import TIME_FACTORS

#: Longer channels are in a file without a name, and are read from there in pieces [bytes].
IN_MEMORY = 2**23
_WORDS = (
    r"date[ /_-]*time|date and time|datum[ /_+-]*(?:und )?(?:uhr)?zeit|time|zeit(?:stempel)?|temps|tempo|tiempo|uhrzeit"
    r"|timestamps?|elapsed ?time|relative ?time|时间|時間|時刻|时刻"
)
_UNITS = "|".join(TIME_FACTORS)
# a lone t is a time, T and T1 are thermometers
_TIME = re.compile(rf"(?:(?i:{_WORDS})\b|t\s*[\[(]|(?:(?i:{_WORDS})|t)(?:_(?:{_UNITS}))?$)")
_TIME_UNIT = re.compile(rf"[\[(/,\s_]({_UNITS})\s*[\])]?$")
#: Two clocks whose samples differ by this share of a step count as one.
SAME_STEP = 0.01


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
        return np.nan if self.time is None else rate_of_time(self.time)


@dataclass(frozen=True)
class Contents:
    """What was read of a file."""

    series: Sequence[Series]
    clocks: Mapping[str, str] = field(default_factory=dict)  #: unit of every time column, by name; "" if not stated
    unread: tuple[str, ...] = ()  #: columns of numbers or texts that nobody describes
    problems: tuple[Problem, ...] = ()


def to_temporary_file(values: FloatArray) -> FloatArray:
    """Move a long channel (n,) out of memory, to a file without a name, which goes when nobody holds it any more."""
    if values.nbytes <= IN_MEMORY or isinstance(values, np.memmap):
        return values
    try:
        with tempfile.TemporaryFile(prefix="tpjb-") as file:
            values.tofile(file)
            return np.memmap(file, values.dtype, "r", shape=values.shape)
    except OSError:
        return values


class GrowingChannel(tempfile.SpooledTemporaryFile[bytes]):
    """A channel of a file that is parsed block by block; a long one waits in a file without a name."""

    def __init__(self) -> None:
        super().__init__(IN_MEMORY, prefix="tpjb-")

    def values(self) -> FloatArray:
        """All that was written (n,)."""
        size = self.tell()
        self.seek(0)
        if size <= IN_MEMORY:
            return np.frombuffer(self.read(), np.float64)
        return np.memmap(self, np.float64, "r", shape=(size // 8,))


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


def time_unit(name: str, unit: str) -> str:
    """Unit of a time column: stated, or in its name (``time_ms``, ``Zeit [ms]``); "" where there is none."""
    symbol = unit.strip().strip("[]()")
    in_name = _TIME_UNIT.search(name.strip())
    return symbol if symbol in TIME_FACTORS else in_name[1] if in_name else ""


def seconds(column: Series) -> FloatArray:
    """Times (n,) of a column in seconds, which count where it has no unit."""
    with np.errstate(invalid="ignore"):  # a signalling NaN is a missing value as well
        return column.values * TIME_FACTORS.get(time_unit(column.name, column.unit), 1.0)


def time_columns(names: Sequence[str], channels: Channels) -> list[int]:
    """Places of the time columns: those described as such, else those named like one that nobody describes."""
    described, likely = [], []
    for place, name in enumerate(names):
        if name in channels:
            if channels[name].quantity == "time":
                described.append(place)
        elif is_time(name.rpartition(".")[2]):
            likely.append(place)
    return described or likely


def serving(names: Sequence[str], clocks: Sequence[int], channels: Channels) -> list[int | None]:
    """Place of every column's time column: of the clock that it states, else the nearest without one to its left."""
    letters = [channels.get(name, UNDESCRIBED).clock for name in names]
    lettered, plain = {}, []
    for i in clocks:
        if letters[i]:
            lettered[letters[i]] = i
        else:
            plain.append(i)
    nearest = plain[0] if plain else None
    places = []
    for i, letter in enumerate(letters):
        nearest = i if i in plain else nearest
        places.append(lettered.get(letter, nearest))
    return places


def table(contents: Contents, record: RecordFile) -> Contents:
    """Channels of a table at the times of their time columns; of these, only those that are described stay channels.

    Where not all columns have one time column, rows without a cell of a device are none of its samples.
    """
    channels = record.channels
    series, names = list(contents.series), [column.name for column in contents.series]
    clocks = time_columns(names, channels)
    groups: dict[int | None, list[int]] = {i: [] for i in (None, *clocks)}
    for i in clocks:
        series[i] = replace(series[i], unit=time_unit(names[i], series[i].unit))
    for i, clock in enumerate(serving(names, clocks, channels)):
        if i in clocks:
            if names[i] in channels:
                groups[i].append(i)
            continue
        if clock is not None and len(series[clock]) != len(series[i]):
            clock = next((candidate for candidate in clocks if len(series[candidate]) == len(series[i])), None)
        groups[clock if series[i].time is None else None].append(i)
    lengths = {len(series[i]) for i in groups.pop(None) if series[i].time is None}
    is_shared = len(clocks) == 1 and len(series[clocks[0]]) not in lengths
    for clock, members in groups.items():
        column = series[clock or 0]
        channel = channels.get(column.name)
        time = seconds(column) if channel is None else channel.to_si(column.values)
        rows = slice(None) if is_shared else _filled_rows([time, *(series[i].values for i in members)])
        time = time[rows]
        usable = np.flatnonzero(np.abs(time) < OVERFLOW)
        if len(usable) not in (0, len(time)):  # missing times are set between their neighbours
            time = np.interp(np.arange(len(time)), usable, time[usable])
        for i in members:
            values, group = to_temporary_file(series[i].values[rows]), series[i].group
            series[i] = replace(series[i], values=values, time=time, group=group if is_shared else column.name or group)
    ordered = [column for i, column in enumerate(series) if i not in clocks or names[i] in channels]
    if is_shared or not clocks:
        ordered = _slow_columns(ordered, record)
    return replace(contents, series=ordered, clocks={names[i]: series[i].unit for i in clocks})


def _slow_columns(series: Sequence[Series], record: RecordFile) -> list[Series]:
    """Columns of a stated rate other than that of the rows: their cells, at the times of their rows if these agree."""
    rows_rate = record.stated_rate
    slow = defaultdict(list)
    for i, column in enumerate(series):
        channel = record.channels.get(column.name, UNDESCRIBED)
        rate = column.rate if column.time is not None else (rows_rate or np.nan)
        if channel.sample_rate and not abs(channel.sample_rate / rate - 1.0) <= RATE_MISS:
            slow[channel.clock, channel.sample_rate, len(column)].append(i)
    placed = list(series)
    for (_, rate, length), members in slow.items():
        rows = _filled_rows([series[i].values for i in members])
        if rows.all() or not rows.any():
            continue
        time = series[members[0]].time
        if time is None and rows_rate:
            time = equidistant(length, 1.0 / rows_rate)
        if time is not None:
            time = time[rows]
            agrees = abs(rate_of_time(time) / rate - 1.0) <= RATE_MISS
            even = bool(np.all(np.abs(time * rate - np.arange(len(time))) < SAME_STEP))
            time = time if agrees and not even else None
        for i in members:
            placed[i] = replace(series[i], values=to_temporary_file(series[i].values[rows]), time=time)
    return placed


def _filled_rows(columns: Sequence[FloatArray]) -> BoolArray:
    """Rows (n,) in which any of the columns has a value."""
    rows = np.zeros(len(columns[0]), dtype=bool)
    for column in columns:
        rows |= np.isfinite(column)
    return rows
