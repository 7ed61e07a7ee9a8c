"""`structure_compliance`: the structure gives way in one direction, a compliant cap or a soft foot."""

from __future__ import annotations

import math

from model.effects.kind import DIRECTION, EffectKind, EffectWords
from model.effects.series import SPRING, add_compliance
from model.setup import Setup


def apply(setup: Setup, stiffness: float, direction: float) -> Setup:
    """A spring along `direction` alone in series with the bearing: inv(H_meas) = inv(H) + e e^T / stiffness."""
    x, y = math.cos(direction), math.sin(direction)
    return add_compliance(setup, x * x / stiffness, x * y / stiffness, y * y / stiffness)


KIND = EffectKind(
    name="structure_compliance",
    side="structure",
    parameters=(SPRING, DIRECTION),
    apply=apply,
    source="A cap or a foot is as stiff as a rig housing, in one direction: 1e9 to 5e9 N/m",
    words=EffectWords(
        finding="the structure gives like a spring of {stiffness} in one direction, {direction:°}",
        physics=(
            "A cap, a foot or a joint between bearing and probes bends under the dynamic load. It stands in series "
            "with the bearing in that direction only."
        ),
        on_the_rig="Stiffness is short in one direction; dry tests of pads that lie there give too much.",
        check="bolts, joints and feet along that direction",
    ),
)
