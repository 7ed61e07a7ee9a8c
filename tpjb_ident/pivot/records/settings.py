"""What a user may choose when dry pivot tests become curves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from tpjb_ident.errors import ArgumentError

LAW_NAMES: tuple[str, ...] = ("hertz-line", "hertz-point", "power", "linear", "point-in-series", "bilinear", "spline")


@dataclass(frozen=True)
class PivotSettings:
    """Settings of `fit_pivots`; the defaults suit staircase tests of some seconds to minutes."""

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
