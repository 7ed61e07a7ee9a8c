"""What shaft and housing do in one run, as functions of time: what ideal sensors would see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray


class Motion(Protocol):
    """A run's physics, to be sampled at any time."""

    @property
    def temperature(self) -> FloatArray:
        """Film temperatures (n_pads,) [degC]."""

    @property
    def speed(self) -> float:
        """Shaft speed [rad/s]."""

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """X and Y of "displacement" [m], "force" [N] or "acceleration" [m/s^2] at `time` (n,) -> (n, 2).

        Parameters
        ----------
        quantity : str
            ``"displacement"`` [m], ``"force"`` [N] or ``"acceleration"`` [m/s^2].
        time : (n,) ndarray
            [s]
        """

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """Surface runout (n,) [m] that a probe at `axis` [rad] sees.

        Parameters
        ----------
        axis : float
            Direction [rad].
        time : (n,) ndarray
            [s]
        """


@dataclass(frozen=True)
class MotionLine:
    """One spectral line, phasors of exp(+i omega t)."""

    frequency: float
    oil_force: ComplexArray
    displacement: ComplexArray
    cell_force: ComplexArray
    acceleration: ComplexArray

    def phasor(self, quantity: str) -> ComplexArray:
        """Phasor (2,) of a measured quantity."""
        return self.cell_force if quantity == "force" else getattr(self, quantity)


@dataclass(frozen=True)
class SteadyMotion:
    """A mean state with spectral lines on it."""

    position: FloatArray
    load: FloatArray
    lines: tuple[MotionLine, ...]
    temperature: FloatArray
    speed: float
    surface: ComplexArray

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """See `Motion`."""
        mean = {"displacement": self.position, "force": self.load}.get(quantity, np.zeros(2))
        out = np.broadcast_to(mean, (len(time), 2)).copy()
        for line in self.lines:
            phasor = line.phasor(quantity)
            turn = line.frequency * time
            out += np.outer(np.cos(turn), phasor.real) - np.outer(np.sin(turn), phasor.imag)
        return out

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """See `Motion`. A point of the surface passes the probe at `axis` that much later."""
        out = np.zeros(len(time))
        for order, phasor in enumerate(self.surface, 1):
            out += (phasor * np.exp(1j * order * (self.speed * time - axis))).real
        return out


@dataclass(frozen=True)
class SlowMotion:
    """A quasi-static test, given on a time grid: no accelerations, no rotation."""

    time: FloatArray
    position: FloatArray
    load: FloatArray
    temperature: FloatArray
    speed: float = 0.0

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """See `Motion`."""
        if quantity == "acceleration":
            return np.zeros((len(time), 2))
        values = self.position if quantity == "displacement" else self.load
        if time is self.time or np.array_equal(time, self.time):
            return values.copy()
        return np.stack([np.interp(time, self.time, column) for column in values.T], axis=1)

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """See `Motion`: the shaft stands still, its runout is part of the gap voltage."""
        return np.zeros(len(time))


@dataclass(frozen=True)
class RunPhysics:
    """A run as it really was."""

    time: FloatArray = field(repr=False)
    motion: Motion = field(repr=False)
    facts: Mapping[str, object]
