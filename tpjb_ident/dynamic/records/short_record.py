"""A run, or the beginning of one, short enough to be kept while it is fitted: several looks at it, one reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.record import Record, VectorRecord
from rigdata.rows import RowReader, VectorRows
from tpjb_ident.dynamic.records.measured_run import MeasuredRun

#: Samples per channel up to which a run is kept, and that are looked at of a longer one.
SHORT = 2**17


class ShortRecord:
    """Stands for a run, or for its beginning; reads every vector and the speed once.

    Parameters
    ----------
    run : MeasuredRun
    length : int, optional
        Samples from the start that it stands for; default all.
    """

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
        """As the run's own.

        Parameters
        ----------
        quantity : str
        start, stop : int, optional
            Samples, as in a Python slice; default all.
        """
        if quantity not in self._kept:
            self._kept[quantity] = self._run.vector(quantity, 0, self.length)
        kept = self._kept[quantity]
        return replace(kept, values=kept.values[start:stop], time=kept.time[start:stop])

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None:
        """As the run's own.

        Parameters
        ----------
        start, stop : int, optional
            Samples, as in a Python slice; default all.
        """
        if self._speed is None:
            self._speed = (self._run.speed(0, self.length),)
        (kept,) = self._speed
        return None if kept is None else replace(kept, values=kept.values[start:stop], time=kept.time[start:stop])

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        """Rows of what is kept.

        Parameters
        ----------
        quantities : sequence of str
        """
        return VectorRows(self, quantities)

    def kept_open(self) -> AbstractContextManager[None]:
        """As the run's own."""
        return self._run.kept_open()
