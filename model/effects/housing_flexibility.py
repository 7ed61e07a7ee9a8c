"""`housing_flexibility`: the structure between pivots and probes gives way."""

from __future__ import annotations

import math
from dataclasses import replace

from model.effects.kind import EffectKind, Parameter
from model.pivots import MeasuredPivot, PivotLaw, ScaledPivot
from model.setup import Setup


def apply(setup: Setup, stiffness: float) -> Setup:
    """A spring, equal in x and y, in series with the whole bearing.

    A pivot curve that was measured against the same housing already holds the spring once; it is taken off there.
    """
    compliance = 1.0 / stiffness
    pivots = tuple(_alone(law, compliance) for law in setup.pivots)
    return setup.change(series_compliance=setup.series_compliance + compliance, pivots=pivots)


def _alone(law: PivotLaw, compliance: float) -> PivotLaw:
    if isinstance(law, ScaledPivot):
        return replace(law, law=_alone(law.law, compliance))
    return law.without_housing(compliance) if isinstance(law, MeasuredPivot) else law


KIND = EffectKind(
    name="housing_flexibility",
    side="structure",
    parameters=(Parameter("stiffness", "N/m", "stiffness", math.inf, 50000000.0, math.inf, 2e9, "inverse"),),
    apply=apply,
    source="The paper names it as a likely cause (Sec. 6): 1e9 to 5e9 N/m in rig housings",
)
