"""What the extraction of phasors needs to know of a run: `rigdata.run.Run`, its beginning, or one held in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Protocol

from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.record import Record, VectorRecord
from rigdata.rows import RowReader


class MeasuredRun(Protocol):
    """A dynamic run whose samples can be asked for; the members are those of `rigdata.run.Run`."""

    @property
    def id(self) -> str:
        """Name of the run."""

    @property
    def point(self) -> OperatingPoint:
        """Set points, SI."""

    @property
    def excitation_direction(self) -> float | None:
        """Direction of the excitation [rad]; None where not stated."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Channels with a quantity, by name."""

    @property
    def length(self) -> int:
        """Samples per channel."""

    @property
    def sample_rate(self) -> float:
        """Nominal sample rate [Hz]."""

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        """X and Y of a quantity, SI.

        Parameters
        ----------
        quantity : str
            ``"displacement"``, ``"force"`` or ``"acceleration"``.
        start : int or None, optional
            First sample.
        stop : int or None, optional
            Sample after the last.
        """

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None:
        """Shaft speed by the tachometer [rad/s]; None where there is none.

        Parameters
        ----------
        start : int or None, optional
            First sample; default the first of all.
        stop : int or None, optional
            Sample after the last; default the end.
        """

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        """Reader of several quantities at once.

        Parameters
        ----------
        quantities : sequence of str
            With X and Y.
        """

    def kept_open(self) -> AbstractContextManager[None]:
        """Keep the file open while the block runs."""
