"""A part of the structure that gives way in series with the bearing, as more than one effect adds it."""

from __future__ import annotations

import math
from dataclasses import replace

from model.effects.kind import Parameter
from model.measured_pivot import MeasuredPivot
from model.pivots import PivotLaw, ScaledPivot
from model.setup import Setup

#: Stiffness of such a part.
SPRING = Parameter("stiffness", "N/m", "stiffness", math.inf, 5e7, math.inf, 2e9, "inverse")


def add_compliance(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """Put a compliance [m/N] in series with the whole bearing.

    A pivot curve that was measured against the same structure already holds it once; it is taken off there, as far as
    it gives way towards that pad.
    """
    before = setup.series_compliance
    pivots = []
    for law, pad in zip(setup.pivots, setup.bearing.pads, strict=True):
        x, y = math.cos(pad.pivot_angle), math.sin(pad.pivot_angle)
        pivots.append(_alone(law, xx * x * x + 2.0 * xy * x * y + yy * y * y))
    total = (before[0] + xx, before[1] + xy, before[2] + yy)
    return setup.change(series_compliance=total, pivots=tuple(pivots))


def _alone(law: PivotLaw, compliance: float) -> PivotLaw:
    if isinstance(law, ScaledPivot):
        return replace(law, law=_alone(law.law, compliance))
    return law.without_housing(compliance) if isinstance(law, MeasuredPivot) else law
