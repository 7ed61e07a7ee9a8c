"""`pivot_rotation`: the pivots resist tilting."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
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
    words=EffectWords(
        finding="the pivots resist tilting with {rotational_stiffness}",
        physics="A pad that cannot tilt freely behaves like a fixed one. Cross-coupled stiffness appears.",
        on_the_rig="kxy and kyx of opposite sign, that no free pad gives.",
        check="whether the pads tilt freely by hand",
    ),
)
