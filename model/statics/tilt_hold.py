"""What holds a pad back when it tilts about its pivot: a flexure, a contact that rolls, friction in a sphere's seat.

- A flexure, or a stuck rocker: k_theta of Eq. (12), the same at every load.
- A rocker's contact moves by R_H R_b / (R_H - R_b) per radian (pure rolling of radius R_b in a seat of radius R_H),
  and the pad's load acts there: k_theta = factor W R_H R_b / (R_H - R_b). A sphere on a flat has R_H infinite: W R_b.
- A sphere that slides is held up to a moment M_f = mu W R. Short of that its contact gives way elastically, first by
  Mindlin's tangential stiffness 4 G a / (2 - nu) of two like bodies on the contact radius a of Hertz, k in all, then
  less and less, as it slips from its rim inwards: M = M_f [1 - (1 - t / t_s)^(3/2)], t_s = 3 M_f / (2 k).

All count from the untilted, concentric attitude.

R. D. Mindlin, ASME J. Appl. Mech. 16 (1949) 259; K. L. Johnson, Contact Mechanics (1985), Eq. (4.22), (7.40), (7.42).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.bearing import Pivot
from model.setup import Setup


class TiltHold(NamedTuple):
    """The moment that holds a pad back, and its slopes."""

    moment: float
    stiffness: float
    arm: float
    slides: bool


def tilt_hold(setup: Setup, tilt: float, load: float) -> TiltHold:
    """Moment that holds a pad back at a tilt [rad] and pad load [N]."""
    stiffness, arm = setup.rotational_stiffness, 0.0
    if setup.rolling:
        roll = setup.rolling * rolling_radius(setup.bearing.pivot)
        stiffness += roll * max(load, 0.0)
        arm = roll * tilt if load > 0.0 else 0.0
    moment, slides = stiffness * tilt, False
    if setup.friction and load > 0.0:
        stick, slip = friction_limits(setup, load)
        share = min(abs(tilt) * stick / (1.5 * slip), 1.0)
        held = 1.0 - (1.0 - share) ** 1.5
        slides = share == 1.0
        moment += math.copysign(slip * held, tilt)
        stiffness += stick * math.sqrt(1.0 - share)
        # with the load the limit grows, and by a third of it the contact's stiffness
        arm += math.copysign(slip / load * (held - share * math.sqrt(1.0 - share)), tilt)
    return TiltHold(moment, stiffness, arm, slides)


def rolling_radius(pivot: Pivot) -> float:
    """R_H R_b / (R_H - R_b): how far the contact moves per radian of tilt [m]; zero for a knife edge."""
    if pivot.kind == "rocker":
        seat, back = 0.5 * pivot.housing_diameter, 0.5 * pivot.pivot_diameter
        return seat * back / (seat - back)
    return 0.5 * pivot.sphere_diameter if pivot.kind == "spherical" else 0.0


def friction_limits(setup: Setup, load: float) -> tuple[float, float]:
    """Rotational stiffness of a sphere that does not slide [N m/rad], and the moment at which it does [N m]."""
    pivot = setup.bearing.pivot
    radius, load = 0.5 * pivot.sphere_diameter, max(load, 0.0)
    modulus, ratio = pivot.youngs_modulus, pivot.poissons_ratio
    contact = (1.5 * load * radius * (1.0 - ratio**2) / modulus) ** (1.0 / 3.0)
    shear = 0.5 * modulus / (1.0 + ratio)
    return 4.0 * shear * contact / (2.0 - ratio) * radius**2, setup.friction * load * radius
