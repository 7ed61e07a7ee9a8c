"""Pads, shaft and housing that stand otherwise than drawn."""

from dataclasses import replace

import numpy as np

from model.bearing import Pad
from model.effects.kind import DIRECTION, PAD, Parameter, effect_on
from model.setup import Setup

_BORE = Parameter("pad_clearance_change", "m", "length", 0.0, -0.0001, 0.0002, 1.2e-05)
_BORING = "Boring tolerance of a pad of 100 mm: IT6 to IT7"


def _moved(setup: Setup, name: str, change: float, number: int | None = None) -> Setup:
    """Change a number of every pad, or of one."""

    def moved(k: int, pad: Pad) -> Pad:
        return replace(pad, **{name: getattr(pad, name) + change}) if number in (None, k) else pad

    return setup.change_pads(moved)


@effect_on(
    "bearing",
    PAD,
    Parameter("radial_offset", "m", "length", 0.0, -6e-05, 6e-05, 1e-05),
    source="Machining tolerance; the paper explains an irregular clearance polygon so (Fig. 14)",
    finding="{pad} stands {radial_offset:size} too far {radial_offset:out|in}",
    physics="One pad's assembled clearance is not as drawn, so the load shares itself out anew among the pads.",
    on_the_rig="One side of the clearance polygon stands off; kxx and kyy part when the load turns.",
    check="the pad's seat and shims, and the clearance sweep",
)
def pad_offset(setup: Setup, pad: int, radial_offset: float) -> Setup:
    """The assembled clearance of one pad is Cb + radial_offset."""
    return _moved(setup, "assembled_clearance", radial_offset, pad)


@effect_on(
    "bearing",
    source="Machining of pads and seats holds a few micrometres from pad to pad",
    per_pad=Parameter("offset", "m", "length", 0.0, -6e-05, 6e-05, 2.5e-06),
    finding="the pads stand unevenly: {offset}",
    physics="Machining leaves each pad at its own assembled clearance. The load shares itself out anew among them.",
    on_the_rig="The clearance polygon is irregular; coefficients part where the load turns.",
    check="the clearance sweep, pad by pad",
)
def uneven_pads(setup: Setup, **offsets: float) -> Setup:
    """Cb of pad k plus offset_k, less the part of all offsets that only shifts the bearing as a whole.

    Offsets ``n_k . s`` of the pads at n_k move the bearing by s, and the journal with it: no test tells them from a
    bearing centre that is elsewhere, since positions count from the bearing centre. That part is taken out (least
    squares), so that offsets which differ by a shift are one and the same effect.
    """
    pads = setup.bearing.pads
    clearances = np.array([offsets[f"offset_{k}"] for k in range(1, len(pads) + 1)])
    normals = np.array([pad.normal for pad in pads])
    without_shift = clearances - normals @ np.linalg.lstsq(normals, clearances, rcond=None)[0]
    for number, change in enumerate(without_shift.tolist(), start=1):
        setup = _moved(setup, "assembled_clearance", change, number)
    return setup


@effect_on(
    "bearing",
    _BORE,
    source=_BORING,
    finding="the pads are bored {pad_clearance_change:size} {pad_clearance_change:wider|tighter} than drawn",
    physics="The pads' radius and so the preload differ from the drawing: the film converges more or less strongly.",
    on_the_rig="The clearance polygon agrees with the drawing; stiffness is off in both directions, most at low load.",
    check="the bore of the pads",
)
def preload_error(setup: Setup, pad_clearance_change: float) -> Setup:
    """Cp of every pad changes by this; Cb stays."""
    return _moved(setup, "pad_clearance", pad_clearance_change)


@effect_on(
    "bearing",
    PAD,
    _BORE,
    source=_BORING,
    finding="{pad} is bored {pad_clearance_change:size} {pad_clearance_change:wider|tighter} than drawn",
    physics="One pad has another radius, so another preload. Its film converges more or less than the others'.",
    on_the_rig="The clearance polygon agrees with the drawing; coefficients are off along that pad's direction.",
    check="the bore of that pad, and whether it belongs to this set",
)
def pad_bore(setup: Setup, pad: int, pad_clearance_change: float) -> Setup:
    """Cp of one pad changes by this; Cb stays."""
    return _moved(setup, "pad_clearance", pad_clearance_change, pad)


@effect_on(
    "bearing",
    Parameter("assembled_clearance_change", "m", "length", 0.0, -0.0002, 0.0005, 8e-06),
    source="Drawings state clearances as radius or as diameter; shims and seats move them by some micrometres",
    finding=(
        "the assembled clearance is {assembled_clearance_change:size} {assembled_clearance_change:larger|smaller} "
        "than the bearing file says, cold already"
    ),
    physics="Every pad stands further out or in than drawn, so film thickness and preload differ at all loads.",
    on_the_rig="The cold clearance polygon is larger or smaller than the drawing, and so is the running locus.",
    check="the bearing file against the drawing: radius or diameter; then the clearance sweep",
)
def clearance_error(setup: Setup, assembled_clearance_change: float) -> Setup:
    """Cb of every pad changes by this, cold and running."""
    return _moved(setup, "assembled_clearance", assembled_clearance_change)


