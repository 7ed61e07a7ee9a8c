"""One Newton step of the equilibrium: every pad's tilt and deflection are eliminated, the journal's move is left.

Per pad two equations stand beside the two of the journal: the film's moment about the pivot vanishes (or is held
by k_theta), and the pivot has deflected by delta(W). With the film's own derivatives by (a, b) they are linear in the
pad's tilt and deflection and in the journal's move; what they leave of the film's force is linear in the move alone.
"""

import math
from typing import NamedTuple

import numpy as np

from model.compilation import inner
from model.pad.pivot import compliance, deflection
from model.statics.compiled.case import Case
from model.statics.compiled.stack import PadStack
from model.tilt_hold import held_moment
from rigdata.arrays import FloatArray


class _PadEquations(NamedTuple):
    """A pad's moment over R_P [N] and pivot, each linear in its own tilt and deflection."""

    force: tuple[float, float]  #: Of the film, radial and tangential [N].
    stiffness: FloatArray  #: (2, 2): Its derivatives by (a, b) [N/m].
    radius: float  #: R_P [m].
    moment: float  #: That is not balanced, over R_P [N].
    hold: tuple[float, float]  #: Slopes of what holds the tilt, k_theta / R_P [N/rad], and by the pad's load.
    missing: float  #: delta(W) less the present deflection [m].
    compliance: float  #: d delta / d W [m/N].


@inner
def _equations(case: Case, pads: PadStack, growing: float, m: int) -> _PadEquations:
    pad = pads.each[m]
    load, stiffness, radius = pad.felt[0], pad.felt_stiffness, pad.pivot_radius
    # a journal that grows comes nearer, all but at the pads' ends as if it were pushed
    closing = case.closing * growing
    radial = load + closing * stiffness[0, 0]
    tangential = pad.felt[1] + closing * stiffness[1, 0]
    moment, hold, arm, _ = held_moment(case.hold, pad.tilt, load)
    missing = deflection(pad.law, pads.curves[m], max(load, 0.0)) - pad.deflection
    give = compliance(pad.law, pads.curves[m], max(load, 1e-6))
    held = (hold / radius, arm / radius)
    return _PadEquations((radial, tangential), stiffness, radius, tangential + moment / radius, held, missing, give)


@inner
def newton(case: Case, pads: PadStack, growing: float) -> tuple[float, FloatArray]:
    """Solve the linearised equilibrium once: residual, shift (2,) of the journal; the pads keep their own moves.

    `growing`: what the journal's temperature changes by in this step [K].
    """
    n, load = len(pads.each), case.load
    size = max(math.hypot(load[0], load[1]), 1.0)
    worst = 0.0
    system = np.zeros((2, 3))  #: Per metre of the journal's move along x and y: force; and the load that is missing.
    system[0, 0] = system[1, 1] = 1.0  # N/m: a pad that only touches leaves a direction free
    system[:, 2] = load
    follow = np.zeros((n, 2, 3))  # of tilt and deflection by the same, and by themselves
    for m in range(n):
        pad = pads.each[m]
        if not pad.solved:
            continue
        frame, equations = pad.frame, _equations(case, pads, growing, m)
        k, arm = equations.stiffness, equations.radius
        for column in range(3):
            # the film changes by the journal's move, and by how the pad follows; the last is the pad by itself
            da, db = (frame[0, column], frame[1, column]) if column < 2 else (0.0, 0.0)
            radial, tangential = _force_change(k, da, db)
            moment = -(tangential + equations.hold[1] * radial)
            give = equations.compliance * radial
            if column == 2:
                moment, give = -equations.moment, equations.missing
            tilt, give = _pad_moves(equations, moment, give)
            follow[m, 0, column], follow[m, 1, column] = tilt, give
            radial, tangential = _force_change(k, da - give, db + arm * tilt)
            if column == 2:
                radial = -radial - equations.force[0]
                tangential = -tangential - equations.force[1]
            for i in range(2):
                system[i, column] += frame[0, i] * radial + frame[1, i] * tangential
        worst = max(worst, max(abs(equations.moment), abs(equations.missing * k[0, 0])) / size)
    worst = max(worst, math.hypot(system[0, 2], system[1, 2]) / size)
    determinant = system[0, 0] * system[1, 1] - system[0, 1] * system[1, 0]
    shift = np.empty(2)
    shift[0] = (system[0, 2] * system[1, 1] - system[0, 1] * system[1, 2]) / determinant
    shift[1] = (system[0, 0] * system[1, 2] - system[1, 0] * system[0, 2]) / determinant
    for m in range(n):
        pad = pads.each[m]
        for q in range(2):
            pad.moves[q] = follow[m, q, 2] + follow[m, q, 0] * shift[0] + follow[m, q, 1] * shift[1]
            if not math.isfinite(pad.moves[q]):  # numpy's own question would load scipy
                worst = math.inf
        if case.hold.slip > 0.0 and pad.tilt * (pad.tilt + pad.moves[0]) < 0.0:
            pad.moves[0] = -pad.tilt  # the friction turns round there
    return worst, shift


@inner
def _force_change(stiffness: FloatArray, da: float, db: float) -> tuple[float, float]:
    """Change of the radial and tangential force for a change of (a, b)."""
    return stiffness[0, 0] * da + stiffness[0, 1] * db, stiffness[1, 0] * da + stiffness[1, 1] * db


@inner
def _pad_moves(equations: _PadEquations, moment: float, give: float) -> tuple[float, float]:
    """Tilt and deflection with which a pad gains a moment over R_P [N] and a pivot deflection [m] that are wanted.

    The film's (a, b) change by (-deflection, R_P tilt); the first row is the moment over R_P, the second the pivot.
    """
    k, arm, soft = equations.stiffness, equations.radius, equations.compliance
    hold, by_load = equations.hold
    m11 = (k[1, 1] + by_load * k[0, 1]) * arm + hold
    m12 = -(k[1, 0] + by_load * k[0, 0])
    m21, m22 = -soft * k[0, 1] * arm, 1.0 + soft * k[0, 0]
    determinant = m11 * m22 - m12 * m21
    return (moment * m22 - m12 * give) / determinant, (m11 * give - m21 * moment) / determinant
