"""What the static tests would show: dry load-deflection curves, the clearance polygon, the locus.

Dry tests and the clearance sweep are cold and without rotation: `clearance_change` does not act on them, the
pivots, the structure and the instruments do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Setup
from model.statics.equilibrium import Equilibrium
from rigdata.arrays import FloatArray


@dataclass(frozen=True)
class DryCurve:
    """A dry load-deflection curve as probes and cells read it."""

    pad: int
    load: FloatArray  #: (n,): Component of the read force on the pad's direction [N].
    deflection: FloatArray  #: (n,): Component of the read displacement on the pad's direction, from zero load [m].


def dry_curve(setup: Setup, pad: int, load: FloatArray) -> DryCurve:
    """Predict a dry test on one pad: `load` (n,) [N]."""
    law, angle = setup.pivots[pad - 1], setup.bearing.pads[pad - 1].pivot_angle
    normal = np.array([math.cos(angle), math.sin(angle)])
    structure = float(normal @ setup.structure @ normal)
    true = np.array([law.deflection(float(w)) for w in load]) + structure * np.asarray(load)
    displacement = float(normal @ setup.instruments.displacement_map(0.0).real @ normal)
    force = float(normal @ setup.instruments.force_map(0.0).real @ normal)
    return DryCurve(pad, np.asarray(load) * force, true * displacement)


@dataclass(frozen=True)
class PolygonSides:
    """The clearance polygon as the probes read it: per pad the distance of its side from the bearing centre."""

    clearance: FloatArray  #: (n_pads,): At zero push load [m].
    pushed: FloatArray  #: (n_pads,): With the pivots and the structure given way under the push load [m].
    angle: FloatArray  #: (n_pads,): Direction of each side's normal [rad].


def polygon_sides(setup: Setup, push_load: float) -> PolygonSides:
    """Predict a cold clearance sweep with a push load [N]."""
    inverse = np.linalg.inv(setup.instruments.displacement_map(0.0).real)
    distances, angles = [], []
    for pad, law in zip(setup.bearing.pads, setup.pivots, strict=True):
        towards = np.array([math.cos(pad.pivot_angle), math.sin(pad.pivot_angle)])
        normal = inverse.T @ towards
        size = float(np.hypot(*normal))
        deflection = law.deflection(push_load) + float(towards @ setup.structure @ towards) * push_load
        distances.append((pad.assembled_clearance / size, (pad.assembled_clearance + deflection) / size))
        angles.append(math.atan2(normal[1], normal[0]))
    clearance, pushed = np.array(distances).T
    return PolygonSides(clearance, pushed, np.array(angles))


def sweep(
    setup: Setup, points: Sequence[tuple[float, float, float, FloatArray]], start: Equilibrium | None = None
) -> list[Prediction]:
    """Predict many operating points, each started from the one before."""
    out: list[Prediction] = []
    for load, direction, speed, excitation in points:
        prediction = predict_setup(setup, load, direction, speed, excitation, start)
        out.append(prediction)
        start = prediction.equilibrium if prediction.converged else None
    return out


def locus(setup: Setup, load: float, directions: FloatArray, speed: float) -> FloatArray:
    """Journal positions over load directions, as read: `directions` (n,) [rad]; gives (n, 2) [m]."""
    points = [(load, float(d), speed, np.array([speed])) for d in directions]
    return np.array([p.position if p.converged else (math.nan, math.nan) for p in sweep(setup, points)])
