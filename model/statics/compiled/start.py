"""Where a search starts: the journal on the curves of its pads, and which of them carry there.

For a set of loaded pads the journal's place is the minimum of a convex energy: the sum over the pads of the integral
of W(r), less the work of the load. Beyond its fold every curve goes on, falling fast, so that the energy stays convex.
Pads that stand clearly beyond their folds then idle, one after another, the farthest first; of alike ones the last.
"""

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.dense import product, solve
from model.interpolation import row_below
from model.pad.pivot import deflection
from model.statics.compiled.stack import rigid_approach
from rigdata.arrays import BoolArray, FloatArray

#: Share of the clearance over which a curve falls to 1/e beyond its fold.
_TAIL = 2e-3
#: Share of the load that may be missing.
_GOOD_ENOUGH = 2e-4
#: A film's own mesh moves a fold by about this share of the clearance: the search decides.
_FOLD = 2e-3
#: Share of the clearance within which pads stand alike.
_ALIKE = 1e-6


@compiled
def pivot_curve(
    attitude: tuple[FloatArray, FloatArray, FloatArray],
    clearance: float,
    pivot: tuple[FloatArray, FloatArray],
    deflections: FloatArray,
    out: FloatArray,
) -> int:
    """A pad's loaded attitudes on its pivot, rising from the fold: r = a + delta(W), a, b [m], W [N]; how many.

    `attitude` is (A, B, W); `pivot` its law and curve; `deflections` (n,) of the pivot, empty where the law says it.
    """
    curvature, wedge, load = attitude
    count = len(load)
    if count < 3:
        return 0
    share = clearance / (1.0 + curvature)
    reach = share * curvature
    for k in range(count):
        reach[k] += deflections[k] if len(deflections) > 0 else deflection(pivot[0], pivot[1], load[k])
    low = count - 1
    while low > 0 and reach[low - 1] < reach[low]:
        low -= 1
    rows = count - low
    out[0, :rows], out[1, :rows] = reach[low:], (share * curvature)[low:]
    out[2, :rows], out[3, :rows] = (share * wedge)[low:], load[low:]
    return rows


def first_position(load: FloatArray, pads: np.ndarray) -> tuple[FloatArray, BoolArray]:
    """Journal (2,) [m], and which pads carry there; `load` (2,) [N]."""
    position, loaded = np.zeros(2), pads["rows"] >= 2
    while stand_on_curves(load, pads, loaded, position):
        reach = pads["preload"] + pads["frame"][:, 0] @ position
        excess = np.where(loaded, (pads["attitudes"][:, 0, 0] - reach) / pads["clearance"], -1.0)
        if excess.max() < _FOLD:
            break
        loaded[np.flatnonzero(excess > excess.max() - _ALIKE)[-1]] = False
    return position, loaded


@inner
def _pushes(pad: np.record, position: FloatArray) -> tuple[float, float]:
    """Load of a pad's curve at a position [N], and its slope [N/m]."""
    reach = rigid_approach(pad, position)
    table, load = pad.attitudes[0], pad.attitudes[3]
    if reach < table[0]:
        tail = _TAIL * pad.clearance
        push = load[0] * math.exp(max((reach - table[0]) / tail, -60.0))
        return push, push / tail
    low = row_below(table, pad.rows, reach)
    slope = (load[low + 1] - load[low]) / (table[low + 1] - table[low])
    return load[low] + slope * (reach - table[low]), slope


@inner
def _missing(
    load: FloatArray, pads: np.ndarray, loaded: BoolArray, position: FloatArray, slopes: FloatArray
) -> FloatArray:
    """Part (2,) of the load that the loaded pads do not carry at a position; `slopes` (2, 2) are set."""
    missing = load.copy()
    slopes[:] = 0.0
    for m in range(len(loaded)):
        if loaded[m]:
            normal = pads[m].frame[0]
            push, slope = _pushes(pads[m], position)
            for i in range(2):
                missing[i] -= normal[i] * push
                for j in range(2):
                    slopes[i, j] += slope * normal[i] * normal[j]
    return missing


@compiled
def stand_on_curves(load: FloatArray, pads: np.ndarray, loaded: BoolArray, position: FloatArray) -> bool:
    """Move the journal to where a set of pads carries the load, by Newton's steps down the energy; False if nowhere."""
    room, stiff, largest, least = math.inf, 0.0, 0.0, math.inf
    for m in range(len(loaded)):
        pad = pads[m]
        least = min(least, pad.clearance)
        if loaded[m]:
            last, largest = pad.rows - 1, max(largest, _pushes(pad, position)[0])
            room = min(room, pad.attitudes[1, last] - pad.preload)
            stiff = max(stiff, pad.attitudes[3, last] / pad.clearance)
    if math.isinf(room):
        return False
    room = max(room, 0.05 * least)
    size = math.hypot(load[0], load[1])
    if size == 0.0:
        size = largest
    if position[0] == 0.0 and position[1] == 0.0:
        position[:] = 0.4 * room / max(size, 1e-30) * load
    slopes, step = np.empty((2, 2)), np.empty((2, 1))
    missing = _missing(load, pads, loaded, position, slopes)
    for _ in range(60):
        if math.hypot(missing[0], missing[1]) < _GOOD_ENOUGH * size:
            return True
        for axis in range(2):  # nothing carries in some direction: go where the load pushes
            slopes[axis, axis] += 1e-9 * stiff
        step[:, 0] = missing
        solve(slopes, step)
        move = step[:, 0] * min(1.0, 0.2 * room / max(math.hypot(step[0, 0], step[1, 0]), 1e-30))
        enough = -0.5 * product(missing, move)
        for halving in range(12):
            # along a step down a convex energy its slope rises: far enough is where it is past its zero, not far past
            trial = position + move * 0.5**halving
            missing = _missing(load, pads, loaded, trial, slopes)
            if product(missing, move) > enough or halving == 11:
                break
        position[:] = trial
    return math.hypot(missing[0], missing[1]) < 10.0 * _GOOD_ENOUGH * size
