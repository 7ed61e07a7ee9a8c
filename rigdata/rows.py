"""Consecutive samples of several quantities as X and Y rows: what is read stretch by stretch over a long record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.record import Record, VectorRecord


@dataclass(frozen=True)
class Rows:
    """Consecutive samples of a run."""

    rows: dict[str, FloatArray]  #: quantity -> (2, n), SI
    time: FloatArray | None  #: (n,), s; None where times are counted from the rate
    speed: FloatArray | None  #: (n,), rad/s


class RowReader(Protocol):
    """Gives the samples of some quantities, stretch by stretch."""

    def read(self, start: int, stop: int) -> Rows:
        """Samples start..stop-1."""


class _HasVectors(Protocol):
    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord: ...

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None: ...


class VectorRows:
    """Rows of what gives its vectors one by one: a run held in memory."""

    def __init__(self, run: _HasVectors, quantities: Sequence[str]) -> None:
        self._run, self._quantities = run, quantities

    def read(self, start: int, stop: int) -> Rows:
        """Samples start..stop-1."""
        records = {q: self._run.vector(q, start, stop) for q in self._quantities}
        speed = self._run.speed(start, stop)
        time = next(iter(records.values())).time
        rows = {q: np.ascontiguousarray(record.values.T) for q, record in records.items()}
        return Rows(rows, time, None if speed is None else speed.values)
