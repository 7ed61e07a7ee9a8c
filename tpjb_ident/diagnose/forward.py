"""Forward: a model with effects, asked for exactly what a campaign measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from model.effects import Effect, apply_effects
from model.equilibrium import Equilibrium
from model.predict import Prediction, predict_setup
from model.setup import Setup
from model.static_tests import dry_curve, polygon_sides
from tpjb_ident.diagnose.layout import DryTest, Layout
from tpjb_ident.diagnose.observe import Element

FloatArray = NDArray[np.float64]
Change = Callable[[Setup], Setup]
StaticPoint = tuple[float, float, float]


class NoEquilibriumError(ValueError):
    """The model found no equilibrium at an operating point of the campaign."""


class ForwardModel(Protocol):
    """Anything that predicts an observation vector: the bearing model, or a surrogate of it."""

    elements: tuple[Element, ...]

    def __call__(self, effects: Sequence[Effect] = (), change: Change | None = None) -> FloatArray:
        """Predict with effects; see `Forward`."""

    def fresh(self) -> ForwardModel:
        """Return a copy whose answers depend on nothing that this one goes on to solve."""


@dataclass
class Forward:
    """Predicts an observation vector; remembers equilibria to start the next call from.

    Attributes
    ----------
    setup : Setup
        Baseline.
    layout : Layout
    elements : tuple of Element
        Of the observation vector: what to return, in which order.
    """

    setup: Setup
    layout: Layout
    elements: tuple[Element, ...] = field(repr=False)
    calls: int = 0
    _start: dict[StaticPoint, Equilibrium] = field(default_factory=dict, repr=False)
    _shares: dict[tuple[float, ...], float] = field(default_factory=dict, repr=False)

    def __call__(self, effects: Sequence[Effect] = (), change: Change | None = None) -> FloatArray:
        """Predict.

        Parameters
        ----------
        effects : sequence of Effect
        change : callable, optional
            A further change of the `Setup` (a nuisance).

        Returns
        -------
        (n,) ndarray

        Raises
        ------
        NoEquilibriumError
            Some operating point has none.
        """
        setup = apply_effects(self.setup, effects)
        if change is not None:
            setup = change(setup)
        self.calls += 1
        table = _Answers(setup)
        for test in self.layout.dynamic:
            point = (test.load, test.direction, test.speed)
            prediction = self._solve(setup, point, test.excitation)
            table.dynamic(test, prediction, self.layout)
            for pad, load in enumerate(prediction.pad_load, start=1):
                self._shares[(*point, float(pad))] = float(load) / test.load
        for one in self.layout.locus:
            point = (one.load, one.direction, one.speed)
            table.locus(point, self._solve(setup, point, (one.speed,)))
        for dry in self.layout.dry:
            table.dry(dry)
        if self.layout.push_load is not None:
            table.clearance(self.layout.push_load)
        return np.array([table.get(e) for e in self.elements])

    def fresh(self) -> Forward:
        """Return a copy that starts from the same equilibria, whatever this one goes on to solve."""
        return Forward(self.setup, self.layout, self.elements, 0, dict(self._start), dict(self._shares))

    def pad_shares(self) -> FloatArray:
        """Share of the static load on the pad of every temperature element at the last call; NaN elsewhere, (n,)."""
        names = ("load", "direction", "speed", "pad")
        places = [tuple(e.place(name) for name in names) for e in self.elements]
        mine = [e.family == "temperature" for e in self.elements]
        return np.array(
            [self._shares.get(place, math.nan) if m else math.nan for place, m in zip(places, mine, strict=True)]
        )

    def _solve(self, setup: Setup, point: StaticPoint, excitation: Sequence[float]) -> Prediction:
        prediction = predict_setup(setup, *point, np.array(excitation), self._start.get(point))
        if not prediction.converged:
            raise NoEquilibriumError(f"no equilibrium at {point[0]:.0f} N ({', '.join(prediction.status)})")
        self._start[point] = prediction.equilibrium
        return prediction


_ROW = {"xx": (0, 0), "xy": (0, 1), "yx": (1, 0), "yy": (1, 1)}


@dataclass
class _Answers:
    setup: Setup
    table: dict[tuple[object, ...], float] = field(default_factory=dict)

    def get(self, element: Element) -> float:
        return self.table[(element.observable, *(v for _, v in element.where))]

    def dynamic(self, test, prediction: Prediction, layout: Layout) -> None:  # type: ignore[no-untyped-def]
        point = (test.load, test.direction, test.speed)
        for h, omega in zip(prediction.h, test.excitation, strict=True):
            for name, at in _ROW.items():
                self.table[(f"k{name}", *point, omega)] = float(h[at].real)
                self.table[(f"c{name}", *point, omega)] = float(h[at].imag)
        for pad, t in enumerate(prediction.pad_temperature(layout.temperature_position), start=1):
            self.table[("pad_temperature", *point, float(pad))] = float(t)

    def locus(self, point: StaticPoint, prediction: Prediction) -> None:
        self.table[("locus_x", *point)], self.table[("locus_y", *point)] = map(float, prediction.position)
        reading = prediction.load_reading
        self.table[("load_ratio", *point)] = float(np.hypot(*reading)) / point[0]
        turn = np.arctan2(reading[1], reading[0]) - point[1]
        self.table[("load_turn", *point)] = float(np.arctan2(np.sin(turn), np.cos(turn)))

    def dry(self, test: DryTest) -> None:
        """Logarithm of the tangent compliance at loads as read."""
        for load in test.load:
            step = 0.02 * load
            curve = dry_curve(self.setup, test.pad, np.array([load - step, load + step]))
            gain = curve.load[1] / (load + step)  # loads are as read: ask at the true ones
            if abs(gain - 1.0) > 1e-12:
                curve = dry_curve(self.setup, test.pad, np.array([load - step, load + step]) / gain)
            slope = max(float(np.diff(curve.deflection)[0] / np.diff(curve.load)[0]), 1e-16)
            self.table[("dry_compliance", float(test.pad), load)] = float(np.log(slope))

    def clearance(self, push_load: float) -> None:
        sides = polygon_sides(self.setup, push_load)
        for k, (pad, pushed, angle) in enumerate(
            zip(self.setup.bearing.pads, sides.pushed, sides.angle, strict=True), start=1
        ):
            self.table[("clearance_pushed", float(k), pad.pivot_angle)] = float(pushed)
            turn = angle - pad.pivot_angle
            self.table[("side_angle", float(k), pad.pivot_angle)] = float(np.arctan2(np.sin(turn), np.cos(turn)))
