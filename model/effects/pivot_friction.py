"""`pivot_friction`: a sphere slides in its seat."""

from __future__ import annotations

from model.bearing import Bearing
from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, coefficient: float) -> Setup:
    """Tilting is held by friction up to coefficient * W_pad * sphere radius."""
    return setup.change(friction=setup.friction + coefficient)


def obstacle(bearing: Bearing) -> str:
    """Rockers roll and knife edges tilt: only spheres slide."""
    if not bearing.like_pivots:
        return "its pivots differ from pad to pad, and the model holds the tilt of all pads alike."
    return "" if bearing.pivot.kind == "spherical" else "only a spherical pivot slides; a rocker rolls (pivot_rolling)."


KIND = EffectKind(
    name="pivot_friction",
    side="bearing",
    parameters=(Parameter("coefficient", "1", "ratio", 0.0, 0.0, 0.6, 0.05),),
    apply=apply,
    source="Steel on steel in oil: 0.05 to 0.15; dry up to 0.5",
    obstacle=obstacle,
    words=EffectWords(
        finding="the pivots rub with a friction coefficient of {coefficient:3}",
        physics=(
            "A sphere that rubs in its seat holds the pad until the moment is large enough. A pad that is held "
            "behaves like a fixed one."
        ),
        on_the_rig="Coefficients depend on the amplitude; loading and unloading differ.",
        check="wear and lubrication of the seats",
    ),
)
