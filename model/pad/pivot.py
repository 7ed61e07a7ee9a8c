"""Formulas of pivots on rows of numbers: the same for laws in Python and for compiled searches.

A row holds which formula it is, its constants, and last the factor on the stiffness. K of Eq. (16) and (17) is a secant
W / delta; of a measured curve `curve` (5, m) holds the loads and the coefficients of the cubics from each on.
"""

import math

from model.compilation import inner
from model.interpolation import row_below
from rigdata.arrays import FloatArray

#: Which formula; of a law known to Python only, `OTHER`, the row holds deflection and compliance as last asked for.
CONSTANT, ROCKER, SPHERICAL, MEASURED, OTHER = range(5)


@inner
def deflection(law: FloatArray, curve: FloatArray, load: float) -> float:
    """Give of a pivot, delta(W) [m]: `law` (4,), `curve` (5, m)."""
    if law[0] == OTHER:
        return law[1]
    if not load > 0.0:
        return 0.0
    if law[0] == CONSTANT:
        delta = load / law[1]
    elif law[0] == ROCKER:
        delta = load * (2.0 / 3.0 + _logarithm(law[2], load)) / law[1]
    elif law[0] == SPHERICAL:
        delta = law[1] * load ** (2.0 / 3.0)
    else:
        end = curve[0, int(law[1]) - 1]
        i, s = _piece(law, curve, min(load, end))
        delta = ((curve[1, i] * s + curve[2, i]) * s + curve[3, i]) * s + curve[4, i]
        if load > end:
            delta += (load - end) * _measured_compliance(law, curve, end)
    return delta / law[3]


@inner
def compliance(law: FloatArray, curve: FloatArray, load: float) -> float:
    """Tangent d delta / dW [m/N]; zero for a rigid pivot."""
    if law[0] == OTHER:
        return law[2]
    if law[0] == CONSTANT:
        value = 1.0 / law[1]
    elif law[0] == ROCKER:
        value = (_logarithm(law[2], load) - 1.0 / 3.0) / law[1]
    elif law[0] == SPHERICAL:
        value = law[1] / (1.5 * max(load, 1e-9) ** (1.0 / 3.0))
    else:
        value = _measured_compliance(law, curve, load)
    return value / law[3]


@inner
def _logarithm(load_scale: float, load: float) -> float:
    return math.log(load_scale / min(max(load, 1e-9), load_scale / math.e))


@inner
def _piece(law: FloatArray, curve: FloatArray, load: float) -> tuple[int, float]:
    low = row_below(curve[0], int(law[1]), load)
    return low, load - curve[0, low]


@inner
def _measured_compliance(law: FloatArray, curve: FloatArray, load: float) -> float:
    i, s = _piece(law, curve, min(max(load, 0.0), curve[0, int(law[1]) - 1]))
    return max((3.0 * curve[1, i] * s + 2.0 * curve[2, i]) * s + curve[3, i], 1e-15)
