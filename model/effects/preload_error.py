"""`preload_error`: the pads are bored to another radius."""

from __future__ import annotations

from dataclasses import replace

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, pad_clearance_change: float) -> Setup:
    """Cp of every pad changes by this; Cb stays."""
    return setup.change_pads(lambda number, pad: replace(pad, pad_clearance=pad.pad_clearance + pad_clearance_change))


KIND = EffectKind(
    name="preload_error",
    side="bearing",
    parameters=(Parameter("pad_clearance_change", "m", "length", 0.0, -0.0001, 0.0002, 1.2e-05),),
    apply=apply,
    source="Boring tolerance of a pad of 100 mm: IT6 to IT7",
    words=EffectWords(
        finding="the pads are bored {pad_clearance_change:size} {pad_clearance_change:wider|tighter} than drawn",
        physics=(
            "The pads' own radius differs from the drawing, so the preload does. The film converges more or less "
            "strongly at the same assembled clearance."
        ),
        on_the_rig=(
            "The clearance polygon agrees with the drawing; stiffness is off alike in both directions, most at low "
            "load."
        ),
        check="the bore of the pads",
    ),
)
