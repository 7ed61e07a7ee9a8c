"""Remainder: which observable disagrees where."""

from __future__ import annotations

import math

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.observations.gap import residuals
from tpjb_ident.diagnosis.observations.observe import Observations
from tpjb_ident.diagnosis.verdict.verdict import Disagreement

#: Rows of the list of disagreements.
_MOST = 12


def localise(observations: Observations, prediction: FloatArray) -> tuple[Disagreement, ...]:
    """Split the squared gap by observable and region, largest share first; `prediction` (n,)."""
    z = residuals(observations, prediction)
    total = float(np.sum(z**2))
    rows: list[Disagreement] = []
    for name in dict.fromkeys(e.observable for e in observations.elements):
        mine = np.array([e.observable == name for e in observations.elements])
        for where, part in _regions(observations, mine):
            square = float(np.sum(z[part] ** 2))
            rows.append(Disagreement(name, where, math.sqrt(square / part.sum()), square / total if total else 0.0))
    rows.sort(key=lambda d: -d.share)
    return tuple(rows[:_MOST])


def _regions(observations: Observations, mine: BoolArray):  # type: ignore[no-untyped-def]
    """Halves of the range of the coordinate that varies most among the elements, or single pads."""
    elements = observations.elements
    for coordinate, unit, factor in (("pad", "", 1.0), ("load", "N", 1.0), ("direction", "deg", 180 / math.pi)):
        values = np.array([e.place(coordinate) for e in elements])
        levels = sorted(set(values[mine & np.isfinite(values)]))
        if len(levels) < 2:
            continue
        if coordinate == "pad":
            yield from ((f"pad {int(k)}", mine & (values == k)) for k in levels)
        else:
            half = len(levels) // 2
            for part in (levels[:half], levels[half:]):
                low, high = part[0] * factor, part[-1] * factor
                name = {"load": "static_load", "direction": "static_load_direction"}[coordinate]
                yield f"{name} {low:.0f}-{high:.0f} {unit}", mine & np.isin(values, part)
        return
    yield "everywhere", mine
