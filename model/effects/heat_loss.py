"""`heat_loss`: part of the heat does not stay in the film."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, share: float) -> Setup:
    """A share of the dissipation leaves the film at once, into shaft, pads, churned oil."""
    return setup.change(heat_loss=1.0 - (1.0 - setup.heat_loss) * (1.0 - share))


KIND = EffectKind(
    name="heat_loss",
    side="bearing",
    parameters=(Parameter("share", "1", "ratio", 0.0, 0.0, 0.95, 0.1),),
    apply=apply,
    source="What pads, shaft and drained oil take of a film's heat: 5 to 25 %",
    words=EffectWords(
        finding="pads, shaft and drained oil take {share} of the films' heat",
        physics=(
            "Heat that leaves the film lowers its temperature. Films are cooler and more viscous than an adiabatic one."
        ),
        on_the_rig="Pad temperatures are lower than predicted, stiffness and damping higher.",
        check="pad temperatures over speed and load",
    ),
)
