"""`pivot_flexibility`: every pivot gives way more than its law says."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.pivots import ScaledPivot
from model.setup import Setup


def apply(setup: Setup, stiffness_factor: float) -> Setup:
    """Every pivot deflects delta(W) / stiffness_factor."""
    return setup.change(pivots=tuple(ScaledPivot(law, stiffness_factor) for law in setup.pivots))


KIND = EffectKind(
    name="pivot_flexibility",
    side="bearing",
    parameters=(Parameter("stiffness_factor", "1", "ratio", 1.0, 0.05, 5.0, 0.5, "inverse"),),
    apply=apply,
    source="Measured pivots are 2-3 times softer than the formula (Lubricants 2019, 7, 61, Fig. 12)",
    words=EffectWords(
        finding="all pivots have {stiffness_factor} of the formula's stiffness",
        physics=(
            "Pivot, pad back and housing seat give more than the contact formula says. They stand in series with the "
            "film, so the stiff direction loses most."
        ),
        on_the_rig=(
            "The deflection of the dry tests exceeds the formula's at every pad; K and C fall short, most at high load."
        ),
        check="the dry pivot tests, contact radii and seats",
    ),
)
