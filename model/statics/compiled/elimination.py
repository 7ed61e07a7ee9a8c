"""One Newton step of the equilibrium: every pad's tilt and deflection are eliminated, the journal's move is left.

Per pad two equations stand beside the two of the journal: the film's moment about the pivot vanishes (or is held
by k_theta), and the pivot has deflected by delta(W). With the film's own derivatives by (a, b) they are linear in the
pad's tilt and deflection and in the journal's move; what they leave of the film's force is linear in the move alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from rigdata.arrays import FloatArray


class PadEquations(NamedTuple):
    """What a Newton step needs to know of the n pads that carry, in the (radial, tangential) frame of each."""

    frame: FloatArray  #: (n, 2, 2): Rows: unit vectors along the pivot (normal) and across it (tangent).
    force: FloatArray  #: (n, 2): Of the film [N].
    stiffness: FloatArray  #: (n, 2, 2): Its derivatives by (a, b) [N/m].
    pivot_radius: FloatArray  #: (n,): R_P [m].
    holding_force: FloatArray  #: (n,): Moment that holds the tilt back, over R_P [N].
    holding_slopes: FloatArray  #: (n, 2): Its derivatives by the tilt, k_theta / R_P [N/rad], and by the pad's load.
    missing_deflection: FloatArray  #: (n,): delta(W) less the present deflection [m].
    pivot_compliance: FloatArray  #: (n,): d delta / d W [m/N].


@compiled
def eliminate(load: FloatArray, pads: PadEquations) -> tuple[float, FloatArray, FloatArray]:
    """Eliminate every pad's tilt and deflection, and solve for the journal's move.

    `load` (2,) [N]; gives shift (2,) [m], moves (n, 2) [rad].
    """
    n = pads.pivot_radius.shape[0]
    size = max(math.hypot(load[0], load[1]), 1.0)
    worst = 0.0
    missing = load.copy()
    jacobian = np.zeros((2, 2))
    jacobian[0, 0] = jacobian[1, 1] = 1.0  # N/m: a pad that only touches leaves a direction free
    at_rest, by_shift = np.empty((n, 2)), np.empty((n, 2, 2))
    for m in range(n):
        frame, k = pads.frame[m], pads.stiffness[m]
        arm, compliance = pads.pivot_radius[m], pads.pivot_compliance[m]
        moment = pads.force[m, 1] + pads.holding_force[m]
        # with the journal at rest: what the pad does by itself
        tilt, deflection = _pad_moves(pads, m, -moment, pads.missing_deflection[m])
        at_rest[m, 0], at_rest[m, 1] = tilt, deflection
        radial, tangential = _force_change(k, -deflection, arm * tilt)
        radial, tangential = radial + pads.force[m, 0], tangential + pads.force[m, 1]
        for i in range(2):
            missing[i] -= frame[0, i] * radial + frame[1, i] * tangential
        # per metre of the journal's move: the film changes by it, and by how the pad follows
        for axis in range(2):
            da, db = frame[0, axis], frame[1, axis]
            radial, tangential = _force_change(k, da, db)
            turning = tangential + pads.holding_slopes[m, 1] * radial
            tilt, deflection = _pad_moves(pads, m, -turning, compliance * radial)
            by_shift[m, 0, axis], by_shift[m, 1, axis] = tilt, deflection
            radial, tangential = _force_change(k, da - deflection, db + arm * tilt)
            for i in range(2):
                jacobian[i, axis] += frame[0, i] * radial + frame[1, i] * tangential
        worst = max(worst, max(abs(moment), abs(pads.missing_deflection[m] * k[0, 0])) / size)
    worst = max(worst, math.hypot(missing[0], missing[1]) / size)
    determinant = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]
    shift, moves = np.empty(2), np.empty((n, 2))
    shift[0] = (missing[0] * jacobian[1, 1] - jacobian[0, 1] * missing[1]) / determinant
    shift[1] = (jacobian[0, 0] * missing[1] - jacobian[1, 0] * missing[0]) / determinant
    for m in range(n):
        for q in range(2):
            moves[m, q] = at_rest[m, q] + by_shift[m, q, 0] * shift[0] + by_shift[m, q, 1] * shift[1]
    return worst, shift, moves


@inner
def _force_change(stiffness: FloatArray, da: float, db: float) -> tuple[float, float]:
    """Change of the radial and tangential force for a change of (a, b)."""
    return stiffness[0, 0] * da + stiffness[0, 1] * db, stiffness[1, 0] * da + stiffness[1, 1] * db


@inner
def _pad_moves(pads: PadEquations, m: int, moment: float, deflection: float) -> tuple[float, float]:
    """Tilt and deflection with which pad m gains a moment over R_P [N] and a pivot deflection [m] that are wanted.

    The film's (a, b) change by (-deflection, R_P tilt); the first row is the moment over R_P, the second the pivot.
    """
    k, arm, compliance = pads.stiffness[m], pads.pivot_radius[m], pads.pivot_compliance[m]
    hold, by_load = pads.holding_slopes[m]
    m11, m12 = (k[1, 1] + by_load * k[0, 1]) * arm + hold, -(k[1, 0] + by_load * k[0, 0])
    m21, m22 = -compliance * k[0, 1] * arm, 1.0 + compliance * k[0, 0]
    determinant = m11 * m22 - m12 * m21
    return (moment * m22 - m12 * deflection) / determinant, (m11 * deflection - m21 * moment) / determinant


@inner
def solve(matrix: FloatArray, right: FloatArray) -> None:
    """Gauss' elimination with the largest pivot of each column; the solutions replace the right-hand sides (n, q)."""
    n = len(matrix)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(right.shape[1]):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(right.shape[1]):
                right[i, j] -= factor * right[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(right.shape[1]):
            total = right[k, j]
            for i in range(k + 1, n):
                total -= matrix[k, i] * right[i, j]
            right[k, j] = total / matrix[k, k]
