"""Files that are parsed as a whole: their columns, the last used of a campaign, as many as memory allows."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.near_names import hint
from rigdata.problem import RigDataError, refuse
from rigdata.readers.base import rate_of_time
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
class CachedReader:
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

    def _signature(self) -> tuple[Path, int, int]:
        """A key that changes when the file does, so that the cache never serves an old one."""
        try:
            state = self.path.stat()
        except OSError as error:
            raise self._refuse("", "the file is not there", "Restore it, or delete the run") from error
        if not self.path.is_file():
            raise self._refuse("", "is not an ordinary file", "Name a record in the manifest")
        return self.path, state.st_size, state.st_mtime_ns

    def length(self) -> int:
        """Count the samples per channel."""
        return self._columns(()).length

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`, (stop - start,) each."""
        columns = self._columns(names)
        for name in names:
            if name not in columns.values:
                held = [column for column in self.names() if column]
                remedy = hint(name, held, "It holds:")[:220]
                raise self._refuse(f"channel {name}", "is missing in the file", remedy)
        return [np.asarray(columns.values[name][start:stop], dtype=float) for name in names]

    def rate(self) -> float:
        """Give the sample rate [Hz]: of the file's times, else the manifest's."""
        times = self._times()
        rate = float("nan") if times is None else rate_of_time(times)
        if rate > 0:
            return rate
        if self.stated_rate is None:
            fault = "there are neither usable times nor a sample rate"
            remedy = 'Add sample_rate to the run or to [acquisition], or a channel with quantity = "time"'
            raise self._refuse("", fault, remedy)
        return self.stated_rate

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,): the file's, else counted from the rate."""
        times = self._times()
        return np.arange(start, stop) / self.rate() if times is None else times[start:stop].copy()
