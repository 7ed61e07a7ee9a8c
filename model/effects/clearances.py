"""Pads, shaft and housing that stand otherwise than drawn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from model.effects.kind import DIRECTION, PAD, EffectWords, Parameter, effect_on
from model.setup import Setup


@effect_on(
    "bearing",
    PAD,
    Parameter("radial_offset", "m", "length", 0.0, -6e-05, 6e-05, 1e-05),
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
def pad_offset(setup: Setup, pad: int, radial_offset: float) -> Setup:
    """The assembled clearance of one pad is Cb + radial_offset."""
    pads = list(setup.bearing.pads)
    nominal = pads[pad - 1]
    pads[pad - 1] = replace(nominal, assembled_clearance=nominal.assembled_clearance + radial_offset)
    return setup.change(bearing=setup.bearing.with_pads(tuple(pads)))


@effect_on(
    "bearing",
    source="Machining of pads and seats holds a few micrometres from pad to pad",
    per_pad=Parameter("offset", "m", "length", 0.0, -6e-05, 6e-05, 2.5e-06),
    words=EffectWords(
        finding="the pads stand unevenly: {offset}",
        physics=(
            "Machining of pads and seats leaves each pad at its own assembled clearance. The load shares itself out "
            "anew among them."
        ),
        on_the_rig="The clearance polygon is irregular; coefficients part where the load turns.",
        check="the clearance sweep, pad by pad",
    ),
)
def uneven_pads(setup: Setup, **offsets: float) -> Setup:
    """Cb of pad k plus offset_k, less the part of all offsets that only shifts the bearing as a whole.

    Offsets ``n_k . s`` of the pads at n_k move the bearing by s, and the journal with it: no test tells them from a
    bearing centre that is elsewhere, since positions count from the bearing centre. That part is taken out (least
    squares), so that offsets which differ by a shift are one and the same effect.
    """
    pads = setup.bearing.pads
    clearances = np.array([offsets[f"offset_{k}"] for k in range(1, len(pads) + 1)])
    normals = np.array([[math.cos(p.pivot_angle), math.sin(p.pivot_angle)] for p in pads])
    without_shift = clearances - normals @ np.linalg.lstsq(normals, clearances, rcond=None)[0]
    return setup.change_pads(
        lambda number, pad: replace(pad, assembled_clearance=pad.assembled_clearance + float(without_shift[number - 1]))
    )


@effect_on(
    "bearing",
    Parameter("pad_clearance_change", "m", "length", 0.0, -0.0001, 0.0002, 1.2e-05),
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
def preload_error(setup: Setup, pad_clearance_change: float) -> Setup:
    """Cp of every pad changes by this; Cb stays."""
    return setup.change_pads(lambda number, pad: replace(pad, pad_clearance=pad.pad_clearance + pad_clearance_change))


@effect_on(
    "bearing",
    Parameter("clearance_change", "m", "length", 0.0, -6e-05, 6e-05, 8e-06),
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
def thermal_growth(setup: Setup, clearance_change: float) -> Setup:
    """Cb of every pad changes by this in running conditions; dry tests are cold."""
    return setup.change(clearance_change=setup.clearance_change + clearance_change)


@effect_on(
    "bearing",
    Parameter("angle", "rad", "angle", 0.0, 0.0, 0.002, 0.0003, "square"),
    DIRECTION,
    source="Half the clearance over half the length is 1e-3 rad",
    words=EffectWords(
        finding="the shaft is tilted by {angle:mm/m} towards {direction:°}",
        physics=(
            "The shaft axis is tilted in the bearing, so the film is thinner at one end. Stiffness rises, most across "
            "the loaded pad."
        ),
        on_the_rig="Probes at the two ends read differently; the pads wear at one edge.",
        check="the alignment of shaft and housing under load",
    ),
)
def misalignment(setup: Setup, angle: float, direction: float) -> Setup:
    """The shaft axis is tilted by angle towards direction, about mid-bearing; pads do not follow."""
    return setup.change(misalignment=(angle, direction))
