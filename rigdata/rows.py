"""Samples of several quantities read in one request, calibrated and turned into X and Y rows.

`rigdata.run.Run.vector` gives one quantity at a time, with time stamps for each; over a long record that is most of
the work. Here one request reads all channels, and calibration and axes of two channels are one 2x2 product (20 times
quicker than a product per sample). Where that does not apply (missing values, three probes) `vector` is asked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.record import Record, VectorRecord
from rigdata.vector import COLLINEAR_SINE, inverse_directions

#: Readings of this size are written for an overflow (see `rigdata.calibration.Channel.to_si`).
OVERFLOW = 1e30


@dataclass(frozen=True)
class Rows:
    """Consecutive samples of a run."""

    rows: dict[str, FloatArray]
    time: FloatArray | None
    speed: FloatArray | None


class RowReader(Protocol):
    """Gives the samples of some quantities, stretch by stretch."""

    def read(self, start: int, stop: int) -> Rows:
        """Samples start..stop-1."""


class _HasVectors(Protocol):
    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord: ...

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None: ...


class _FileRun(_HasVectors, Protocol):
    """What a run that is read from its file has besides: `rigdata.run.Run`."""

    @property
    def channels(self) -> Mapping[str, Channel]: ...

    @property
    def reader(self) -> Any: ...


class VectorRows:
    """Rows of what gives its vectors one by one: a run held in memory."""

    def __init__(self, run: _HasVectors, quantities: Sequence[str]) -> None:
        self._run, self._quantities = run, quantities

    def read(self, start: int, stop: int) -> Rows:
        """Samples start..stop-1."""
        records = {q: self._run.vector(q, start, stop) for q in self._quantities}
        speed = self._run.speed(start, stop)
        time = next(iter(records.values())).time
        rows = {q: _turned(record.values) for q, record in records.items()}
        return Rows(rows, time, None if speed is None else speed.values)


@dataclass(frozen=True)
class _Plan:
    """How a quantity's two channels become rows: ``matrix @ readings + shift``."""

    names: tuple[str, ...]
    matrix: FloatArray
    shift: FloatArray


class FileRows:
    """Rows of a run's file, all channels in one request; made by `Run.row_reader`."""

    def __init__(self, run: _FileRun, quantities: Sequence[str]) -> None:
        self._run, self._reader = run, run.reader
        self._plans = {q: _plan(run, q) for q in quantities}
        self._tach = [c for c in run.channels.values() if c.quantity == "speed"][:1]
        counted = getattr(run.reader, "counted", None)
        self._counted = counted is not None and counted()

    def read(self, start: int, stop: int) -> Rows:
        """Samples start..stop-1."""
        planned = [plan for plan in self._plans.values() if plan is not None]
        names = [name for plan in planned for name in plan.names] + [c.name for c in self._tach]
        readings = dict(zip(names, self._reader.read(names, start, stop))) if names else {}
        rows = {}
        for quantity, plan in self._plans.items():
            own = None if plan is None else _rows(plan, readings)
            rows[quantity] = own if own is not None else _turned(self._run.vector(quantity, start, stop).values)
        time = None if self._counted else self._reader.time(start, stop)
        speed = self._tach[0].to_si(readings[self._tach[0].name]) if self._tach else None
        return Rows(rows, time, speed)


def _turned(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values.T)


def _plan(run: _FileRun, quantity: str) -> _Plan | None:
    """Calibration and axes of two channels in one matrix; None where `Run.vector` has more to do, or to refuse."""
    chosen = [c for c in run.channels.values() if c.quantity == quantity and c.axis is not None]
    if len(chosen) != 2:
        return None
    axes = tuple(float(c.axis or 0.0) for c in chosen)
    if abs(np.sin(axes[0] - axes[1])) <= COLLINEAR_SINE:
        return None
    inverse = inverse_directions(axes)
    inverse = np.where(np.abs(inverse) < 1e-12, 0.0, inverse)  # cos 90 deg is not quite zero, but a pass over the data
    matrix = inverse * np.array([c.slope for c in chosen])
    return _Plan(tuple(c.name for c in chosen), matrix, inverse @ np.array([c.zero for c in chosen]))


def _rows(plan: _Plan, readings: dict[str, FloatArray]) -> FloatArray | None:
    """X and Y, None where a reading is missing or an overflow."""
    first, second = (readings[name] for name in plan.names)
    for values in (first, second):
        # a NaN makes both comparisons false
        if len(values) and not (values.max() < OVERFLOW and values.min() > -OVERFLOW):
            return None
    rows = np.empty((2, len(first)))
    for i in range(2):
        own, other = (first, second) if plan.matrix[i, 0] != 0.0 else (second, first)
        mine = plan.matrix[i] if plan.matrix[i, 0] != 0.0 else plan.matrix[i, ::-1]
        np.multiply(own, mine[0], out=rows[i])
        if mine[1] != 0.0:
            rows[i] += other * mine[1]
        if plan.shift[i] != 0.0:
            rows[i] += plan.shift[i]
    return rows
