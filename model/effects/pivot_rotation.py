"""`pivot_rotation`: the pivots resist tilting."""

from __future__ import annotations

from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, rotational_stiffness: float) -> Setup:
    """Tilting is held back by this about each pivot, from the concentric attitude (k_theta of Eq. 12)."""
    return setup.change(rotational_stiffness=setup.rotational_stiffness + rotational_stiffness)


KIND = EffectKind(
    name="pivot_rotation",
    side="bearing",
    parameters=(Parameter("rotational_stiffness", "N m/rad", "rotational stiffness", 0.0, 0.0, 1000000.0, 1000.0),),
    apply=apply,
    source="Flexure pivots: 1e3 to 1e5 N m/rad; a stuck rocker more",
)
