"""One Newton step of the equilibrium: every pad's tilt and deflection are eliminated, the journal's move is left.

Per pad two equations stand beside the two of the journal: the film's moment about the pivot vanishes (or is held
by k_theta), and the pivot has deflected by delta(W). With the film's own derivatives by (a, b) they are linear in the
pad's tilt and deflection and in the journal's move; what they leave of the film's force is linear in the move alone.
"""

import math

import numpy as np

from model.compilation import inner
from model.film.dense import solve
from model.pad.pivot import compliance, deflection
from model.statics.compiled.case import Case
from model.statics.compiled.stack import PadStack
from model.tilt_hold import held_moment
from rigdata.arrays import FloatArray


@inner
def newton(case: Case, pads: PadStack, growing: float) -> tuple[float, FloatArray]:
    """Solve the linearised equilibrium once: residual, shift (2,) of the journal; the pads keep their own moves.

    `growing`: what the journal's temperature changes by in this step [K].
    """
    n, load, worst = len(pads.table), case.load, 0.0
    system = np.zeros((2, 3))  # force per metre of the journal's move along x and y, and the load that is missing
    system[0, 0] = system[1, 1] = 1.0  # N/m: a pad that only touches leaves a direction free
    system[:, 2] = load
    follow = np.zeros((n, 2, 3))
    for m in range(n):
        if pads.table[m].solved:
            worst = max(worst, _eliminate(case, pads, growing, m, follow[m], system))
    shift = system[:, 2:].copy()
    worst = max(worst, math.hypot(shift[0, 0], shift[1, 0])) / max(math.hypot(load[0], load[1]), 1.0)
    solve(system[:, :2], shift)
    for m in range(n):
        pad = pads.table[m]
        for q in range(2):
            pad.moves[q] = follow[m, q, 2] + follow[m, q, 0] * shift[0, 0] + follow[m, q, 1] * shift[1, 0]
            if not math.isfinite(pad.moves[q]):  # numpy's own question would load scipy
                worst = math.inf
        if case.hold.slip > 0.0 and pad.tilt * (pad.tilt + pad.moves[0]) < 0.0:
            pad.moves[0] = -pad.tilt  # the friction turns round there
    return worst, shift[:, 0].copy()


@inner
def _eliminate(case: Case, pads: PadStack, growing: float, m: int, follow: FloatArray, system: FloatArray) -> float:
    """Add to the journal's equations (2, 3) what a pad pushes that follows; returns the largest unbalanced force [N].

    Sets how tilt and deflection follow the journal along x and y, and move by themselves, (2, 3).
    """
    pad = pads.table[m]
    frame, k, radius, load = pad.frame, pad.felt_stiffness, pad.pivot_radius, pad.felt[0]
    held, stiffness, arm = held_moment(case.hold, pad.tilt, load)
    flexibility = compliance(pad.law, pads.curves[m], max(load, 1e-6))
    # a journal that grows comes nearer, all but at the pads' ends as if it were pushed
    closing = case.closing * growing
    force = (load + closing * k[0, 0], pad.felt[1] + closing * k[1, 0])
    slopes = np.empty((2, 4))  # of both forces by the journal's x and y, by tilt and deflection
    for i in range(2):
        for axis in range(2):
            slopes[i, axis] = k[i, 0] * frame[0, axis] + k[i, 1] * frame[1, axis]
        slopes[i, 2], slopes[i, 3] = k[i, 1] * radius, -k[i, 0]
    equations = np.empty((2, 4))  # of the moment over R_P [N] and of the pivot's deflection [m]
    equations[0] = slopes[1] + arm / radius * slopes[0]
    equations[1] = -flexibility * slopes[0]
    equations[0, 2] += stiffness / radius
    equations[1, 3] += 1.0
    follow[:, :2] = -equations[:, :2]
    follow[0, 2] = -force[1] - held / radius
    follow[1, 2] = deflection(pad.law, pads.curves[m], max(load, 0.0)) - pad.deflection
    unbalanced = max(abs(follow[0, 2]), abs(follow[1, 2] * k[0, 0]))
    solve(equations[:, 2:], follow)
    for i in range(2):
        for column in range(3):
            push = slopes[i, 2] * follow[0, column] + slopes[i, 3] * follow[1, column]
            push = push + slopes[i, column] if column < 2 else -push - force[i]
            for axis in range(2):
                system[axis, column] += frame[i, axis] * push
    return unbalanced
