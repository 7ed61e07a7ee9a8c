"""Files that are parsed as a whole: their columns, the last used of a campaign, as many as memory allows."""

from __future__ import annotations

import stat
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.device import Grid
from rigdata.near_names import hint
from rigdata.problem import RigDataError, refuse
from rigdata.readers.base import GridReader, rate_of_time
from rigdata.readers.grids import Layout
from rigdata.readers.series import Columns

#: Parsed columns cached by a campaign before the oldest run is let go [bytes].
_CACHE_BYTES = 96 * 2**20
_Value = TypeVar("_Value")


class ReadingCache:
    """Tables and heads of a campaign's files, the last used ones, up to a number of bytes."""

    def __init__(self, limit: int = _CACHE_BYTES) -> None:
        self._limit = limit
        self._entries: OrderedDict[tuple[object, ...], Any] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[ReadingCache], tuple[int]]:
        return ReadingCache, (self._limit,)  # a worker process starts with an empty one

    def get(self, key: tuple[object, ...], make: Callable[[], _Value]) -> _Value:
        """Give the value under `key`, made where it is not cached; the longest unused ones go."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
                cached: _Value = self._entries[key]
                return cached
        value = make()
        with self._lock:
            self._entries[key] = value
            while self.nbytes > self._limit and len(self._entries) > 1:
                self._entries.popitem(last=False)
        return value

    @property
    def nbytes(self) -> int:
        """Memory taken by all columns [bytes]."""
        return sum(int(getattr(value, "nbytes", 0)) for value in self._entries.values())


@dataclass(frozen=True)
class CachedReader(GridReader):
    """One run's file; what files of every kind that is parsed as a whole have in common."""

    path: Path
    file: str
    run: str
    channels: Mapping[str, Channel] = field(repr=False)
    stated_rate: float | None = None
    cache: ReadingCache = field(default_factory=ReadingCache, repr=False, compare=False)

    def _refuse(self, place: str, fault: str, remedy: str) -> RigDataError:
        return refuse(self.file, place, fault, remedy, self.run)

    def _columns(self, names: Sequence[str]) -> Columns:
        """All columns, or `names` at least."""
        raise NotImplementedError

    def _times(self) -> FloatArray | None:
        """Seconds (n,); None where the file has none."""
        raise NotImplementedError

    def names(self) -> tuple[str, ...]:
        """Names of all columns, "" where one has none."""
        return tuple(self._columns(()).values)

    def _signature(self) -> tuple[Path, int, int, str]:
        """A key that changes when the file does, so that the cache never serves an old one."""
        try:
            state = self.path.stat()
        except OSError as error:
            raise self._refuse("", "the file is not there", "Restore it, or delete the run") from error
        if not stat.S_ISREG(state.st_mode):
            raise self._refuse("", "is not an ordinary file", "Name a record in the manifest")
        return self.path, state.st_size, state.st_mtime_ns, self.run

    def _layout(self) -> Layout | None:
        """All channels at their own times; None where all share the rows of the file."""
        return None

    def _grids(self) -> Sequence[Grid]:
        layout = self._layout()
        if layout is not None:
            return layout.grids
        clock = "" if self._times() is None else "times"
        return [Grid(self.length(), clock, self._row_rate(), channels=list(self.names()))]

    def _row_rate(self) -> float:
        """Rate of the rows of the file [Hz]: of its times, else as stated; NaN where there is neither."""
        times = self._times()
        rate = float("nan") if times is None else rate_of_time(times)
        return rate if rate > 0 else self.stated_rate or float("nan")

    def apart(self) -> frozenset[str]:
        """Channels that are not sampled with the run's own device."""
        return frozenset() if self._layout() is None else super().apart()

    def read_device(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of channels of one device, (stop - start,) each."""
        layout = self._layout()
        values = self._columns(names).values if layout is None else layout.values
        return [np.asarray(values[name][start:stop], dtype=float) for name in names]

    def device_time(self, name: str, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,) of a channel's samples."""
        layout = self._layout()
        return self.time(start, stop) if layout is None else layout.time(self._grid(name), start, stop)

    def length(self) -> int:
        """Count the samples per channel of the run's own device."""
        layout = self._layout()
        return self._columns(()).length if layout is None else layout.grids[0].length

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names` along the run's own times, (stop - start,) each."""
        layout = self._layout()
        values = self._columns(names).values if layout is None else layout.values
        faults = {} if layout is None else layout.faults
        apart = frozenset() if layout is None else self.apart()
        readings = []
        for name in names:
            if name in faults:
                raise faults[name]
            if name not in values:
                held = [column.partition(" [")[0] for column in self.names() if column]
                remedy = hint(name, held, "It holds:")[:220]
                raise self._refuse(f"channel {name}", "is missing in the file", remedy)
            if name in apart:
                readings.append(self._along(name, start, stop))
            else:
                readings.append(np.asarray(values[name][start:stop], dtype=float))
        return readings

    def rate(self) -> float:
        """Give the sample rate [Hz]: of the file's times, else the manifest's."""
        layout = self._layout()
        rate = self._row_rate() if layout is None else layout.grids[0].rate
        if not rate > 0:
            fault = "there are neither usable times nor a sample rate"
            remedy = 'Add sample_rate to the run or to [acquisition], or a channel with quantity = "time"'
            raise self._refuse("", fault, remedy)
        return rate

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,): the file's, else counted from the rate."""
        layout = self._layout()
        if layout is not None and layout.grids[0].clock:
            return layout.time(layout.grids[0], start, stop)
        times = self._times() if layout is None else None
        return np.arange(start, stop) / self.rate() if times is None else times[start:stop].copy()
