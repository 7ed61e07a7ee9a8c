"""The beginning of a run's record, read once for all who look at it: phasors, channels, checks, temperatures.

Stands in the place of the run's reader. What is asked for beyond the beginning is read from the file as before, so
that a short record is read once as a whole, and no sample of a long one twice by those who look at its beginning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from rigdata.record import Record, RowReader, VectorRecord, VectorRows
from rigdata.run import Run
from tpjb_ident.dynamic.records.run_data import MeasuredRun

#: What the checks look at: so many samples, or so many seconds if that is more, of those that are kept.
_LOOK, SECONDS = 2**14, 2.0
#: Samples per channel up to which a run is kept, and that are looked at of a longer one.
SHORT = 2**17


class ShortRecord:
    """Stands for a run, or for its beginning; reads every vector and the speed once."""

    def __init__(self, run: MeasuredRun, length: int | None = None) -> None:
        self._run = run
        self.id: str = run.id
        self.point: OperatingPoint = run.point
        self.excitation_direction: float | None = run.excitation_direction
        self.channels: Mapping[str, Channel] = run.channels
        self.sample_rate: float = run.sample_rate
        self.length = run.length if length is None else min(length, run.length)
        self._kept: dict[str, VectorRecord] = {}
        self._speed: tuple[Record | None] | None = None

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        """As the run's own."""
        if quantity not in self._kept:
            self._kept[quantity] = self._run.vector(quantity, 0, self.length)
        samples = self._kept[quantity]
        return replace(samples, values=samples.values[start:stop], time=samples.time[start:stop])

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None:
        """As the run's own."""
        if self._speed is None:
            self._speed = (self._run.speed(0, self.length),)
        (record,) = self._speed
        return (
            None if record is None else replace(record, values=record.values[start:stop], time=record.time[start:stop])
        )

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        """Rows of what is kept."""
        return VectorRows(self, quantities)

    def opened(self) -> AbstractContextManager[None]:
        """As the run's own."""
        return self._run.opened()


class _ReadingCache:
    """A run's reader that keeps the first samples of all channels."""

    def __init__(self, reader: Any, channels: Sequence[str], samples: int = SHORT) -> None:
        self._reader, self._channels = reader, tuple(channels)
        self.samples = min(samples, reader.length())
        self._kept: dict[str, FloatArray] | None = None
        self._time: FloatArray | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`, (stop - start,) each; not to be written to."""
        beginning = self._beginning() if stop <= self.samples else {}
        if all(name in beginning for name in names):
            return [beginning[name][start:stop] for name in names]
        return list(self._reader.read(names, start, stop))

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds of samples start..stop-1."""
        if stop > self.samples:
            return np.asarray(self._reader.time(start, stop))
        if self._time is None:
            self._time = np.asarray(self._reader.time(0, self.samples))
        return self._time[start:stop].copy()

    def _beginning(self) -> dict[str, FloatArray]:
        if self._kept is None:
            try:
                values = self._reader.read(self._channels, 0, self.samples)
            except RigDataError:  # told by whoever needs the channel that cannot be read
                self._kept = {}
            else:
                self._kept = dict(zip(self._channels, values))
                for one in values:
                    one.flags.writeable = False
        return self._kept


class _Beginning:
    """A run's reader that ends after the first samples."""

    def __init__(self, reader: _ReadingCache, samples: int) -> None:
        self._reader, self._length = reader, min(samples, reader.samples)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def length(self) -> int:
        """Samples per channel."""
        return self._length


def with_kept_beginning(run: Run) -> Run:
    """The run with its beginning kept; runs that are not read from a file stay as they are."""
    if not isinstance(run, Run):
        return run
    names = [name for name, channel in run.channels.items() if channel.quantity != "time"]
    return replace(run, reader=_ReadingCache(run.reader, names))


def beginning_of(run: Run) -> Run | None:
    """The first seconds of a run whose readings are kept, as a run of its own; None where they are not."""
    reader = getattr(run, "reader", None)
    if not isinstance(reader, _ReadingCache):
        return None
    return replace(run, reader=_Beginning(reader, max(_LOOK, round(SECONDS * run.sample_rate))))
