"""The printed pivot formulas beside a measured curve."""

from __future__ import annotations

from collections.abc import Callable

from model.bearing import Bearing
from model.pivots import formula_pivot

#: (pad, load [N]) -> (secant, tangent) stiffness [N/m].
Formula = Callable[[int, float], tuple[float, float]]


def printed_formula(bearing: Bearing) -> Formula | None:
    """Kirk and Reedy's formula for a bearing's pivots, Eq. (16) or (17); None if its pivots are rigid."""
    if bearing.pivot.kind == "rigid":
        return None
    printed = formula_pivot(bearing.pivot, secant_vibrations=True)
    return lambda pad, load: (printed.vibration_stiffness(load), printed.stiffness(load))
