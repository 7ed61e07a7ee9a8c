"""Channels of one file at their own times: which time column serves which, and what is sampled together.

Nothing is interpolated: a slow channel's samples are its cells that are not empty, in order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import Channel
from rigdata.device import RATE_MISS, Grid, Timing, planned
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import rate_of_time
from rigdata.readers.series import Series, equidistant, is_time, seconds, to_temporary_file

#: Two clocks whose samples differ by this share of a step count as one.
_SAME = 0.01
_MOST_TIMES = 1000


@dataclass(frozen=True)
class Layout:
    """All channels of a file at their own times."""

    grids: tuple[Grid, ...]  #: the run's own device first
    values: Mapping[str, FloatArray]
    times: Mapping[str, FloatArray]  #: by clock, s
    faults: Mapping[str, RigDataError]  #: of channels without usable times
    units: Mapping[str, str]  #: as the file states them
    problems: tuple[Problem, ...] = ()

    @property
    def nbytes(self) -> int:
        """Size of all channels [bytes]."""
        return sum(array.nbytes for array in (*self.values.values(), *self.times.values()))

    def time(self, grid: Grid, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,) of some channels' samples."""
        if not grid.clock:
            return grid.begin + np.arange(start, stop) / grid.rate
        return self.times[grid.clock][start:stop].copy()


def time_columns(names: Sequence[str], channels: Mapping[str, Channel]) -> list[int]:
    """Places of the time columns: those described as such, else those named like one that nobody describes."""
    described = [i for i, name in enumerate(names) if name in channels and channels[name].quantity == "time"]
    return described or [i for i, n in enumerate(names) if n not in channels and is_time(n.rpartition(".")[2])]


def serving(names: Sequence[str], clocks: Sequence[int], channels: Mapping[str, Channel]) -> list[int | None]:
    """Place of every column's time column: of the clock that it states, else the nearest without one to its left."""
    letters: dict[str, int] = {}
    plain: list[int] = []
    for i in clocks:
        letter = _letter(names[i], channels)
        if letter:
            letters[letter] = i
        else:
            plain.append(i)
    nearest = plain[0] if plain else None
    served: list[int | None] = []
    for i, name in enumerate(names):
        nearest = i if i in plain else nearest
        served.append(letters.get(_letter(name, channels), nearest))
    return served


def _letter(name: str, channels: Mapping[str, Channel]) -> str:
    return channels[name].clock if name in channels else ""


def table(series: Sequence[Series], channels: Mapping[str, Channel], stated_rate: float | None = None) -> list[Series]:
    """Channels of a table at the times of their time columns, which are no channels any more.

    Where not all columns have one time column, rows without a cell of a device are none of its samples.
    """
    names = [column.name for column in series]
    clocks = time_columns(names, channels)
    groups: dict[int | None, list[int]] = {i: [] for i in (None, *clocks)}
    for i, clock in enumerate(serving(names, clocks, channels)):
        if clock is not None and len(series[clock]) != len(series[i]):
            clock = next((other for other in clocks if len(series[other]) == len(series[i])), None)
        if i not in groups:
            groups[clock if series[i].time is None else None].append(i)
    rest = [series[i] for i in groups[None] if series[i].time is None]
    is_shared = len(clocks) == 1 and not any(len(column) == len(series[clocks[0]]) for column in rest)
    placed = {i: series[i] for i in groups.pop(None)}
    for clock, members in groups.items():
        column = series[clock or 0]
        known = channels.get(column.name)
        time = seconds(column.values, column.unit) if known is None else known.to_si(column.values)
        label = "" if is_shared else column.name
        rows = slice(None) if is_shared else _filled_rows([time, *(series[i].values for i in members)])
        time = _without_gaps(time[rows])
        for i in members:
            values = to_temporary_file(series[i].values[rows])
            placed[i] = replace(series[i], values=values, time=time, group=label or series[i].group)
    ordered = [placed[i] for i in sorted(placed)]
    return _slow_columns(ordered, channels, stated_rate) if is_shared or not clocks else ordered


def _slow_columns(series: Sequence[Series], channels: Mapping[str, Channel], rows_rate: float | None) -> list[Series]:
    """Columns of a stated rate other than that of the rows: their cells, at the times of their rows if these agree."""
    slow: dict[tuple[str, float, int], list[int]] = {}
    for i, column in enumerate(series):
        known = channels.get(column.name)
        rate = column.rate if column.time is not None else (rows_rate or np.nan)
        if known is not None and known.sample_rate and not abs(known.sample_rate / rate - 1.0) <= RATE_MISS:
            slow.setdefault((known.clock, known.sample_rate, len(column)), []).append(i)
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
            even = bool(np.all(np.abs(time * rate - np.arange(len(time))) < _SAME))
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


def _without_gaps(time: FloatArray) -> FloatArray:
    """Times with missing ones set between their neighbours."""
    usable = np.flatnonzero(np.isfinite(time))
    if len(usable) in (0, len(time)):
        return time
    return np.interp(np.arange(len(time)), usable, time[usable])


def arranged(
    series: Sequence[Series], channels: Mapping[str, Channel], stated_rate: float | None, file: str, run: str | None
) -> Layout:
    """Put channels that share their times together; what has no usable times is a fault of that channel."""
    if not series:
        raise refuse(file, "", "holds no channel of numbers", "Export the run again, with its channels", run)
    faults: dict[str, RigDataError] = {}
    timings: dict[str, Timing] = {}
    times: dict[str, FloatArray] = {}
    for channel in series:
        place = f"channel {channel.name}"
        if channel.time is None:
            timings[channel.name] = Timing(len(channel))
        elif not np.isfinite(channel.time).all() or np.any(np.diff(channel.time) < 0):
            back = np.append(np.flatnonzero(~(np.diff(channel.time) >= 0)), -1)
            fault = f"its times have gaps or run backwards (sample {int(back[0]) + 2})"
            faults[channel.name] = refuse(file, place, fault, "Sort or split the run, or export without times", run)
        else:
            clock = next((key for key, time in times.items() if _alike(time, channel.time)), str(len(times) + 1))
            times.setdefault(clock, channel.time)
            if len(times) > _MOST_TIMES:
                raise refuse(file, "", f"has more than {_MOST_TIMES} different times", "Split the run", run)
            rate = rate_of_time(times[clock])
            label = channel.group if is_time(channel.group) else f"{rate:.6g} Hz"
            timings[channel.name] = Timing(len(channel), clock, rate, label)
    grids, texts = planned(timings, channels, stated_rate, lambda clock: float(times[clock][0]))
    for name, text in texts.items():
        faults[name] = refuse(file, f"channel {name}", text, "Export it with its times, or correct sample_rate", run)
    if not grids:
        raise RigDataError([problem for error in faults.values() for problem in error.problems])
    units = {channel.name: channel.unit for channel in series}
    return Layout(grids, {channel.name: channel.values for channel in series}, times, faults, units)


def _alike(time: FloatArray, other: FloatArray) -> bool:
    """Whether two channels are sampled at the same times."""
    if time is other or len(time) != len(other):
        return time is other
    step = (other[-1] - other[0]) / max(len(other) - 1, 1) if len(other) else 0.0
    return bool(np.all(np.abs(time - other) <= _SAME * step))
