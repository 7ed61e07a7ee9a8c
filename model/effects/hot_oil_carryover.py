"""`hot_oil_carryover`: a pad drinks what the pad before it leaves."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, fraction: float) -> Setup:
    """A share lambda of the oil that leaves a pad enters the next one, as far as that takes it in.

    T_in = T_supply + s (T_out before - T_supply) with s = min(1, lambda Q_out before / Q_in), see
    `model.statics.heat_paths`.
    """
    return setup.change(carryover=fraction)


KIND = EffectKind(
    name="hot_oil_carryover",
    side="bearing",
    parameters=(Parameter("fraction", "1", "ratio", 0.0, 0.0, 0.98, 0.4),),
    apply=apply,
    source="Ettles 1992; groove mixing 0.4 to 0.95 in flooded bearings",
    words=EffectWords(
        finding="{fraction} of the hot oil of one pad enters the next",
        physics=(
            "Oil that leaves a pad is carried into the next film. Films run hotter and thinner than with fresh oil."
        ),
        on_the_rig="Pad temperatures rise from pad to pad around the shaft.",
        check="oil flow and the spray bars between the pads",
    ),
)
