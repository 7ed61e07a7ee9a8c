"""The mirror at the model's door: films are solved for a shaft that turns counter-clockwise.

A shaft that turns clockwise is, seen in a mirror along the y axis, one that turns counter-clockwise: x becomes -x, an
angle pi minus itself, the entries xy and yx change their sign. Pads keep their numbers. A pivot's offset counts from
the edge where the shaft comes from, so the mirror leaves it; it changes where the shaft turns against the sense that
the bearing file states.
"""

import math
from dataclasses import replace

import numpy as np

from model.bearing import ROTATIONS, Bearing, BearingError
from model.setup import Setup

#: x becomes -x.
MIRROR = np.diag([-1.0, 1.0])


def rotation_of(speed: float) -> str:
    """Sense of a shaft speed about +z: negative is clockwise."""
    return ROTATIONS[int(speed < 0.0)]


def runs_backward(bearing: Bearing, speed: float) -> bool:
    """Whether a shaft speed about +z goes against the sense in which a bearing's leading edges are stated."""
    return bearing.rotation not in ("", rotation_of(speed))


def as_it_turns(bearing: Bearing, rotations: set[str], usual: str = "") -> Bearing:
    """State the sense that a bearing's leading edges belong to: its file's, else the one in which its shaft turns.

    Where that turns both ways, `usual` serves pads that are the same from either edge; others are refused.
    """
    senses = {bearing.rotation} if bearing.rotation else rotations
    if len(senses) > 1 and any(pad.pivot_offset != 0.5 for pad in bearing.pads):
        raise BearingError(
            f"{bearing.name}, [bearing] rotation: the shaft turns both ways, and pivot_offset counts from the edge "
            f"that leads in one of them. Write rotation = {' or '.join(map(repr, ROTATIONS))}."
        )
    return replace(bearing, rotation=min(senses) if len(senses) == 1 else usual)


def seen_by_shaft(setup: Setup, speed: float) -> Setup:
    """The set-up in the frame where a shaft of this speed about +z turns counter-clockwise."""
    if runs_backward(setup.bearing, speed):
        turned = setup.change_pads(lambda k, pad: replace(pad, pivot_offset=1.0 - pad.pivot_offset))
        setup = turned.change(bearing=replace(turned.bearing, rotation=rotation_of(speed)))
    return mirrored(setup) if speed < 0.0 else setup


def mirrored(setup: Setup) -> Setup:
    """The bearing and the structure around it as the mirror shows them; instruments stay as they are."""
    turned = setup.change_pads(lambda k, pad: replace(pad, pivot_angle=math.pi - pad.pivot_angle))
    sense = turned.bearing.rotation
    opposite = sense and ROTATIONS[sense == ROTATIONS[0]]
    angle, towards = setup.misalignment
    xx, xy, yy = setup.series_compliance
    return turned.change(
        bearing=replace(turned.bearing, rotation=opposite),
        mirrored=not setup.mirrored,
        misalignment=(angle, math.pi - towards),
        series_compliance=(xx, -xy, yy),
        parallel_stiffness=_mirrored_entries(setup.parallel_stiffness),
        parallel_damping=_mirrored_entries(setup.parallel_damping),
    )


def _mirrored_entries(entries: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xx, xy, yx, yy = entries
    return xx, -xy, -yx, yy
