"""The bearing model as the truth of a virtual rig: what `tpjb simulate` and the recovery tests write campaigns from."""

import functools
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.dynamics import bearing_impedance
from model.effects import Effect, apply_effects, kind_of
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

#: Where the rig's temperature sensors sit, as a fraction of the arc.
_SENSOR_POSITION = 0.75


def rig_truth(bearing: Bearing, settings: ModelSettings, bearing_text: str = "") -> RigTruth:
    """Give a bearing's physics to the virtual rig."""
    physical = [effect for effect in settings.effects if not is_of_records(effect)]
    return truth_of(
        apply_effects(Setup(bearing, pivot_laws(settings.pivots, bearing), settings.thermal), physical), bearing_text
    )


def truth_of(setup: Setup, bearing_text: str = "") -> RigTruth:
    """Give a set-up's physics to the virtual rig; each static point is solved once."""
    pads, structure = setup.bearing.pads, setup.structure
    solve = functools.lru_cache(maxsize=4096)(functools.partial(_solved, setup))

    def at(point: OperatingPoint) -> Prediction:
        return solve(replace(point, excitation=0.0))

    def stiffness(point: OperatingPoint) -> ComplexArray:
        shaft_setup = seen_by_shaft(setup, point.spin)
        return bearing_impedance(shaft_setup, at(point).equilibrium, np.array([point.excitation]))[0]

    def position(point: OperatingPoint) -> FloatArray:
        # what stands in series with the bearing gives way under the static load too
        return at(point).bearing_position + structure @ load_vector(point)

    def temperature(point: OperatingPoint) -> FloatArray:
        backward = runs_backward(setup.bearing, point.spin)
        return at(point).pad_temperature(1.0 - _SENSOR_POSITION if backward else _SENSOR_POSITION)

    def deflection(pad: int, load: Any) -> FloatArray:
        law, towards = setup.pivots[pad - 1], directions(pads[pad - 1].pivot_angle)
        of_pivot = [law.deflection(float(force)) for force in load]
        return np.array(of_pivot) + float(towards @ structure @ towards) * np.asarray(load)

    return RigTruth(
        stiffness,
        position,
        temperature,
        deflection,
        pivot_angles=setup.bearing.pivot_angles,
        clearance=setup.bearing.clearances,
        bearing_text=bearing_text,
    )


def _solved(setup: Setup, static: OperatingPoint) -> Prediction:
    point = static.static_load, static.static_load_direction, static.spin, static.shaft_speed
    prediction = predict_setup(setup, *point)
    if not prediction.converged:
        reasons = "; ".join(prediction.status)
        raise TpjbError(f"the model finds no equilibrium at {static} ({reasons}). Leave that point out.")
    return prediction


def erring_instruments(instruments: Instruments, effects: Iterable[Effect]) -> Instruments:
    """Add the effects that act on the records to a rig's instruments; other effects do nothing here."""
    for effect in filter(is_of_records, effects):
        # which probe, cell or pad, where it is one
        *place, size = (effect.parameters[parameter.name] for parameter in kind_of(effect.name).parameters)
        instruments = instruments.with_errors(int(place[0]) if place else None, **{effect.name: size})
    return instruments


def is_of_records(effect: Effect) -> bool:
    """Whether an effect acts on the records, as an error of the instruments, and not on the bearing."""
    return kind_of(effect.name).side == "measurement"
