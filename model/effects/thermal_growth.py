"""`thermal_growth`: housing and shaft grow by different amounts when running."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, clearance_change: float) -> Setup:
    """Cb of every pad changes by this in running conditions; dry tests are cold."""
    return setup.change(clearance_change=setup.clearance_change + clearance_change)


KIND = EffectKind(
    name="thermal_growth",
    side="bearing",
    parameters=(Parameter("clearance_change", "m", "length", 0.0, -6e-05, 6e-05, 8e-06),),
    apply=apply,
    source="12e-6 1/K x 66 mm x 8 K = 6 um if only the housing heats",
    words=EffectWords(
        finding="the running clearance is {clearance_change:size} {clearance_change:larger|smaller} than cold",
        physics=(
            "Housing, pads and shaft warm up unequally, and the clearance follows. A larger clearance softens the "
            "film and lets the shaft sink deeper."
        ),
        on_the_rig="The cold clearance sweep agrees with the drawing, the running locus does not.",
        check="temperatures of housing and shaft; a hot clearance sweep right after a run",
    ),
)
