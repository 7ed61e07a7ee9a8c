"""Memory: static points that a model has been solved for, so that none is solved twice.

A diagnosis asks for the same equilibrium again and again: a sensor's error changes no equilibrium, and neither does
most of what is tried at another frequency. Campaigns of one bearing begin with the very same questions, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from model.dynamics.reduction import with_structure
from model.instruments import Instruments
from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Setup
from model.statics.equilibrium import Equilibrium
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.errors import TpjbError

StaticPoint = tuple[float, float, float]
Key = tuple[Setup, StaticPoint, tuple[float, ...]]
_PLAIN: dict[str, Any] = {
    "instruments": Instruments(), "series_compliance": (0.0, 0.0, 0.0), "added_mass": 0.0,
    "parallel_stiffness": (0.0,) * 4, "parallel_damping": (0.0,) * 4,
}  # fmt: skip


class NoEquilibriumError(TpjbError):
    """The model found no equilibrium at an operating point of the campaign."""


@dataclass(frozen=True)
class Solved:
    """What a bearing alone does at one static point, before structure and instruments.

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
        """As the structure and the instruments of a set-up show it.

        Parameters
        ----------
        setup : Setup
            Bearing, oil, pivots, structure and instruments of the model.
        lines : tuple of float
            Excitation frequencies [rad/s].
        """
        instruments, omega = setup.instruments, np.array(lines)
        return Reading(
            instruments.shown_stiffness(with_structure(setup, self.h, omega), omega),
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
        By set-up (instruments and structure apart, which change no equilibrium), static point and lines.
    start : dict
        Equilibrium per static point.
    """

    solved: dict[Key, Solved] = field(default_factory=dict, repr=False)
    start: dict[StaticPoint, Equilibrium] = field(default_factory=dict, repr=False)

    def copy(self) -> Memory:
        """Return a memory of its own that begins with the same knowledge."""
        return Memory(dict(self.solved), dict(self.start))

    def ask(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]) -> Reading:
        """Look a point up, or solve it.

        Parameters
        ----------
        setup : Setup
        point : (load [N], direction [rad], speed [rad/s])
        lines : tuple of float
            [rad/s]
        sensors : tuple of float
            Fraction of the arc at which every pad carries its thermometer.

        Raises
        ------
        NoEquilibriumError
        """
        key = (setup.change(**_PLAIN), point, (*lines, *sensors))
        known = self.solved.get(key)
        if known is None:
            known = self.solved[key] = _kept(self._solve(key[0], point, lines), sensors)
        return known.read(setup, lines)

    def _solve(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...]) -> Prediction:
        prediction = predict_setup(setup, *point, np.array(lines), self.start.get(point))
        if not prediction.converged:
            raise NoEquilibriumError(f"no equilibrium at {point[0]:.0f} N ({', '.join(prediction.status)})")
        self.start[point] = prediction.equilibrium
        return prediction


def _kept(found: Prediction, sensors: tuple[float, ...]) -> Solved:
    force = found.load * np.array([np.cos(found.load_direction), np.sin(found.load_direction)])
    table = {place: found.pad_temperature(place) for place in set(sensors)}
    warm = np.array([table[place][k] for k, place in enumerate(sensors)])
    return Solved(found.bearing_h, found.bearing_position, force, warm, found.pad_load)
