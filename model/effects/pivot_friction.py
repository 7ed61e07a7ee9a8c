"""`pivot_friction`: a sphere slides in its seat."""

from __future__ import annotations

from model.bearing import Bearing
from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, coefficient: float) -> Setup:
    """Tilting is held by friction up to coefficient * W_pad * sphere radius."""
    return setup.change(friction=setup.friction + coefficient)


def obstacle(bearing: Bearing) -> str:
    """Rockers roll and knife edges tilt: only spheres slide."""
    return "" if bearing.pivot.kind == "spherical" else "only a spherical pivot slides; a rocker rolls (pivot_rolling)."


KIND = EffectKind(
    name="pivot_friction",
    side="bearing",
    parameters=(Parameter("coefficient", "1", "ratio", 0.0, 0.0, 0.6, 0.05),),
    apply=apply,
    source="Steel on steel in oil: 0.05 to 0.15; dry up to 0.5",
    obstacle=obstacle,
)
