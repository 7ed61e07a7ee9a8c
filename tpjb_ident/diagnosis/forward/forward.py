"""Forward: a model with effects, asked for exactly what a campaign measured."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from model.dynamics import bearing_impedance, with_structure
from model.effects import Effect, apply_effects
from model.instruments import Instruments
from model.mirror import runs_backward
from model.predict import in_rig, solve_as_it_runs
from model.setup import Setup
from model.static_tests import dry_curve, polygon_sides
from model.statics.equilibrium import Equilibrium
from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.diagnosis.observations.observe import DryTest, Element, Layout, LocusTest, all_elements
from tpjb_ident.errors import TpjbError

#: Load [N], its direction [rad], shaft speed about +z [rad/s]: negative where it turns clockwise.
StaticPoint = tuple[float, float, float]
Key = tuple[StaticPoint, tuple[float, ...], tuple[float, ...]]
_PLAIN: dict[str, Any] = {
    "instruments": Instruments(), "series_compliance": (0.0, 0.0, 0.0), "added_mass": 0.0,
    "parallel_stiffness": (0.0,) * 4, "parallel_damping": (0.0,) * 4,
}  # fmt: skip


class NoEquilibriumError(TpjbError):
    """The model found no equilibrium at an operating point of the campaign."""


@dataclass(frozen=True)
class SolvedPoint:
    """What a bearing does at one static point: alone, or as structure and instruments show it."""

    h: ComplexArray  #: (n, 2, 2) complex, N/m
    position: FloatArray  #: (2,), m
    load: FloatArray  #: (2,), N
    temperature: FloatArray  #: (n_pads,), degC
    pad_load: FloatArray  #: (n_pads,), N

    def read(self, setup: Setup, lines: tuple[float, ...]) -> SolvedPoint:
        """As the structure and the instruments of a set-up show it."""
        instruments, omega = setup.instruments, np.array(lines)
        return SolvedPoint(
            instruments.shown_stiffness(with_structure(setup, self.h, omega), omega) if lines else self.h,
            instruments.shown_position(self.position + setup.structure @ self.load),
            instruments.shown_load(self.load), instruments.shown_temperature(self.temperature), self.pad_load,
        )  # fmt: skip


@dataclass
class ModelCache:
    """Solved points of one bearing, and the equilibria from which others start."""

    solved: dict[Setup, dict[Key, SolvedPoint]] = field(default_factory=dict, repr=False)
    start: dict[StaticPoint, Equilibrium] = field(default_factory=dict, repr=False)
    near: bool = False  #: whether all that is asked lies a small step from `start`: for derivatives
    patient: bool = False  #: whether an equilibrium is worth raising load and heat for
    _last: tuple[Setup, Setup, dict[Key, SolvedPoint]] | None = field(default=None, repr=False)

    def copy(self, near: bool = False) -> ModelCache:
        """Return a memory of its own that begins with the same knowledge."""
        return ModelCache({setup: dict(points) for setup, points in self.solved.items()}, dict(self.start), near)

    def ask(
        self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]
    ) -> SolvedPoint:
        """Look a point up, or solve it."""
        if self._last is None or self._last[0] is not setup:
            # a set-up is some hundred numbers to be compared: once for all points of a prediction
            plain = setup.change(**_PLAIN)
            self._last = setup, plain, self.solved.setdefault(plain, {})
        _, plain, solved_points = self._last
        key = point, lines, sensors
        solution = solved_points.get(key)
        if solution is None:
            solution = solved_points[key] = self._solve(plain, point, lines, sensors)
        return solution.read(setup, lines)

    def _solve(
        self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]
    ) -> SolvedPoint:
        load, direction, speed = point
        force = load * np.array([math.cos(direction), math.sin(direction)])
        start = self.start.get(point)
        # what no solved neighbour and no curve of a pad leads to is too far away: a step is shortened sooner
        running, equilibrium = solve_as_it_runs(
            setup, force, speed, start, patient=self.patient or start is None, near=self.near
        )
        if not equilibrium.converged:
            raise NoEquilibriumError(f"no equilibrium at {load:.0f} N ({', '.join(equilibrium.status)})")
        self.start[point] = equilibrium
        h = bearing_impedance(running, equilibrium, np.array(lines)) if lines else np.zeros((0, 2, 2), complex)
        if runs_backward(setup.bearing, speed):
            sensors = tuple(1.0 - place for place in sensors)
        warm = np.array([film.temperature_at(place) for film, place in zip(equilibrium.films, sensors, strict=True)])
        loads = np.array([film.forces.force[0] if film.forces is not None else 0.0 for film in equilibrium.films])
        return SolvedPoint(h, in_rig(running, equilibrium.position), force, warm, loads)


Change = Callable[[Setup], Setup]
#: Fraction of the arc at which a pad carries its thermometer where nothing is said.
SENSOR = 0.75


@dataclass
class Forward:
    """Predicts an observation vector; remembers what it has solved, and starts the next call from there."""

    setup: Setup
    layout: Layout
    elements: tuple[Element, ...] = field(repr=False)
    cache: ModelCache = field(default_factory=ModelCache, repr=False)
    last: Change | None = None  #: of a rig that a test itself has changed, after effects and nuisances
    coarser: Forward | None = field(default=None, repr=False)  #: the same on a coarser mesh, for differences

    def __call__(self, effects: Sequence[Effect] = (), change: Change | None = None) -> FloatArray:
        """Predict, (n,)."""
        setup = apply_effects(self.setup, effects)
        for done in (change, self.last):
            setup = setup if done is None else done(setup)
        values = []
        for test in self.layout.dynamic:
            reading = self._solve(setup, test, test.excitation)
            values += [np.stack([reading.h.real, reading.h.imag], axis=1).ravel()]
            values += [reading.temperature[np.array(test.pads, int) - 1]]
        values += [_locus(test, self._solve(setup, test)) for test in self.layout.locus]
        values += [_dry(setup, dry) for dry in self.layout.dry]
        if self.layout.push_load is not None:
            sides, angles = polygon_sides(setup, self.layout.push_load)
            values += [sides, np.angle(np.exp(1j * (angles - self._drawn)))]
        return np.concatenate(values)[self._rows]

    def fresh(self, near: bool = False) -> Forward:
        """Return a copy that knows what this one knows now, whatever this one goes on to solve."""
        forward = copy.copy(self)  # with where its elements are, which is worked out once
        forward.cache = self.cache.copy(near)
        return forward

    @property
    def of_differences(self) -> Forward:
        """A copy that tells what a number changes: a mesh's error is in both ends of a difference, and falls out."""
        return (self.coarser or self).fresh()

    @functools.cached_property
    def _drawn(self) -> FloatArray:
        """The pivots' angles in the bearing file, from which those of a polygon's sides count, (n_pads,)."""
        return np.array(self.setup.bearing.pivot_angles)

    @functools.cached_property
    def _rows(self) -> IntArray:
        """Where the elements are among all that the layout shows; not every one was measured."""
        shown = all_elements(self.layout, self._drawn.tolist())
        places = {element: row for row, element in enumerate(shown)}
        return np.array([places[element] for element in self.elements], dtype=int)

    def pad_shares(self) -> FloatArray:
        """Share of the static load on the pad of every temperature element in the baseline; NaN elsewhere, (n,)."""
        shares: dict[tuple[float, ...], float] = {}
        for test in self.layout.dynamic:
            loads = self._solve(self.setup, test, test.excitation).pad_load
            shares.update({(*test.point, float(pad)): load / test.load for pad, load in enumerate(loads, start=1)})
        names = ("load", "direction", "speed", "pad")
        return np.array([shares.get(tuple(map(e.place, names)), math.nan) for e in self.elements])

    @property
    def _sensors(self) -> tuple[float, ...]:
        return self.layout.temperature_position or (SENSOR,) * len(self.setup.bearing.pads)

    def _solve(self, setup: Setup, test: LocusTest, excitation: Sequence[float] = ()) -> SolvedPoint:
        return self.cache.ask(setup, test.point, tuple(excitation), self._sensors)


