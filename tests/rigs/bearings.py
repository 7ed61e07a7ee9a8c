"""Bearings that differ from a bundled one, and rings of like pads."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from model.bearing import Bearing, Oil, Pad, Pivot


def changed_pads(bearing: Bearing, **changes: Any) -> Bearing:
    """Copy of a bearing whose pads have other values, all alike."""
    return bearing.with_pads(tuple(replace(pad, **changes) for pad in bearing.pads))


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
