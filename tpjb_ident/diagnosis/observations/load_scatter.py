"""Load scatter: where the shaft goes when a run's static load misses its set point, from the campaign itself.

The direction misses by some tenths of a degree: 0.2 um at 60 um from the centre, more than probes err by. The cells see
it too, so positions and load readings share that error.
"""

from __future__ import annotations

import math

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.clearance.locus import Locus, LocusPoint
from tpjb_ident.dynamic.results.identification import Identification

#: Harmonics of the load's direction that a locus of many directions is described by.
HARMONICS = 3


def moved_by_miss(locus: Locus, identification: Identification) -> list[FloatArray]:
    """Change of every position with the load's size and direction."""
    out = []
    for p in locus.points:
        along = np.array([math.cos(p.point.static_load_direction), math.sin(p.point.static_load_direction)])
        more = along * p.point.static_load / _stiffness(identification, p.point.static_load)
        out.append(np.column_stack([more, _turned(p, locus)]))
    return out


def _stiffness(identification: Identification, load: float) -> float:
    """Mean direct stiffness at the nearest load and the lowest excitation [N/m]."""
    known = [p for p in identification.points if np.isfinite(p.stiffness.h).all()]
    if not known:
        return math.inf
    nearest = min(known, key=lambda p: (abs(p.point.static_load - load), p.point.excitation))
    return nearest.stiffness.direct[0]


def _turned(point: LocusPoint, locus: Locus) -> FloatArray:
    """Change of a position with the load's direction: slope of the locus itself, through its harmonics (2,)."""
    alike = [
        p for p in locus.points
        if (p.point.static_load, p.point.shaft_speed) == (point.point.static_load, point.point.shaft_speed)
    ]  # fmt: skip
    angle = np.array([p.point.static_load_direction for p in alike])
    place = np.array([p.position for p in alike])
    count = len(np.unique(np.round(np.exp(1j * angle), 6)))
    orders = np.arange(1, min(HARMONICS, (count - 1) // 2) + 1)
    if not len(orders) or _largest_gap(angle) > math.pi / orders[-1]:
        # too few directions: as if the whole locus turned about its middle, or about the zero where that is all
        middle = place.mean(axis=0) if count > 2 else np.zeros(2)
        x, y = point.position - middle
        return np.array([-y, x])
    at = point.point.static_load_direction
    design = np.column_stack([np.ones_like(angle), np.cos(np.outer(angle, orders)), np.sin(np.outer(angle, orders))])
    fitted = np.linalg.lstsq(design, place, rcond=None)[0]
    slope = np.concatenate([[0.0], -orders * np.sin(at * orders), orders * np.cos(at * orders)])
    return np.asarray(slope @ fitted)


def _largest_gap(angle: FloatArray) -> float:
    """Largest angle between neighbouring directions."""
    around = np.sort(np.mod(angle, 2 * math.pi))
    return float(np.diff(np.append(around, around[0] + 2 * math.pi)).max())
