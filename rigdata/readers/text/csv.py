"""Runs in CSV files: detected dialect, columns parsed once and kept as long as memory allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.manifest.manifest import CsvSpec
from rigdata.problem import Problem, RigDataError
from rigdata.readers.base import missing_channel, rate_of_time, suffix_hint, undescribed
from rigdata.readers.table_cache import TableCache
from rigdata.readers.text.csv_table import Source, Table, read_table
from rigdata.readers.text.dialect import Dialect, DialectFinder

#: A file above this size is parsed column by column, not all channels at once [bytes].
_LARGE_FILE = 2**29


@dataclass(frozen=True)
class CsvReader:
    """One run's CSV file."""

    path: Path
    file: str
    run: str
    spec: CsvSpec
    channels: Mapping[str, Channel] = field(repr=False)
    stated_rate: float | None = None
    cache: TableCache = field(default_factory=TableCache, repr=False, compare=False)

    def _error(self, place: str, what: str, cure: str) -> RigDataError:
        return RigDataError(Problem("error", self.file, place, what, cure, self.run))

    def _signature(self) -> tuple[object, ...]:
        """Make a key that changes when the file does, so that the cache never serves an old one."""
        try:
            state = self.path.stat()
        except OSError as error:
            raise self._error("", "the file is not there", "Restore it, or delete the run") from error
        if not self.path.is_file():
            raise self._error("", "is not an ordinary file", "Name a CSV file in the manifest")
        return (self.path, state.st_size, state.st_mtime_ns)

    def dialect(self) -> Dialect:
        """Detect the dialect of the file."""
        finder = DialectFinder(self.path, self.file, self.run, self.spec, self.channels)
        try:
            return self.cache.dialect(self._signature(), finder.find)
        except RigDataError as error:
            hint = suffix_hint(self.path)
            if not hint:
                raise
            raise RigDataError([replace(p, cure=hint) for p in error.problems]) from error
        except OSError as error:
            raise self._error("", f"cannot be read ({error.strerror})", "Check the rights of the file") from error

    def names(self) -> tuple[str, ...]:
        """Names of all columns, "" where one has none."""
        return self.dialect().names

    def _table(self, names: Sequence[str]) -> Table:
        signature = self._signature()
        large = isinstance(signature[1], int) and signature[1] > _LARGE_FILE
        key = (*signature, *names) if large else signature
        table = self.cache.get(key)
        if table is None:
            dialect, clock = self.dialect(), self._clock_name()
            used = {n for n, c in self.channels.items() if c.quantity != "ignore"}
            wanted = [n for n in dialect.names if n in used]
            if not wanted:
                raise self._error("", "holds none of the channels that are used", "Check the channels' names")
            if large:  # one column, for the number of samples, and those that are asked for
                first = clock if clock in wanted else wanted[0]
                wanted = [n for n in wanted if n == first or n in names]
            try:
                table = read_table(Source(self.path, self.file, self.run, dialect, clock), wanted)
            except OSError as error:
                raise self._error("", f"cannot be read ({error})", "Check the file and its rights") from error
            self.cache.put(key, table)
        return table

    def length(self) -> int:
        """Count the samples in the file."""
        return self._table(()).length

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`."""
        table = self._table(names)
        for name in names:
            if name not in table.columns:
                raise self._error(*missing_channel(name, (n for n in self.names() if n), "The columns are"))
        return [table.columns[n][start:stop] for n in names]

    def _clock_name(self) -> str:
        return next((c.name for c in self.channels.values() if c.quantity == "time"), "")

    def _clock(self) -> Channel | None:
        clock = next((c for c in self.channels.values() if c.quantity == "time"), None)
        if clock is None or clock.name in self._table((clock.name,)).columns:
            return clock
        return None if self.stated_rate is not None else clock

    def rate(self) -> float:
        """Give the sample rate [Hz]: of the time column, else the manifest's."""
        clock = self._clock()
        if clock is not None:
            rate = rate_of_time(self._times(clock))
            if rate > 0:
                return rate
        if self.stated_rate is None:
            cure = 'Add [acquisition] sample_rate, or a channel with quantity = "time"'
            raise self._error("", "there is neither a usable time column nor a sample rate", cure)
        return self.stated_rate

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds: the time column as it is, missing ones filled in between; else counted from the rate."""
        clock = self._clock()
        return np.arange(start, stop) / self.rate() if clock is None else self._times(clock)[start:stop].copy()

    def _times(self, clock: Channel) -> FloatArray:
        key = (*self._signature(), "seconds")
        table = self.cache.get(key)
        if table is None:
            (raw,) = self.read([clock.name], 0, self.length())
            table = Table({"": self._usable_time(clock, clock.to_si(raw))}, len(raw))
            self.cache.put(key, table)
        return table.columns[""]

    def _usable_time(self, clock: Channel, time: FloatArray) -> FloatArray:
        known = np.flatnonzero(np.isfinite(time))
        if len(known) < min(2, len(time)):
            raise self._error(f"column {clock.name}", "holds no times", "Set its quantity to ignore")
        if len(known) < len(time):
            time = np.interp(np.arange(len(time)), known, time[known])
        back = np.flatnonzero(np.diff(time) < 0)
        if len(back):
            line = self.dialect().data_line + int(back[0]) + 1
            what = f"time runs backwards ({time[back[0]]:g} s, then {time[back[0] + 1]:g} s)"
            raise self._error(f"line {line}, column {clock.name}", what, "Sort or split the run")
        return time

    def problems(self) -> tuple[Problem, ...]:
        """Tell what was mended while parsing, and which columns nobody describes."""
        extra = [n for n in self.names() if n and n not in self.channels]
        return (*self._table(()).problems, *undescribed(extra, "columns", self.file, self.run))
