"""`soft_pivot`: one pivot gives way more than its law says."""

from __future__ import annotations

from model.effects.kind import PAD, EffectKind, EffectWords, Parameter
from model.pivots import ScaledPivot
from model.setup import Setup


def apply(setup: Setup, pad: int, stiffness_factor: float) -> Setup:
    """The pivot of one pad deflects delta(W) / stiffness_factor."""
    pivots = list(setup.pivots)
    pivots[pad - 1] = ScaledPivot(pivots[pad - 1], stiffness_factor)
    return setup.change(pivots=tuple(pivots))


KIND = EffectKind(
    name="soft_pivot",
    side="bearing",
    parameters=(
        PAD,
        Parameter("stiffness_factor", "1", "ratio", 1.0, 0.05, 5.0, 0.5, "inverse"),
    ),
    apply=apply,
    source="Pad #5 of the paper is the softest of five (Lubricants 2019, 7, 61, Fig. 12)",
    words=EffectWords(
        finding="the pivot of {pad} has {stiffness_factor} of the formula's stiffness",
        physics="One pivot gives more, or less, than the others. It stands in series with that pad's film.",
        on_the_rig="One dry test is off; coefficients are off along that pad's direction.",
        check="that pad's seat, pivot and fit",
    ),
)
