"""Memory: static points that a model has been solved for, so that none is solved twice.

A diagnosis asks for the same equilibrium again and again: a sensor's error changes no equilibrium, and neither does
most of what is tried at another frequency. Campaigns of one bearing begin with the very same questions, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from model.instruments import Instruments
from model.predict import Prediction, predict_setup
from model.setup import Setup
from model.statics.equilibrium import Equilibrium
from tpjb_ident.errors import TpjbError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
StaticPoint = tuple[float, float, float]
Key = tuple[Setup, StaticPoint, tuple[float, ...]]
_PLAIN = Instruments()


class NoEquilibriumError(TpjbError):
    """The model found no equilibrium at an operating point of the campaign."""


@dataclass(frozen=True)
class Solved:
    """What a bearing does at one static point, before any instrument reads it.

    Attributes
    ----------
    h : (n, 2, 2) complex ndarray
        [N/m]
    position : (2,) ndarray
        [m]
    force : (2,) ndarray
        Static load [N].
    temperature, pad_load : (n_pads,) ndarray
        [degC], [N]
    """

    h: ComplexArray
    position: FloatArray
    force: FloatArray
    temperature: FloatArray
    pad_load: FloatArray

    def read(self, setup: Setup, lines: tuple[float, ...]) -> Reading:
        """As the instruments of a set-up show it."""
        instruments = setup.instruments
        return Reading(
            instruments.shown_stiffness(self.h, np.array(lines)),
            instruments.shown_position(self.position + setup.structure @ self.force),
            instruments.shown_load(self.force), self.temperature, self.pad_load,
        )  # fmt: skip


@dataclass(frozen=True)
class Reading:
    """What the records of a static point would show; arrays as of `Solved`."""

    h: ComplexArray
    position: FloatArray
    load: FloatArray
    temperature: FloatArray
    pad_load: FloatArray


@dataclass
class Memory:
    """Solved points of one bearing, and the equilibria from which others start.

    Attributes
    ----------
    solved : dict
        By set-up (instruments apart), static point and lines.
    start : dict
        Equilibrium per static point.
    """

    solved: dict[Key, Solved] = field(default_factory=dict, repr=False)
    start: dict[StaticPoint, Equilibrium] = field(default_factory=dict, repr=False)

    def copy(self) -> Memory:
        """Return a memory of its own that begins with the same knowledge."""
        return Memory(dict(self.solved), dict(self.start))

    def ask(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensor: float) -> Reading:
        """Look a point up, or solve it.

        Parameters
        ----------
        setup : Setup
        point : (load [N], direction [rad], speed [rad/s])
        lines : tuple of float
            [rad/s]
        sensor : float
            Fraction of the arc at which pads carry thermometers.

        Raises
        ------
        NoEquilibriumError
        """
        key = (setup.change(instruments=_PLAIN), point, (*lines, sensor))
        known = self.solved.get(key)
        if known is None:
            known = self.solved[key] = _kept(self._solve(key[0], point, lines), sensor)
        return known.read(setup, lines)

    def _solve(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...]) -> Prediction:
        prediction = predict_setup(setup, *point, np.array(lines), self.start.get(point))
        if not prediction.converged:
            raise NoEquilibriumError(f"no equilibrium at {point[0]:.0f} N ({', '.join(prediction.status)})")
        self.start[point] = prediction.equilibrium
        return prediction


def _kept(found: Prediction, sensor: float) -> Solved:
    force = found.load * np.array([np.cos(found.load_direction), np.sin(found.load_direction)])
    return Solved(
        found.bearing_h, found.bearing_position, force, found.pad_temperature(sensor), found.pad_load
    )  # fmt: skip
