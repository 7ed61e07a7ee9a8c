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
    """One spectral line, phasors of exp(+i omega t).

    Attributes
    ----------
    frequency : float
        [rad/s]
    oil_force : (2,) complex
        What the film puts on the housing [N].
    displacement : (2,) complex
        Shaft relative to housing [m].
    cell_force : (2,) complex
        What the housing puts on the cells [N].
    acceleration : (2,) complex
        Of the housing [m/s^2].
    """

    frequency: float
    oil_force: ComplexArray
    displacement: ComplexArray
    cell_force: ComplexArray
    acceleration: ComplexArray

    def phasor(self, quantity: str) -> ComplexArray:
        """Phasor (2,) of a measured quantity.

        Parameters
        ----------
        quantity : str
            ``"displacement"``, ``"force"`` or ``"acceleration"``.
        """
        return self.cell_force if quantity == "force" else getattr(self, quantity)


@dataclass(frozen=True)
class SteadyMotion:
    """A mean state with spectral lines on it.

    Attributes
    ----------
    position, load : (2,) ndarray
        Mean shaft position [m] and mean force on the housing [N].
    lines : tuple of MotionLine
    temperature : (n_pads,) ndarray
        [degC]
    speed : float
        [rad/s]
    surface : (n_orders,) complex
        Runout of the shaft's surface at 1X, 2X, ... [m], phase at time 0.
    """

    position: FloatArray
    load: FloatArray
    lines: tuple[MotionLine, ...]
    temperature: FloatArray
    speed: float
    surface: ComplexArray

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """See `Motion`.

        Parameters
        ----------
        quantity : str
            ``"displacement"``, ``"force"``, ..
        time : (n,) ndarray
            [s]
        """
        mean = {"displacement": self.position, "force": self.load}.get(quantity, np.zeros(2))
        out = np.broadcast_to(mean, (len(time), 2)).copy()
        for line in self.lines:
            phasor = line.phasor(quantity)
            turn = line.frequency * time
            out += np.outer(np.cos(turn), phasor.real) - np.outer(np.sin(turn), phasor.imag)
        return out

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """See `Motion`. A point of the surface passes the probe at `axis` that much later.

        Parameters
        ----------
        axis : float
            Direction of the probe [rad].
        time : (n,) ndarray
            [s]
        """
        out = np.zeros(len(time))
        for order, phasor in enumerate(self.surface, 1):
            out += (phasor * np.exp(1j * order * (self.speed * time - axis))).real
        return out


@dataclass(frozen=True)
class SlowMotion:
    """A quasi-static test, given on a time grid: no accelerations, no rotation.

    Attributes
    ----------
    time : (n,) ndarray
        [s]
    position, load : (n, 2) ndarray
        Shaft position [m] and force on the housing [N].
    temperature : (n_pads,) ndarray
        [degC]
    """

    time: FloatArray
    position: FloatArray
    load: FloatArray
    temperature: FloatArray
    speed: float = 0.0

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """See `Motion`.

        Parameters
        ----------
        quantity : str
            ``"displacement"``, ``"force"``, ..
        time : (n,) ndarray
            [s]
        """
        if quantity == "acceleration":
            return np.zeros((len(time), 2))
        values = self.position if quantity == "displacement" else self.load
        if time is self.time or np.array_equal(time, self.time):
            return values.copy()
        return np.stack([np.interp(time, self.time, column) for column in values.T], axis=1)

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """See `Motion`: the shaft stands still, its runout is part of the gap voltage.

        Parameters
        ----------
        axis : float
            Direction of the probe [rad].
        time : (n,) ndarray
            [s]
        """
        return np.zeros(len(time))


@dataclass(frozen=True)
class RunPhysics:
    """A run as it really was.

    Attributes
    ----------
    time : (n,) ndarray
        Of the samples [s].
    motion : Motion
    facts : mapping
        What a truth file tells of the run: plain numbers, strings and lists.
    """

    time: FloatArray = field(repr=False)
    motion: Motion = field(repr=False)
    facts: Mapping[str, object]
