"""What a user may choose when dry pivot tests become curves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from tpjb_ident.errors import ArgumentError

LAW_NAMES: tuple[str, ...] = ("hertz-line", "hertz-point", "power", "linear", "point-in-series", "bilinear", "spline")


@dataclass(frozen=True)
class PivotSettings:
    """Settings of `fit_pivots`; the defaults suit staircase tests of some seconds to minutes.

    Attributes
    ----------
    laws : tuple of str
        Candidate laws, a subset of `LAW_NAMES`.
    block : float
        Length of the pieces of record that are averaged before fitting [s]; a multiple of the mains period.
    longest_glitch : int
        Longest disturbance that is recognised and dropped [samples].
    load_angle_limit : float
        Largest angle between mean load and pad direction [rad]; beyond it the record is refused.
    displacement_angle_limit : float
        The same for the displacement [rad]. Wider: the shaft is known to slide sideways by some 10-20 %
        of the radial deflection (paper, Fig. 10b).
    angle_warning : float
        Load angle above which the curve carries the status ``load-off-pad`` [rad].
    friction_share, friction_share_se : float
        Share of the load that friction holds back, and its standard error, taken when only one branch
        (loading or unloading) was recorded. With both branches the data themselves decide.
    lag_allowance : float
        Time by which force and displacement may lag each other while the load moves [s]: it enters the
        variance of the pieces on ramps.
    contact_tolerance : float
        Contact counts as complete once the contact loss adds less than this share to the compliance.
    drift_rate : float
        Typical drift of a displacement channel within a run [m/s], centre of a wide prior (factor e, one
        standard deviation) for the drift that the records themselves show.
    bad_hold_limit : float
        A hold is left out when it misses the curve by more than this many standard errors.
    on_refusal : {"raise", "few", "skip"}
        Whether one refused record stops everything, is left out as long as fewer than half of the records are refused
        (more are no accident of single records), or is left out in any case.
    """

    laws: tuple[str, ...] = LAW_NAMES
    block: float = 0.1
    longest_glitch: int = 60
    load_angle_limit: float = math.radians(8.0)
    displacement_angle_limit: float = math.radians(30.0)
    angle_warning: float = math.radians(4.0)
    friction_share: float = 0.003
    friction_share_se: float = 0.003
    lag_allowance: float = 0.002
    contact_tolerance: float = 0.05
    drift_rate: float = 1.0e-8
    bad_hold_limit: float = 5.0
    on_refusal: Literal["raise", "few", "skip"] = "raise"

    def __post_init__(self) -> None:
        unknown = [name for name in self.laws if name not in LAW_NAMES]
        if unknown or not self.laws:
            raise ArgumentError(f"laws must name some of {', '.join(LAW_NAMES)}, got {unknown or 'none'}")
        for name in ("block", "longest_glitch", "lag_allowance", "contact_tolerance", "drift_rate"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")
