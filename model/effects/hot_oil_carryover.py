"""`hot_oil_carryover`: a pad drinks what the pad before it leaves."""

from __future__ import annotations

from model.effects.kind import EffectKind, Parameter
from model.setup import Setup


def apply(setup: Setup, fraction: float) -> Setup:
    """Inlet temperature of a pad = T_supply + fraction * (outlet of the pad before it - T_supply)."""
    return setup.change(carryover=fraction)


KIND = EffectKind(
    name="hot_oil_carryover",
    side="bearing",
    parameters=(Parameter("fraction", "1", "ratio", 0.0, 0.0, 0.98, 0.4),),
    apply=apply,
    source="Ettles 1992; groove mixing 0.4 to 0.95 in flooded bearings",
)
