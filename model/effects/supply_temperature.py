"""`supply_temperature`: the oil enters hotter than the record says."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, change: float) -> Setup:
    """Supply temperature plus change."""
    return setup.change(supply_change=setup.supply_change + change)


KIND = EffectKind(
    name="supply_temperature",
    side="bearing",
    parameters=(Parameter("change", "K", "temperature difference", 0.0, -30.0, 60.0, 3.0),),
    apply=apply,
    source="A sensor in the pipe, not at the pads",
    words=EffectWords(
        finding="the oil arrives {change:size} {change:warmer|colder} than stated",
        physics="A warmer supply makes a thinner film. All pad temperatures move along.",
        on_the_rig="All pad temperatures are off by about the same amount.",
        check="where the supply sensor sits",
    ),
)
