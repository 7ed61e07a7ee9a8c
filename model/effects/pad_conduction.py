"""`pad_conduction`: the film's heat passes into pads and journal, and from the pads' backs to the oil."""

from __future__ import annotations

from dataclasses import replace

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, back_convection: float) -> Setup:
    """Switch on the heat paths into pads and journal, the pads' free faces with this film coefficient.

    Zero is the baseline: adiabatic. The journal, and pads that pass heat from hot places of the film to cold ones,
    come with the first watt, so that the effect starts with a small step.
    """
    if back_convection == 0.0:
        return setup
    options = replace(setup.options, conduction=True, isothermal_journal=True)
    return setup.change_pads(lambda number, pad: replace(pad, back_convection=back_convection)).change(options=options)


KIND = EffectKind(
    name="pad_conduction",
    side="bearing",
    parameters=(Parameter("back_convection", "W/m^2/K", "heat transfer", 0.0, 0.0, 10000.0, 100.0),),
    apply=apply,
    source="Pad backs in oil: 25 to 500 W/m^2/K, more where they are sprayed",
    words=EffectWords(
        finding="the pads' backs lose heat with {back_convection:0} W/m²/K",
        physics="Pads conduct the film's heat to the oil around them. The film's temperature evens out along the pad.",
        on_the_rig="Pad temperatures are lower and flatter than predicted.",
        check="the oil around the pads, and sprays on their backs",
    ),
)
