"""`pivot_damping`: the pivots damp radial motion."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, damping: float) -> Setup:
    """c_eta of Eq. (12)."""
    return setup.change(pivot_damping=setup.pivot_damping + damping)


KIND = EffectKind(
    name="pivot_damping",
    side="bearing",
    parameters=(Parameter("damping", "N s/m", "damping", 0.0, 0.0, 100000000.0, 300000.0),),
    apply=apply,
    source="Loss factor 0.05 to 0.2 of the pivot stiffness at 25 Hz",
    words=EffectWords(
        finding="every pivot damps with {damping}",
        physics="Friction in the pivots takes energy beside the film. It acts in series with it.",
        on_the_rig="The dry tests show a loop between loading and unloading; damping is too high.",
        check="wear and lubrication of the pivots",
    ),
)
