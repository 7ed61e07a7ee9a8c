"""Memory: static points that a model has been solved for, so that none is solved twice.

A diagnosis asks for the same equilibrium again and again: a sensor's error changes no equilibrium, and neither does
most of what is tried at another frequency. Campaigns of one bearing begin with the very same questions, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from model.dynamics.reduction import bearing_impedance, with_structure
from model.instruments import Instruments
from model.predict import solve_as_it_runs
from model.setup import Setup
from model.statics.equilibrium import Equilibrium
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.errors import TpjbError

StaticPoint = tuple[float, float, float]
Key = tuple[StaticPoint, tuple[float, ...], tuple[float, ...]]
_PLAIN: dict[str, Any] = {
    "instruments": Instruments(), "series_compliance": (0.0, 0.0, 0.0), "added_mass": 0.0,
    "parallel_stiffness": (0.0,) * 4, "parallel_damping": (0.0,) * 4,
}  # fmt: skip


class NoEquilibriumError(TpjbError):
    """The model found no equilibrium at an operating point of the campaign."""


@dataclass(frozen=True)
class Solved:
    """What a bearing alone does at one static point, before structure and instruments."""

    h: ComplexArray
    position: FloatArray
    force: FloatArray
    temperature: FloatArray
    pad_load: FloatArray

    def read(self, setup: Setup, lines: tuple[float, ...]) -> Reading:
        """As the structure and the instruments of a set-up show it."""
        instruments, omega = setup.instruments, np.array(lines)
        return Reading(
            instruments.shown_stiffness(with_structure(setup, self.h, omega), omega) if lines else self.h,
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
    """Solved points of one bearing, and the equilibria from which others start."""

    solved: dict[Setup, dict[Key, Solved]] = field(default_factory=dict, repr=False)
    start: dict[StaticPoint, Equilibrium] = field(default_factory=dict, repr=False)
    _last: tuple[Setup, Setup, dict[Key, Solved]] | None = field(default=None, repr=False)

    def copy(self) -> Memory:
        """Return a memory of its own that begins with the same knowledge."""
        return Memory({setup: dict(known) for setup, known in self.solved.items()}, dict(self.start))

    def ask(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]) -> Reading:
        """Look a point up, or solve it."""
        if self._last is None or self._last[0] is not setup:
            # a set-up is some hundred numbers to be compared: once for all points of a prediction
            plain = setup.change(**_PLAIN)
            self._last = setup, plain, self.solved.setdefault(plain, {})
        _, plain, known = self._last
        key = point, lines, sensors
        found = known.get(key)
        if found is None:
            found = known[key] = self._solve(plain, point, lines, sensors)
        return found.read(setup, lines)

    def _solve(self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]) -> Solved:
        load, direction, speed = point
        force = load * np.array([math.cos(direction), math.sin(direction)])
        running, found = solve_as_it_runs(setup, force, speed, self.start.get(point))
        if not found.converged:
            raise NoEquilibriumError(f"no equilibrium at {load:.0f} N ({', '.join(found.status)})")
        self.start[point] = found
        h = bearing_impedance(running, found, np.array(lines)) if lines else np.zeros((0, 2, 2), complex)
        warm = np.array([film.temperature_at(place) for film, place in zip(found.films, sensors, strict=True)])
        loads = np.array([film.forces.force[0] if film.forces is not None else 0.0 for film in found.films])
        return Solved(h, found.position, force, warm, loads)
