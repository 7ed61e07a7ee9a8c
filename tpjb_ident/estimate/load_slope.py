"""How H changes with the static load, dH / d ln W, by the campaign's other loads."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.estimate.noise import UNKNOWN_EXPONENT


def slopes_over_load(points: Sequence[OperatingPoint], h: ComplexArray) -> tuple[ComplexArray, BoolArray]:
    """DH / d ln W at every point (P, 2, 2), and whether the campaign tells it (P,); `h` (P, 2, 2), NaN where unknown.

    Entries that keep their sign are power laws between loads. A point whose excitation was run at one load only takes
    the slope of the nearest excitation at its load, stiffness and damping each its own.
    """
    slope = UNKNOWN_EXPONENT * np.nan_to_num(h)
    known = np.zeros(len(points), dtype=bool)
    families: dict[tuple[object, ...], list[int]] = {}
    for i, p in enumerate(points):
        if p.static_load > 0 and np.isfinite(h[i]).all():
            families.setdefault(p.key[1:], []).append(i)
    for members in families.values():
        members.sort(key=lambda i: points[i].static_load)
        log_load = np.log([points[i].static_load for i in members])
        if len(members) > 1 and np.ptp(log_load) > 0:
            values = h[members]
            slope[members] = _log_gradient(values.real, log_load) + 1j * _log_gradient(values.imag, log_load)
            known[members] = True
    donors = np.flatnonzero(known).tolist()
    for i in np.flatnonzero(~known).tolist():
        like = [j for j in donors if points[j].static_key == points[i].static_key]
        if like:
            j = min(like, key=lambda j: abs(points[j].excitation - points[i].excitation))
            slope[i] = slope[j].real + 1j * slope[j].imag * points[i].excitation / points[j].excitation
            known[i] = True
    return slope, known


def _log_gradient(values: FloatArray, log_load: FloatArray) -> FloatArray:
    """Slope over ln W, (k, 2, 2)."""
    order: Literal[1, 2] = 2 if len(log_load) > 2 else 1
    plain = np.gradient(values, log_load, axis=0, edge_order=order)
    one_sign = np.abs(np.sign(values).sum(axis=0)) == len(values)
    logarithm = np.log(np.where(one_sign, np.abs(values), 1.0))
    power = values * np.gradient(logarithm, log_load, axis=0, edge_order=order)
    return np.where(one_sign, power, plain)
