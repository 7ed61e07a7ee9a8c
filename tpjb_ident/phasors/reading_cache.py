"""The beginning of a run's record, read once for all who look at it: phasors, channels, checks, temperatures.

Stands in the place of the run's reader. What is asked for beyond the beginning is read from the file as before, so
that a short record is read once as a whole, and no sample of a long one twice by those who look at its beginning.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import RigDataError
from rigdata.run import Run

#: What the checks look at: so many samples, or so many seconds if that is more, of those that are kept.
_LOOK, SECONDS = 2**14, 2.0
#: Samples per channel up to which a run is kept, and that are looked at of a longer one.
SHORT = 2**17


class _ReadingCache:
    """A run's reader that keeps the first samples of all channels."""

    def __init__(self, reader: Any, channels: Sequence[str], samples: int = SHORT) -> None:
        self._reader, self._channels = reader, channels
        self.samples = min(samples, reader.length())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`, (stop - start,) each; not to be written to."""
        if stop <= self.samples and all(name in self._beginning for name in names):
            return [self._beginning[name][start:stop] for name in names]
        return list(self._reader.read(names, start, stop))

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds of samples start..stop-1."""
        return np.array(self._times[start:stop] if stop <= self.samples else self._reader.time(start, stop))

    @cached_property
    def _times(self) -> FloatArray:
        return np.asarray(self._reader.time(0, self.samples))

    @cached_property
    def _beginning(self) -> dict[str, FloatArray]:
        try:
            values = self._reader.read(self._channels, 0, self.samples)
        except RigDataError:  # told by whoever needs the channel that cannot be read
            return {}
        for readings in values:
            readings.flags.writeable = False
        return dict(zip(self._channels, values))


class _Beginning:
    """A run's reader that ends after the first samples."""

    def __init__(self, reader: Any, samples: int) -> None:
        self._reader, self._length = reader, min(samples, getattr(reader, "samples", reader.length()))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def length(self) -> int:
        """Samples per channel."""
        return self._length


def with_kept_beginning(run: Run) -> Run:
    """The run with its beginning kept."""
    if isinstance(run.reader, _ReadingCache | _Beginning):
        return run
    apart = run.reader.apart()
    names = [name for name, c in run.channels.items() if c.quantity != "time" and name not in apart]
    reader: Any = _ReadingCache(run.reader, names)
    return replace(run, reader=reader)


def beginning_of(run: Run, samples: int | None = None) -> Run:
    """The first samples of a run whose readings are kept, as a run of its own; by default what the checks look at."""
    looked_at = max(_LOOK, round(SECONDS * run.sample_rate))
    beginning: Any = _Beginning(run.reader, samples or looked_at)
    return replace(run, reader=beginning)
