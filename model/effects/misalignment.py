"""`misalignment`: the shaft leans in the bearing."""

from __future__ import annotations

from model.effects.kind import DIRECTION, EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, angle: float, direction: float) -> Setup:
    """The shaft axis is tilted by angle towards direction, about mid-bearing; pads do not follow."""
    return setup.change(misalignment=(angle, direction))


KIND = EffectKind(
    name="misalignment",
    side="bearing",
    parameters=(
        Parameter("angle", "rad", "angle", 0.0, 0.0, 0.002, 0.0003, "square"),
        DIRECTION,
    ),
    apply=apply,
    source="Half the clearance over half the length is 1e-3 rad",
    words=EffectWords(
        finding="the shaft is tilted by {angle:mm/m} towards {direction:°}",
        physics=(
            "The shaft axis is tilted in the bearing, so the film is thinner at one end. Stiffness rises, most across "
            "the loaded pad."
        ),
        on_the_rig="Probes at the two ends read differently; the pads wear at one edge.",
        check="the alignment of shaft and housing under load",
    ),
)
