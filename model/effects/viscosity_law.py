"""`viscosity_law`: the oil thins faster or slower with temperature than stated."""

from __future__ import annotations

import math
from dataclasses import replace

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """The exponent kappa of mu(T) times factor; mu at the stated supply temperature stays."""
    oil = setup.bearing.oil
    exponent = oil.viscosity_exponent * factor
    viscosity = oil.viscosity_40 * math.exp((oil.viscosity_exponent - exponent) * (40.0 - oil.supply_temperature))
    changed = replace(oil, viscosity_40=viscosity, viscosity_exponent=exponent)
    return setup.change(bearing=replace(setup.bearing, oil=changed))


KIND = EffectKind(
    name="viscosity_law",
    side="bearing",
    parameters=(Parameter("factor", "1", "ratio", 1.0, 0.2, 3.0, 0.1),),
    apply=apply,
    source="An exponential through two points of a data sheet: 5 to 15 % by the points chosen and the viscosity index",
    words=EffectWords(
        finding="the oil's viscosity falls {factor:size} {factor:faster|more slowly} with temperature than stated",
        physics=(
            "The viscosity at film temperature differs from what two points of a data sheet give. Hot films are then "
            "thinner or thicker than computed."
        ),
        on_the_rig="Coefficients agree when cool and part as the films warm up.",
        check="the oil's viscosity at 40 and 100 °C",
    ),
)
