"""A run, or the beginning of one, short enough to be kept while it is fitted: several looks at it, one reading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

#: Samples per channel up to which a run is kept, and that are looked at of a longer one.
SHORT = 2**17


class ShortRecord:
    """Stands for a `rigdata.campaign.Run`, or for its beginning; reads every vector and the speed once.

    Parameters
    ----------
    run : rigdata.campaign.Run
    length : int, optional
        Samples from the start that it stands for; default all.
    """

    def __init__(self, run: Any, length: int | None = None) -> None:
        self._run = run
        self.length = run.length if length is None else min(length, run.length)
        self._kept: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._run, name)

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> Any:
        """As the run's own."""
        if quantity not in self._kept:
            self._kept[quantity] = self._run.vector(quantity, 0, self.length)
        return _part(self._kept[quantity], start, stop)

    def speed(self, start: int | None = None, stop: int | None = None) -> Any:
        """As the run's own."""
        if "speed" not in self._kept:
            self._kept["speed"] = self._run.speed(0, self.length)
        record = self._kept["speed"]
        return None if record is None else _part(record, start, stop)


def _part(record: Any, start: int | None, stop: int | None) -> Any:
    return replace(record, values=record.values[start:stop], time=record.time[start:stop])
