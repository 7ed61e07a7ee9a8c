"""Runs in CSV files: the head is detected, columns are parsed once and cached as long as memory allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import suffix_hint, undescribed
from rigdata.readers.cached_reader import CachedReader
from rigdata.readers.series import Columns
from rigdata.readers.text.csv_table import Source, read_table
from rigdata.readers.text.head import Head, find_head

#: A file above this size is parsed column by column, not all channels at once [bytes].
_LARGE_FILE = 2**29


@dataclass(frozen=True)
class CsvReader(CachedReader):
    """One run's CSV file."""

    spec: CsvSpec = field(default_factory=CsvSpec)

    def _head(self) -> Head:
        try:
            return self.cache.get(
                (*self._signature(), "head"),
                lambda: find_head(self.path, self.file, self.run, self.spec, self.channels),
            )
        except RigDataError as error:
            hint = suffix_hint(self.path)
            if not hint:
                raise
            raise RigDataError([replace(p, cure=hint) for p in error.problems]) from error
        except (OSError, UnicodeError) as error:
            fault = f"cannot be read ({getattr(error, 'strerror', error)})"
            raise self._refuse("", fault, "Check the file and its rights") from error

    def names(self) -> tuple[str, ...]:
        """Names of all columns, "" where one has none."""
        return self._head().names

    def _columns(self, names: Sequence[str]) -> Columns:
        signature = self._signature()
        is_large = signature[1] > _LARGE_FILE
        key = (*signature, *names) if is_large else signature
        return self.cache.get(key, lambda: self._parsed(names if is_large else None))

    def _parsed(self, names: Sequence[str] | None) -> Columns:
        """All channels that are used; of a large file one, for the number of samples, and `names`."""
        head, clock = self._head(), self._clock()
        clock_name = "" if clock is None else clock.name
        used = {name for name, channel in self.channels.items() if channel.quantity != "ignore"}
        wanted = [name for name in head.names if name in used]
        if not wanted:
            fault = "holds none of the channels that are used"
            raise self._refuse("", fault, "Check the channels' names")
        if names is not None:
            first = clock_name if clock_name in wanted else wanted[0]
            wanted = [name for name in wanted if name == first or name in names]
        try:
            return read_table(Source(self.path, self.file, self.run, head, clock_name), wanted)
        except OSError as error:
            fault = f"cannot be read ({error})"
            raise self._refuse("", fault, "Check the file and its rights") from error

    def _clock(self) -> Channel | None:
        return next((c for c in self.channels.values() if c.quantity == "time"), None)

    def _times(self) -> FloatArray | None:
        clock = self._clock()
        if clock is None:
            return None
        if self.stated_rate is not None and clock.name not in self._columns((clock.name,)).values:
            return None
        return self.cache.get((*self._signature(), "seconds"), lambda: self._usable_times(clock))

    def _usable_times(self, clock: Channel) -> FloatArray:
        """The time column, missing times filled in between."""
        (raw,) = self.read([clock.name], 0, self.length())
        times = clock.to_si(raw)
        place = f"column {clock.name}"
        usable = np.flatnonzero(np.isfinite(times))
        if len(usable) < min(2, len(times)):
            raise self._refuse(place, "holds no times", "Set its quantity to ignore")
        if len(usable) < len(times):
            times = np.interp(np.arange(len(times)), usable, times[usable])
        back = np.flatnonzero(np.diff(times) < 0)
        if len(back):
            before, after = times[back[0]], times[back[0] + 1]
            place = f"line {self._head().data_line + int(back[0]) + 1}, {place}"
            fault = f"time runs backwards ({before:g} s, then {after:g} s)"
            raise self._refuse(place, fault, "Sort or split the run")
        return times

    def problems(self) -> tuple[Problem, ...]:
        """What was repaired while parsing, and which columns nobody describes."""
        extra = [name for name in self.names() if name and name not in self.channels]
        return (*self._columns(()).problems, *undescribed(extra, "columns", self.file, self.run))
