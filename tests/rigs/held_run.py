"""A run whose samples are in memory, as long as a test wants it."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

import numpy as np

from rigdata.calibration import Channel
from rigdata.device import Device
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem
from rigdata.run import Run

RATE, SECONDS = 10_000.0, 60.0
POINT = OperatingPoint(5000.0, -np.pi / 2, 2 * np.pi * 22, 2 * np.pi * 25)
#: Channels of a run along X and Y.
NAMES = {q: (f"{q[0].upper()}X", f"{q[0].upper()}Y") for q in ("displacement", "force", "acceleration")}


@dataclass
class HeldReader:
    """Columns in memory, SI; counts the samples that are asked for."""

    data: Mapping[str, np.ndarray]
    sample_rate: float = RATE
    stamps: np.ndarray | None = None
    file: str = "memory"
    asked: list = field(default_factory=list)

    def length(self) -> int:
        return len(next(iter(self.data.values())))

    def rate(self) -> float:
        return self.sample_rate

    def read(self, names: Sequence[str], start: int, stop: int) -> list[np.ndarray]:
        self.asked.append((tuple(names), start, stop))
        return [self.data[name][start:stop] for name in names]

    def time(self, start: int, stop: int) -> np.ndarray:
        return self.stamps[start:stop] if self.stamps is not None else np.arange(start, stop) / self.sample_rate

    def devices(self) -> tuple[Device, ...]:
        return (Device("", tuple(self.data), self.sample_rate, self.length(), self.stamps is None),)

    def apart(self) -> frozenset[str]:
        return frozenset()

    def opened(self) -> AbstractContextManager[None]:
        return nullcontext()

    def problems(self) -> tuple[Problem, ...]:
        return ()


def columns(data: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of X and Y by channel, from (n, 2) by quantity."""
    return {name: values[:, k] for q, values in data.items() for k, name in enumerate(NAMES[q])}


def channels(quantities: Sequence[str], speed: bool = False) -> dict[str, Channel]:
    """Channels along X and Y of some quantities, SI, and a tachometer where asked for."""
    found = {n: Channel(n, q, axis=k * np.pi / 2) for q in quantities for k, n in enumerate(NAMES[q])}
    return found | ({"K1": Channel("K1", "speed")} if speed else {})


def run_of(reader: HeldReader, described: Mapping[str, Channel], point: OperatingPoint = POINT, name: str = "a") -> Run:
    """A dynamic run of such a reader."""
    stated = {"excitation_direction": 0.0, "pad": None, "branch": "up", "stated": frozenset(), "housing_mass": 30.0}
    return Run(id=name, kind="dynamic", point=point, channels=described, reader=reader, **stated)


def lines_in_noise(seed: int, rate: float = RATE, seconds: float = SECONDS) -> dict[str, np.ndarray]:
    """Excitation at 25 Hz, 1X, 2X and mains of random phasors in all quantities, (n, 2) each."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    wave = {f: np.exp(2j * np.pi * f * time) for f in (25.0, 22.0, 44.0, 50.0)}
    data = {}
    for quantity, scale in (("displacement", 1e-6), ("force", 100.0), ("acceleration", 0.02)):
        z = rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))
        lines = sum(np.outer(w, z[i]).real for i, w in enumerate(wave.values()))
        data[quantity] = scale * (lines + 0.05 * rng.standard_normal((len(time), 2)))
    return data


def held_run(seed: int, rate: float = RATE, seconds: float = SECONDS, point: OperatingPoint = POINT) -> Run:
    """A run of such lines."""
    data = lines_in_noise(seed, rate, seconds)
    return run_of(HeldReader(columns(data), rate), channels(list(data)), point)
