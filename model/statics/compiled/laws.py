"""Pivot laws as numbers, so that a compiled search can ask them: the formulas are those of `model.pivots`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from model.compilation import inner
from model.interpolation import row_below
from model.measured_pivot import MeasuredPivot
from model.pivots import ConstantPivot, PivotLaw, RigidPivot, RockerPivot, ScaledPivot, SphericalPivot
from rigdata.arrays import FloatArray

#: First number of a law's row: which formula; the others are its constants, the last the factor on the stiffness.
_RIGID, _CONSTANT, _ROCKER, _SPHERICAL, _MEASURED, OTHER = range(6)


def encoded(laws: Sequence[PivotLaw]) -> tuple[FloatArray, FloatArray]:
    """Laws as rows of numbers, (n, 4), and the measured curves among them, (n, 5, m).

    The row of a law that is unknown here, `OTHER`, holds its deflection and compliance at the load it was asked for.
    """
    try:
        rows, curves = _encoded(tuple(laws))
    except TypeError:  # a law of somebody's own that has no hash
        rows, curves = _encoded.__wrapped__(tuple(laws))
    return rows.copy(), curves


def ask_laws(laws: Sequence[PivotLaw], rows: FloatArray, loads: FloatArray) -> None:
    """Ask the laws that are unknown here: `rows` (n, 4), `loads` (n,) [N]."""
    for law, row, load in zip(laws, rows, loads.tolist(), strict=True):
        if row[0] == OTHER:
            # a Hertzian pivot has no stiffness at zero
            row[1], row[2] = law.deflection(max(load, 0.0)), 1.0 / law.stiffness(max(load, 1e-6))


@lru_cache(maxsize=256)
def _encoded(laws: tuple[PivotLaw, ...]) -> tuple[FloatArray, FloatArray]:
    rows, curves = [], []
    for law in laws:
        row, curve = _row(law)
        rows.append(row)
        curves.append(curve)
    longest = max(c.shape[1] for c in curves)
    table = np.zeros((len(laws), 5, longest))
    for own, curve in zip(table, curves, strict=True):
        own[:, : curve.shape[1]] = curve
    return np.array(rows, dtype=float), table


def _row(given: PivotLaw) -> tuple[tuple[float, float, float, float], FloatArray]:
    nothing = np.zeros((5, 1))
    factor, law = 1.0, given
    while type(law) is ScaledPivot:
        factor *= law.stiffness_factor
        law = law.law
    if type(law) is RigidPivot:
        return (_RIGID, 0.0, 0.0, factor), nothing
    if type(law) is ConstantPivot:
        return (_CONSTANT, law.value, 0.0, factor), nothing
    if type(law) is RockerPivot:
        return (_ROCKER, law.line_modulus, law.load_scale, factor), nothing
    if type(law) is SphericalPivot:
        return (_SPHERICAL, law.compliance, 0.0, factor), nothing
    if type(law) is MeasuredPivot:
        curve = np.zeros((5, len(law.load)))
        curve[0], curve[1:, :-1] = law.load, law.coefficients
        return (_MEASURED, len(law.load), 0.0, factor), curve
    return (OTHER, 0.0, 0.0, 1.0), nothing


@inner
def deflection(law: FloatArray, curve: FloatArray, load: float) -> float:
    """Give of a pivot, delta(W) [m]: `law` (4,), `curve` (5, m)."""
    if law[0] == OTHER:
        return law[1]
    if not load > 0.0 or law[0] == _RIGID:
        return 0.0
    if law[0] == _CONSTANT:
        give = load / law[1]
    elif law[0] == _ROCKER:
        give = load * (2.0 / 3.0 + _logarithm(law[2], load)) / law[1]
    elif law[0] == _SPHERICAL:
        give = law[1] * load ** (2.0 / 3.0)
    else:
        end = curve[0, int(law[1]) - 1]
        i, s = _piece(law, curve, min(load, end))
        give = ((curve[1, i] * s + curve[2, i]) * s + curve[3, i]) * s + curve[4, i]
        if load > end:
            give += (load - end) * _measured_compliance(law, curve, end)
    return give / law[3]


@inner
def compliance(law: FloatArray, curve: FloatArray, load: float) -> float:
    """Tangent d delta / dW [m/N]; zero for a rigid pivot."""
    if law[0] == OTHER:
        return law[2]
    if law[0] == _RIGID:
        return 0.0
    if law[0] == _CONSTANT:
        value = 1.0 / law[1]
    elif law[0] == _ROCKER:
        value = (_logarithm(law[2], load) - 1.0 / 3.0) / law[1]
    elif law[0] == _SPHERICAL:
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
