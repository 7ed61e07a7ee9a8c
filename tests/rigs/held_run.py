"""A run whose samples are in memory, as long as a test wants it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

import numpy as np

from rigdata.operating_point import OperatingPoint
from rigdata.record import Record, RowReader, VectorRecord, VectorRows

RATE, SECONDS = 10_000.0, 60.0
POINT = OperatingPoint(5000.0, -np.pi / 2, 2 * np.pi * 22, 2 * np.pi * 25)


@dataclass
class HeldRun:
    """A run whose samples are in memory; the face of `rigdata.campaign.Run`."""

    id: str
    seed: int
    sample_rate: float = RATE
    seconds: float = SECONDS
    point: OperatingPoint = POINT
    excitation_direction: float = 0.0
    channels: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.length = round(self.seconds * self.sample_rate)
        self.time = np.arange(self.length) / self.sample_rate
        wave = {f: np.exp(2j * np.pi * f * self.time) for f in (25.0, 22.0, 44.0, 50.0)}
        self.data = {}
        for quantity, scale in (("displacement", 1e-6), ("force", 100.0), ("acceleration", 0.02)):
            z = rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))
            lines = sum(np.outer(w, z[i]).real for i, w in enumerate(wave.values()))
            self.data[quantity] = scale * (lines + 0.05 * rng.standard_normal((self.length, 2)))
        self.channels = {q: _Channel(q) for q in self.data}

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        part = slice(start, stop)
        return VectorRecord(quantity, self.data[quantity][part], self.time[part], self.sample_rate, ("A", "B"))

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        return VectorRows(self, quantities)

    def opened(self) -> AbstractContextManager[None]:
        return nullcontext()

    def speed(self, start: int | None = None, stop: int | None = None) -> Record:
        part = self.time[start:stop]
        return Record("K1", "speed", np.full(len(part), 2 * np.pi * 22.0), part, self.sample_rate)


@dataclass
class _Channel:
    quantity: str
    axis: float | None = None
