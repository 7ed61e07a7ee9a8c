"""`pivot_rolling`: a rocker's contact moves as the pad tilts."""

from __future__ import annotations

from model.bearing import Bearing
from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """Tilting is held back by k_theta = factor * W_pad * R_H R_b / (R_H - R_b)."""
    return setup.change(rolling=setup.rolling + factor)


def obstacle(bearing: Bearing) -> str:
    """A pivot without radii does not roll."""
    return "" if bearing.pivot.kind in {"rocker", "spherical"} else "the bearing's pivots have no radii to roll on."


KIND = EffectKind(
    name="pivot_rolling",
    side="bearing",
    parameters=(Parameter("factor", "1", "ratio", 0.0, 0.0, 5.0, 1.0),),
    apply=apply,
    source="The radii of the drawing; 1 is as computed",
    obstacle=obstacle,
)
