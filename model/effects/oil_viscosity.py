"""`oil_viscosity`: the oil is thinner or thicker than its grade."""

from __future__ import annotations

from dataclasses import replace

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, factor: float) -> Setup:
    """mu_40 times factor."""
    oil = replace(setup.bearing.oil, viscosity_40=setup.bearing.oil.viscosity_40 * factor)
    return setup.change(bearing=replace(setup.bearing, oil=oil))


KIND = EffectKind(
    name="oil_viscosity",
    side="bearing",
    parameters=(Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.1),),
    apply=apply,
    source="ISO 3448: +-10 % within a viscosity grade",
    words=EffectWords(
        finding="the oil is {factor:size} {factor:thicker|thinner} than stated",
        physics="Stiffness and damping of the film grow with the viscosity. Pad temperatures change with it.",
        on_the_rig="All coefficients are off alike, damping most.",
        check="a sample of the oil, and its temperature at the pads",
    ),
)
