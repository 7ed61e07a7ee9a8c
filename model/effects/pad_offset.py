"""`pad_offset`: one pivot stands further out or in."""

from __future__ import annotations

from dataclasses import replace

from model.effects.kind import PAD, EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, pad: int, radial_offset: float) -> Setup:
    """The assembled clearance of one pad is Cb + radial_offset."""
    pads = list(setup.bearing.pads)
    nominal = pads[pad - 1]
    pads[pad - 1] = replace(nominal, assembled_clearance=nominal.assembled_clearance + radial_offset)
    return setup.change(bearing=setup.bearing.with_pads(tuple(pads)))


KIND = EffectKind(
    name="pad_offset",
    side="bearing",
    parameters=(
        PAD,
        Parameter("radial_offset", "m", "length", 0.0, -6e-05, 6e-05, 1e-05),
    ),
    apply=apply,
    source="Machining tolerance; the paper explains an irregular clearance polygon so (Fig. 14)",
    words=EffectWords(
        finding="{pad} stands {radial_offset:size} too far {radial_offset:out|in}",
        physics=(
            "The assembled clearance of one pad differs from the drawing. Its film is thicker or thinner than the "
            "others', so the load shares itself out anew among the pads."
        ),
        on_the_rig="One side of the clearance polygon stands off; kxx and kyy part when the load turns.",
        check="the pad's seat and shims, and the clearance sweep",
    ),
)
