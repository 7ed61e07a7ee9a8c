"""A run short enough to be kept while it is fitted: several looks at it, one reading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

#: Samples per channel up to which a run is kept.
SHORT = 2**17


class ShortRecord:
    """Stands for a `rigdata.campaign.Run`; reads every vector and the speed once.

    Parameters
    ----------
    run : rigdata.campaign.Run
    """

    def __init__(self, run: Any) -> None:
        self._run = run
        self._kept: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._run, name)

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> Any:
        """As the run's own."""
        if quantity not in self._kept:
            self._kept[quantity] = self._run.vector(quantity)
        return _part(self._kept[quantity], start, stop)

    def speed(self, start: int | None = None, stop: int | None = None) -> Any:
        """As the run's own."""
        if "speed" not in self._kept:
            self._kept["speed"] = self._run.speed()
        record = self._kept["speed"]
        return None if record is None else _part(record, start, stop)


def _part(record: Any, start: int | None, stop: int | None) -> Any:
    return replace(record, values=record.values[start:stop], time=record.time[start:stop])


def kept_if_short(run: Any) -> Any:
    """The run, read once if it is short, else as it is."""
    return ShortRecord(run) if run.length <= SHORT else run
