"""Bearings that differ from a bundled one, rings of like pads, and points one after another."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from model.bearing import Bearing, Oil, Pad, Pivot
from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Setup
from rigdata.arrays import FloatArray


def changed_pads(bearing: Bearing, **changes: Any) -> Bearing:
    """Copy of a bearing whose pads have other values, all alike."""
    return bearing.with_pads(tuple(replace(pad, **changes) for pad in bearing.pads))


def changed_oil(bearing: Bearing, **changes: Any) -> Bearing:
    """Copy of a bearing with another oil."""
    return replace(bearing, oil=replace(bearing.oil, **changes))


def ring(
    angles: Iterable[float],
    size: tuple[float, float],
    arc: float,
    clearances: tuple[float, float],
    oil: tuple[float, float],
    offset: float = 0.5,
) -> Bearing:
    """Pads alike, rigid pivots: diameter and length, arc, clearances of bore and assembly [m], viscosity and supply."""
    thickness = 0.2 * size[0]
    pads = tuple(Pad(angle, arc, offset, *clearances, thickness, 0.0, thickness, 0.5, 3e-4) for angle in angles)
    return Bearing("ring", *size, pads, Pivot(), Oil(oil[0], 0.034, 860.0, 7e-4, 2000.0, 0.13, oil[1]))


def sweep(setup: Setup, points: Sequence[tuple[float, float, float, FloatArray]]) -> list[Prediction]:
    """Predict points (load, direction, speed, excitation), each started from the one before."""
    out: list[Prediction] = []
    start = None
    for load, direction, speed, excitation in points:
        out.append(predict_setup(setup, load, direction, speed, excitation, start))
        start = out[-1].equilibrium if out[-1].converged else None
    return out
