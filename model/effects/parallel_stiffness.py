"""`parallel_stiffness`: a stiffness beside the bearing (leaf springs, a seal), for what no other effect describes."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant stiffness that adds to what the records show, in dynamic tests only."""
    before = setup.parallel_stiffness
    return setup.change(parallel_stiffness=(before[0] + xx, before[1] + xy, before[2] + yx, before[3] + yy))


KIND = EffectKind(
    name="parallel_stiffness",
    side="structure",
    parameters=tuple(
        Parameter(entry, "N/m", "stiffness", 0.0, -1e10, 1e10, 2e07) for entry in ("xx", "xy", "yx", "yy")
    ),
    apply=apply,
    source="Generic: whatever adds a constant stiffness to the records; a tenth of a bearing's own",
    words=EffectWords(
        finding="something beside the film adds a stiffness: xx {xx}, xy {xy}, yx {yx}, yy {yy}",
        physics=(
            "A generic term: a constant stiffness that the records hold besides the film's, for what no named effect "
            "describes."
        ),
        on_the_rig="The same amount is off at every load and frequency; shaft positions do not show it.",
        check="hoses, seals and leaf springs across the film; shake the rig dry",
    ),
)
