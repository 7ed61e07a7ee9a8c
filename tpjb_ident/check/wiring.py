"""Which wiring fault of two sensors would explain what they show: swapped, inverted, ten times off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.vector import inverse_directions


def repairs(channels: Sequence[Channel], scales: bool = False) -> Iterator[tuple[str, FloatArray]]:
    """Every simple mending of two channels' readings, as a matrix on them, with the fault in words."""
    first, second = (c.name for c in channels)
    yield f"{first} and {second} were swapped", np.array([[0.0, 1.0], [1.0, 0.0]])
    yield f"{first} had the wrong sign", np.diag([-1.0, 1.0])
    yield f"{second} had the wrong sign", np.diag([1.0, -1.0])
    yield f"{first} and {second} both had the wrong sign", -np.eye(2)
    if scales:
        for factor, word in ((0.1, "ten times too large"), (10.0, "ten times too small")):
            yield f"{first} read {word}", np.diag([factor, 1.0])
            yield f"{second} read {word}", np.diag([1.0, factor])


def guess_wiring(channels: Sequence[Channel], readings: FloatArray, wanted: FloatArray, within: float = 8.0) -> str:
    """Say which fault would turn the readings into the direction `wanted`; "" where not just one would.

    `readings` (m,), `wanted` (2,).
    """
    if len(channels) != 2 or not np.all(np.isfinite(readings)):
        return ""
    inverse = inverse_directions(tuple(float(c.axis or 0.0) for c in channels))
    explanations = []
    for words, matrix in repairs(channels):
        vector = inverse @ matrix @ readings
        size = float(np.hypot(*vector))
        if size > 0 and float(vector @ wanted) > math.cos(math.radians(within)) * size:
            explanations.append(words)
    # With the load along one cell's axis a wrong sign of the other one changes nothing: simplest first.
    return f"; as if {explanations[0]}" if explanations and len(explanations) < 3 else ""


def name_fault(channels: Sequence[Channel], quality: Callable[[FloatArray], float]) -> str:
    """Name the fault of two channels whose mending is clearly the best; "" where none is."""
    if len(channels) != 2:
        return ""
    tried = sorted(((quality(matrix), words) for words, matrix in repairs(channels)), reverse=True)
    best, second = tried[0], tried[1]
    return f"; as if {best[1]}" if best[0] > 0.15 and best[0] > 2 * second[0] else ""
