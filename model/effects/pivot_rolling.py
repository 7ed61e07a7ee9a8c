"""`pivot_rolling`: a rocker's contact moves as the pad tilts."""

from __future__ import annotations

from model.bearing import Bearing
from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """Tilting is held back by k_theta = factor * W_pad * R_H R_b / (R_H - R_b)."""
    return setup.change(rolling=setup.rolling + factor)


def obstacle(bearing: Bearing) -> str:
    """A pivot without radii does not roll."""
    if not bearing.like_pivots:
        return "its pivots differ from pad to pad, and the model holds the tilt of all pads alike."
    return "" if bearing.pivot.kind in {"rocker", "spherical"} else "the bearing's pivots have no radii to roll on."


KIND = EffectKind(
    name="pivot_rolling",
    side="bearing",
    parameters=(Parameter("factor", "1", "ratio", 0.0, 0.0, 5.0, 1.0),),
    apply=apply,
    source="The radii of the drawing; 1 is as computed",
    obstacle=obstacle,
    words=EffectWords(
        finding="the pivots resist rolling with {factor} of what their radii give",
        physics=(
            "A rocker rolls on its seat, so the contact walks away from the pivot line. The pad resists tilting in "
            "proportion to its load."
        ),
        on_the_rig="Cross-coupled stiffness and a loss of damping that grow with the load.",
        check="the radii of rocker and seat",
    ),
)