def with_coarser_mesh(forward: Forward) -> Forward:
    """With the same on a coarser mesh, which has its baseline solved; without where that finds no equilibrium."""
    setup = forward.setup
    coarser = replace(forward, setup=setup.change(mesh=setup.mesh.coarser()), cache=ModelCache())
    try:
        coarser()
    except NoEquilibriumError:
        return forward
    return replace(forward, coarser=coarser)


def _locus(test: LocusTest, reading: SolvedPoint) -> FloatArray:
    """Position, load over its set point, and the angle between them."""
    x, y = reading.load
    turn = math.remainder(math.atan2(y, x) - test.direction, 2.0 * math.pi)
    return np.array([*reading.position, math.hypot(x, y) / test.load, turn])


def _dry(setup: Setup, test: DryTest) -> FloatArray:
    """Logarithm of the tangent compliance at loads as read."""
    load = np.array(test.load)
    around = np.concatenate([0.98 * load, 1.02 * load])
    forces, deflections = dry_curve(setup, test.pad, around)
    gain = forces / around
    if np.any(np.abs(gain - 1.0) > 1e-12):  # loads are as read: ask at the true ones
        forces, deflections = dry_curve(setup, test.pad, around / gain)
    rise, push = (values[len(load) :] - values[: len(load)] for values in (deflections, forces))
    return np.asarray(np.log(np.maximum(rise / push, 1e-16)))
