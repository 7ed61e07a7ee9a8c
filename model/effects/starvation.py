"""`starvation`: films start late for want of oil."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, arc_fraction: float) -> Setup:
    """Every film starts after this fraction of the arc from the leading edge."""
    return setup.change(starvation=arc_fraction)


KIND = EffectKind(
    name="starvation",
    side="bearing",
    parameters=(Parameter("arc_fraction", "1", "ratio", 0.0, 0.0, 0.6, 0.1),),
    apply=apply,
    source="He, Allaire 2002: leading-edge starvation of 10 to 40 % at low flow",
    words=EffectWords(
        finding="the film is missing over the first {arc_fraction} of the pads",
        physics="Too little oil reaches the leading edge. The film begins late, so it carries and damps less.",
        on_the_rig="Damping falls with speed; unloaded pads flutter.",
        check="oil flow and nozzles",
    ),
)
