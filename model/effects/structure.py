"""What stands in series with the bearing, or beside it."""

import math
from dataclasses import replace

import numpy as np

from model.effects.kind import DIRECTION, Parameter, effect_on
from model.measured_pivot import MeasuredPivot
from model.pivots import PivotLaw, ScaledPivot
from model.setup import Setup

#: Stiffness of such a part.
_SPRING = Parameter("stiffness", "N/m", "stiffness", math.inf, 5e7, math.inf, 2e9, "inverse")


def _add_compliance(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """Put a compliance [m/N] in series with the whole bearing.

    A pivot curve that was measured against the same structure already holds it once; it is taken off there, as far as
    it gives way towards that pad.
    """
    pivots = []
    for law, pad in zip(setup.pivots, setup.bearing.pads, strict=True):
        x, y = pad.normal
        pivots.append(_alone(law, xx * x * x + 2.0 * xy * x * y + yy * y * y))
    return _added(setup.change(pivots=tuple(pivots)), "series_compliance", xx, xy, yy)


def _added(setup: Setup, name: str, *amounts: float) -> Setup:
    """Add to the entries of a matrix."""
    return setup.change(**{name: tuple(np.add(getattr(setup, name), amounts).tolist())})


def _alone(law: PivotLaw, compliance: float) -> PivotLaw:
    if isinstance(law, ScaledPivot):
        return replace(law, law=_alone(law.law, compliance))
    return law.without_housing(compliance) if isinstance(law, MeasuredPivot) else law


@effect_on(
    "structure",
    _SPRING,
    source="The paper names it as a likely cause (Sec. 6): 1e9 to 5e9 N/m in rig housings",
    finding="the housing gives like a spring of {stiffness}",
    physics=(
        "Structure between film and probes bends under the dynamic load. It stands in series with the whole bearing."
    ),
    on_the_rig=(
        "Stiffness is short in the stiff direction, most at high load; a probe elsewhere on the housing disagrees."
    ),
    check="the housing's stiffness and where the probes are fixed",
)
def housing_flexibility(setup: Setup, stiffness: float) -> Setup:
    """A spring, equal in x and y, in series with the whole bearing."""
    return _add_compliance(setup, 1.0 / stiffness, 0.0, 1.0 / stiffness)


@effect_on(
    "structure",
    _SPRING,
    DIRECTION,
    source="A cap or a foot is as stiff as a rig housing, in one direction: 1e9 to 5e9 N/m",
    finding="the structure gives like a spring of {stiffness} in one direction, {direction:°}",
    physics=(
        "A cap, a foot or a joint between bearing and probes bends under the dynamic load. It stands in series "
        "with the bearing in that direction only."
    ),
    on_the_rig="Stiffness is short in one direction; dry tests of pads that lie there give too much.",
    check="bolts, joints and feet along that direction",
)
def structure_compliance(setup: Setup, stiffness: float, direction: float) -> Setup:
    """A spring along `direction` alone in series with the bearing: inv(H_meas) = inv(H) + e e^T / stiffness."""
    x, y = math.cos(direction), math.sin(direction)
    return _add_compliance(setup, x * x / stiffness, x * y / stiffness, y * y / stiffness)


@effect_on(
    "structure",
    *tuple(Parameter(entry, "m/N", "compliance", 0.0, -2e-8, 2e-8, 5e-10) for entry in ("xx", "xy", "yy")),
    source="Generic: springs between bearing and probes of 1e9 to 5e9 N/m, as in rig housings",
    finding=("something between film and probes gives way, differently in every direction: xx {xx}, xy {xy}, yy {yy}"),
    physics="A generic term: a spring in series with the whole bearing, for what no named effect describes.",
    on_the_rig="Stiffness is short, most where it is high; dry tests and shaft positions show it too.",
    check="the joints, caps and brackets between the pivots and the probes",
)
def series_compliance(setup: Setup, xx: float, xy: float, yy: float) -> Setup:
    """inv(H_meas) = inv(H) + [[xx, xy], [xy, yy]]; static positions move too, in all kinds of run."""
    return _add_compliance(setup, xx, xy, yy)


@effect_on(
    "structure",
    *tuple(Parameter(entry, "N/m", "stiffness", 0.0, -1e10, 1e10, 2e07) for entry in ("xx", "xy", "yx", "yy")),
    source="Generic: whatever adds a constant stiffness to the records; a tenth of a bearing's own",
    finding="something beside the film adds a stiffness: xx {xx}, xy {xy}, yx {yx}, yy {yy}",
    physics=(
        "A generic term: a constant stiffness that the records hold besides the film's, for what no named effect "
        "describes."
    ),
    on_the_rig="The same amount is off at every load and frequency; shaft positions do not show it.",
    check="hoses, seals and leaf springs across the film; shake the rig dry",
)
def parallel_stiffness(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant stiffness that adds to what the records show, in dynamic tests only."""
    return _added(setup, "parallel_stiffness", xx, xy, yx, yy)


@effect_on(
    "structure",
    *tuple(Parameter(entry, "N s/m", "damping", 0.0, -1e09, 1e09, 1e05) for entry in ("xx", "xy", "yx", "yy")),
    source="Generic: whatever adds a constant damping to the records; a tenth of a bearing's own",
    finding="something beside the film adds a damping: xx {xx}, xy {xy}, yx {yx}, yy {yy}",
    physics=(
        "A generic term: a constant damping that the records hold besides the film's, for what no named effect "
        "describes."
    ),
    on_the_rig="The same damping is off at every load; stiffness agrees.",
    check="hoses, seals and dampers across the film; shake the rig dry",
)
def parallel_damping(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant damping that adds to what the records show, in dynamic tests only."""
    return _added(setup, "parallel_damping", xx, xy, yx, yy)