@effect_on(
    "bearing",
    Parameter("offset_change", "1", "ratio", 0.0, -0.25, 0.25, 0.05),
    source="Central pivots are at 0.5, offset ones at 0.55 to 0.65 of the arc",
    finding="the pivots sit {offset_change:size} of the arc {offset_change:behind|before} their place in the file",
    physics="An offset pivot lets the pad tilt further open. Films are thicker at the same load and run cooler.",
    on_the_rig="Stiffness, eccentricity and temperatures differ alike on all pads, and with the sense of rotation.",
    check="the bearing file's pivot_offset against the drawing: central or offset, and from which edge",
)
def pivot_offset_error(setup: Setup, offset_change: float) -> Setup:
    """The pivots are this share of the arc further from the leading edge than the bearing file says."""
    return _moved(setup, "pivot_offset", offset_change)


@effect_on(
    "bearing",
    Parameter("factor", "1", "ratio", 1.0, 0.5, 1.5, 0.05),
    source="Chamfers and pockets at the edges of a pad take 1 to 5 % of its arc",
    finding="the pads' arcs are {factor:size} {factor:longer|shorter} than the bearing file says",
    physics="A film that begins later or ends earlier carries less. Every pad is off alike, the loaded ones most.",
    on_the_rig="Clearances agree with the drawing; stiffness and damping are off alike at all loads.",
    check="the pads' length along the shaft's surface against the drawing, chamfers and pockets taken off",
)
def pad_arc_error(setup: Setup, factor: float) -> Setup:
    """The arc of every pad times factor, its pivot at the same share of it."""
    return setup.change_pads(lambda number, pad: replace(pad, arc=pad.arc * factor))


@effect_on(
    "bearing",
    Parameter("factor", "1", "ratio", 1.0, 0.5, 1.5, 0.05),
    source="Chamfers at the ends of a pad take 1 to 3 % of its length",
    finding="the pads are {factor:size} {factor:longer|shorter} along the shaft than the bearing file says",
    physics="A shorter film leaks more at its ends and carries less. Every pad is off alike, the loaded ones most.",
    on_the_rig="Clearances agree with the drawing; stiffness and damping are off alike at all loads.",
    check="the pads' length along the shaft's axis against the drawing, chamfers taken off",
)
def pad_length_error(setup: Setup, factor: float) -> Setup:
    """The axial length of all pads times factor."""
    return setup.change(bearing=replace(setup.bearing, length=setup.bearing.length * factor))


@effect_on(
    "bearing",
    PAD,
    Parameter("angle_change", "rad", "angle", 0.0, -0.2, 0.2, 0.02),
    source="Seats and pins are bored to 0.1 to 0.5 deg; a wrong pitch in a file is some degrees",
    finding="{pad} sits {angle_change:size} {angle_change:after|before} its angle in the bearing file",
    physics="One pad stands at another angle, so the load shares itself out anew among the pads.",
    on_the_rig="One side of the clearance polygon is turned; cross-coupled coefficients are off.",
    check="the pad's angle in the bearing file against the drawing, and its seat",
)
def pivot_angle_error(setup: Setup, pad: int, angle_change: float) -> Setup:
    """One pad, its pivot with it, stands at this much more than its angle, counter-clockwise."""
    return _moved(setup, "pivot_angle", angle_change, pad)


@effect_on(
    "bearing",
    Parameter("clearance_change", "m", "length", 0.0, -6e-05, 6e-05, 8e-06),
    source="12e-6 1/K x 66 mm x 8 K = 6 um if only the housing heats",
    finding="the running clearance is {clearance_change:size} {clearance_change:larger|smaller} than cold",
    physics="Housing, pads and shaft warm up unequally. A larger clearance softens the film; the shaft sinks deeper.",
    on_the_rig="The cold clearance sweep agrees with the drawing, the running locus does not.",
    check="temperatures of housing and shaft; a hot clearance sweep right after a run",
)
def thermal_growth(setup: Setup, clearance_change: float) -> Setup:
    """Cb of every pad changes by this in running conditions; dry tests are cold."""
    return setup.change(clearance_change=setup.clearance_change + clearance_change)


@effect_on(
    "bearing",
    Parameter("angle", "rad", "angle", 0.0, 0.0, 0.002, 0.0003, "square"),
    DIRECTION,
    source="Half the clearance over half the length is 1e-3 rad",
    finding="the shaft is tilted by {angle:mm/m} towards {direction:°}",
    physics="The shaft is tilted, so the film is thinner at one end. Stiffness rises, most across the loaded pad.",
    on_the_rig="Probes at the two ends read differently; the pads wear at one edge.",
    check="the alignment of shaft and housing under load",
)
def misalignment(setup: Setup, angle: float, direction: float) -> Setup:
    """The shaft axis is tilted by angle towards direction, about mid-bearing; pads do not follow."""
    return setup.change(misalignment=(angle, direction))
