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

from typing import NamedTuple

import numpy as np

from model.bearing import Pivot
from model.compilation import inner
from model.setup import Setup


class TiltHold(NamedTuple):
    """The moment that holds a pad back, and its slopes."""

    moment: float
    stiffness: float
    arm: float


class HoldNumbers(NamedTuple):
    """What holds the tilt of every pad of a set-up."""

    flexure: float  #: k_theta [N m/rad]
    roll: float  #: k_theta per load [m/rad]
    slip: float  #: M_f per load [m]
    stick: float  #: k per cubic root of the load [N^(2/3) m/rad]


@inner
def held_moment(hold: HoldNumbers, tilt: float, load: float) -> TiltHold:
    """What holds at a tilt [rad] and pad load [N]."""
    stiffness, arm = hold.flexure, 0.0
    if load > 0.0:
        stiffness += hold.roll * load
        arm = hold.roll * tilt
    moment = stiffness * tilt
    if hold.slip > 0.0 and load > 0.0:
        stick, slip = hold.stick * load ** (1.0 / 3.0), hold.slip * load
        share = min(abs(tilt) * stick / (1.5 * slip), 1.0)
        held = 1.0 - (1.0 - share) ** 1.5
        moment += np.copysign(slip * held, tilt)
        stiffness += stick * np.sqrt(1.0 - share)
        # with the load the limit grows, and by a third of it the contact's stiffness
        arm += np.copysign(slip / load * (held - share * np.sqrt(1.0 - share)), tilt)
    return TiltHold(moment, stiffness, arm)


def hold_numbers(setup: Setup) -> HoldNumbers:
    """What holds the tilt of the pads."""
    roll = setup.rolling * rolling_radius(setup.bearing.pivot) if setup.rolling else 0.0
    stick, slip = friction_limits(setup, 1.0) if setup.friction else (0.0, 0.0)
    return HoldNumbers(float(setup.rotational_stiffness), roll, slip, stick)


def rolling_radius(pivot: Pivot) -> float:
    """R_H R_b / (R_H - R_b): how far the contact moves per radian of tilt [m]; zero for a knife edge."""
    if pivot.kind == "rocker":
        seat = 0.5 * pivot.housing_diameter
        back = 0.5 * pivot.pivot_diameter
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
