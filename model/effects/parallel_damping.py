"""`parallel_damping`: a damping beside the bearing (hoses, a seal), for what no other effect describes."""

from __future__ import annotations

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, xx: float, xy: float, yx: float, yy: float) -> Setup:
    """A constant damping that adds to what the records show, in dynamic tests only."""
    before = setup.parallel_damping
    return setup.change(parallel_damping=(before[0] + xx, before[1] + xy, before[2] + yx, before[3] + yy))


KIND = EffectKind(
    name="parallel_damping",
    side="structure",
    parameters=tuple(
        Parameter(entry, "N s/m", "damping", 0.0, -1e09, 1e09, 1e05) for entry in ("xx", "xy", "yx", "yy")
    ),
    apply=apply,
    source="Generic: whatever adds a constant damping to the records; a tenth of a bearing's own",
    words=EffectWords(
        finding="something beside the film adds a damping: xx {xx}, xy {xy}, yx {yx}, yy {yy}",
        physics=(
            "A generic term: a constant damping that the records hold besides the film's, for what no named effect "
            "describes."
        ),
        on_the_rig="The same damping is off at every load; stiffness agrees.",
        check="hoses, seals and dampers across the film; shake the rig dry",
    ),
)
