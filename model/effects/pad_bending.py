"""`pad_bending`: pads deform under pressure and heat."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, compliance_factor: float) -> Setup:
    """Switch on the pads' computed deformation, times compliance_factor."""
    return setup.change(bending=compliance_factor)


KIND = EffectKind(
    name="pad_bending",
    side="bearing",
    parameters=(Parameter("compliance_factor", "1", "ratio", 0.0, 0.0, 10.0, 1.0),),
    apply=apply,
    source="Eq. (6)-(8) of Lubricants 2019, 7, 61; 1 is as computed",
    words=EffectWords(
        finding="the pads bend by {compliance_factor} of what is computed",
        physics=(
            "Film pressure bends the pads open. Their clearance grows with the load, which lowers stiffness and "
            "damping."
        ),
        on_the_rig="Coefficients fall short more and more as the load rises.",
        check="thickness and support of the pads",
    ),
)
