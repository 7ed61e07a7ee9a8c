"""`misalignment`: the shaft leans in the bearing."""

from __future__ import annotations

import math

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, angle: float, direction: float) -> Setup:
    """The shaft axis is tilted by angle towards direction, about mid-bearing; pads do not follow."""
    return setup.change(misalignment=(angle, direction))


KIND = EffectKind(
    name="misalignment",
    side="bearing",
    parameters=(
        Parameter("angle", "rad", "angle", 0.0, 0.0, 0.002, 0.0003, "square"),
        Parameter(
            "direction", "rad", "angle", math.nan, -7.0, 7.0, options=(0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
        ),
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
