"""The bearing model as the truth of a virtual rig: what `tpjb simulate` and the recovery tests write campaigns from."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.dynamics import bearing_impedance
from model.effects import Effect, apply_effects
from model.mirror import runs_backward, seen_by_shaft
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Setup
from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.vector import directions
from rigdata.virtual_rig import Instruments, RigTruth
from rigdata.virtual_rig.truth import load_vector
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.errors import TpjbError

#: Effects that act on the records: which error of the virtual instruments each one is, and its parameter.
INSTRUMENT_ERRORS = {
    "probe_gain": ("probe_gain", "factor"),
    "probe_rotation": ("probe_rotation", "angle"),
    "loadcell_gain": ("loadcell_gain", "factor"),
    "loadcell_crosstalk": ("loadcell_crosstalk", "fraction"),
    "channel_delay": ("channel_delay", "delay"),
    "housing_mass": ("mass_error", "mass_error"),
}
#: Where the rig's temperature sensors sit, as a fraction of the arc.
_SENSOR_POSITION = 0.75


class ModelConvergenceError(TpjbError):
    """The model finds no equilibrium at a point of the plan."""


def rig_truth(bearing: Bearing, settings: ModelSettings, bearing_text: str = "") -> RigTruth:
    """Give a bearing's physics to the virtual rig."""
    physical = [effect for effect in settings.effects if effect.name not in INSTRUMENT_ERRORS]
    return truth_of(
        apply_effects(Setup(bearing, pivot_laws(settings.pivots, bearing), settings.thermal), physical), bearing_text
    )


def truth_of(setup: Setup, bearing_text: str = "") -> RigTruth:
    """Give a set-up's physics to the virtual rig."""
    solved = _SolvedSetup(setup)
    return RigTruth(
        stiffness=solved.stiffness,
        position=solved.position,
        temperature=solved.temperature,
        pivot_deflection=solved.pivot_deflection,
        pivot_angles=tuple(pad.pivot_angle for pad in setup.bearing.pads),
        clearance=tuple(pad.assembled_clearance for pad in setup.bearing.pads),
        bearing_name="bearing.toml",
        bearing_text=bearing_text,
    )


def erring_instruments(instruments: Instruments, effects: Iterable[Effect]) -> Instruments:
    """Add the effects that act on the records to a rig's instruments; other effects do nothing here."""
    for effect in effects:
        if effect.name in INSTRUMENT_ERRORS:
            argument, parameter = INSTRUMENT_ERRORS[effect.name]
            instruments = instruments.with_errors(**{argument: effect.parameters[parameter]})
    return instruments


class _SolvedSetup:
    """Answers of one set-up, each static point solved once."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.solve = functools.lru_cache(maxsize=4096)(self._solve)

    def _solve(self, static: OperatingPoint) -> Prediction:
        setup, speed = self.setup, static.spin
        prediction = predict_setup(setup, static.static_load, static.static_load_direction, speed, static.shaft_speed)
        if not prediction.converged:
            place = f"{static.static_load:g} N, {static.static_load_direction_deg:g} deg, {static.shaft_speed_hz:g} Hz"
            why = "; ".join(prediction.status)
            raise ModelConvergenceError(f"the model finds no equilibrium at {place} ({why}). Leave that point out.")
        return prediction

    def _at(self, point: OperatingPoint) -> Prediction:
        return self.solve(replace(point, excitation=0.0))

    def stiffness(self, point: OperatingPoint) -> ComplexArray:
        setup, equilibrium = seen_by_shaft(self.setup, point.spin), self._at(point).equilibrium
        return bearing_impedance(setup, equilibrium, np.array([point.excitation]))[0]

    def position(self, point: OperatingPoint) -> FloatArray:
        # what stands in series with the bearing gives way under the static load too
        return self._at(point).bearing_position + self.setup.structure @ load_vector(point)

    def temperature(self, point: OperatingPoint) -> FloatArray:
        backward = runs_backward(self.setup.bearing, point.spin)
        return self._at(point).pad_temperature(1.0 - _SENSOR_POSITION if backward else _SENSOR_POSITION)

    def pivot_deflection(self, pad: int, load: Any) -> FloatArray:
        law, angle = self.setup.pivots[pad - 1], self.setup.bearing.pads[pad - 1].pivot_angle
        towards = directions(angle)
        structure = float(towards @ self.setup.structure @ towards)
        return np.array([law.deflection(float(w)) for w in load]) + structure * np.asarray(load)
