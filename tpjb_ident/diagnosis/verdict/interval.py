"""Interval: how far a number of an effect may be off where the model bends, or K and C jump, beside the fit.

The likelihood's profile: the number is held off, and all others are fitted anew. Where its chi-square rises as
derivatives say, the interval is theirs; else it ends where the rise is that of 95 %, no nearer than they say.
"""

import math

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.fit import Fit, rise
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.schema import HALF_INTERVAL


def errors_each_way(run: Map, fit: Fit) -> list[FloatArray]:
    """Standard errors of every fault's numbers below and above, (2, k); a tolerance's own scatter besides."""
    out = []
    for fault, at, errors in zip(fit.faults, fit.unknowns.slices, fit.errors, strict=True):
        asked = [] if fault.is_term else range(at.start, at.stop)
        times = np.array([_stretched(run, fit, i) for i in asked]).T if asked else np.ones((2, 1))
        own = 1.0 if fault.own >= 0 else 0.0
        out.append(np.hypot(times * np.sqrt(errors**2 - own**2), own))
    return out


def _stretched(run: Map, fit: Fit, index: int) -> tuple[float, float]:
    """Ends of a number's interval below and above, in ends by derivatives."""
    sides = (-HALF_INTERVAL, HALF_INTERVAL)
    near = [rise(run, fit, index, side) for side in sides]
    if max(abs(found - HALF_INTERVAL**2) for found in near) < Deciding.surprise:
        return 1.0, 1.0
    below, above = (_end(found, rise(run, fit, index, 2.0 * side)) for found, side in zip(near, sides, strict=True))
    return below, above


def _end(near: float, far: float) -> float:
    """Where a profile passes the rise of 95 %, by its rise once and twice as far out as derivatives say."""
    once, twice = math.sqrt(near) / HALF_INTERVAL, math.sqrt(far) / HALF_INTERVAL
    if twice < 1.0:  # a local rise on the way is no end
        return min(2.0 / max(twice, 1e-9), Deciding.stretched)
    return 1.0 if once >= 1.0 else 1.0 + (1.0 - once) / (twice - once)
