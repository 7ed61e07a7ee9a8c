"""One Newton step of the equilibrium: every pad's tilt and deflection are eliminated, the journal's move is left.

Per pad two equations stand beside the two of the journal: the film's moment about the pivot vanishes (or is held
by k_theta), and the pivot has given way by delta(W).
"""

from __future__ import annotations

import math

import numpy as np

from model.arrays import FloatArray
from model.compilation import compiled
from model.setup import Setup
from model.statics.pad_film import PadFilm
from model.statics.tilt_hold import tilt_hold


def newton_step(setup: Setup, load: FloatArray, films: list[PadFilm]) -> tuple[float, FloatArray, FloatArray]:
    """One linear solve: the residual, the journal's move (2,), and every pad's (tilt, deflection) move (n_pads, 2)."""
    laws = setup.pivots
    carrying = [f for f in films if f.forces is not None]
    pads = np.zeros((len(carrying), _COLUMNS))
    for row, film in zip(pads, carrying, strict=True):
        forces = film.foreseen if film.step is None else film.step.forces
        assert forces is not None
        law, radial = laws[film.number - 1], float(forces.force[0])
        row[0:4] = *film.normal, *film.tangent
        row[4:10] = *forces.force, *forces.stiffness.ravel()
        row[10] = film.pivot_radius
        hold = tilt_hold(setup, film.tilt, radial)
        row[11] = hold.stiffness / film.pivot_radius
        row[12] = hold.moment / film.pivot_radius
        row[13] = law.deflection(max(radial, 0.0)) - film.deflection
        row[14] = 1.0 / law.stiffness(max(radial, 1e-6))
        row[15] = hold.arm / film.pivot_radius
    residual, shift, moves = eliminate(load, pads)
    if setup.friction:
        _stop_where_friction_turns(carrying, moves)
    every = np.zeros((len(films), 2))
    every[[f.number - 1 for f in carrying]] = moves
    return residual, shift, every


def _stop_where_friction_turns(carrying: list[PadFilm], moves: FloatArray) -> None:
    """Let no pad tilt past the untilted attitude in one step: the friction turns round there."""
    for film, move in zip(carrying, moves, strict=True):
        if film.tilt * (film.tilt + move[0]) < 0.0:
            move[0] = -film.tilt


#: What `eliminate` is told per pad: normal, tangent, force, stiffness, R_P, k_theta / R_P, moment that holds the tilt
#: back over R_P, missing give, pivot compliance, slope of that moment by the pad's load over R_P.
_COLUMNS = 16


@compiled
def eliminate(load: FloatArray, pads: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Eliminate every pad's tilt and deflection, and solve for the journal's move.

    Parameters
    ----------
    load : (2,) ndarray
        [N]
    pads : (n, 16) ndarray
        One row per pad that carries, see `_COLUMNS`.

    Returns
    -------
    residual : float
        Unbalanced force, moment over R_P, or give times stiffness, as a share of the load.
    shift : (2,) ndarray
        [m]
    moves : (n, 2) ndarray
        Changes of tilt [rad] and deflection [m].
    """
    n = pads.shape[0]
    size = max(math.hypot(load[0], load[1]), 1.0)
    jxx, jxy, jyx, jyy = 1.0, 0.0, 0.0, 1.0  # a pad that only touches leaves a direction free: keep it regular
    fx, fy = load[0], load[1]
    worst = 0.0
    constant = np.empty((n, 2))
    gradient = np.empty((n, 2, 2))
    for m in range(n):
        nx, ny, tx, ty = pads[m, 0], pads[m, 1], pads[m, 2], pads[m, 3]
        radial, tangential = pads[m, 4], pads[m, 5]
        kaa, kab, kba, kbb = pads[m, 6], pads[m, 7], pads[m, 8], pads[m, 9]
        arm, hold, held, missing, compliance = pads[m, 10], pads[m, 11], pads[m, 12], pads[m, 13], pads[m, 14]
        moment = tangential + held
        # slopes of the moment by (a, b): the film's own, and what holds the tilt back grows with the load
        kma, kmb = kba + pads[m, 15] * kaa, kbb + pads[m, 15] * kab
        # d(a, b) = (n . dX - deta, t . dX + R_P dt); rows: tilting force, pivot
        m11, m12 = kmb * arm + hold, -kma
        m21, m22 = -compliance * kab * arm, 1.0 + compliance * kaa
        det = m11 * m22 - m12 * m21
        for axis in range(3):  # right-hand sides: constant, dx, dy
            if axis == 0:
                r1, r2 = -moment, missing
            else:
                da = nx if axis == 1 else ny
                db = tx if axis == 1 else ty
                r1, r2 = -(kma * da + kmb * db), compliance * (kaa * da + kab * db)
            dt, deta = (r1 * m22 - m12 * r2) / det, (m11 * r2 - m21 * r1) / det
            if axis == 0:
                constant[m, 0], constant[m, 1] = dt, deta
                da, db = -deta, arm * dt
            else:
                gradient[m, 0, axis - 1], gradient[m, 1, axis - 1] = dt, deta
                da, db = da - deta, db + arm * dt
            fr, ft = kaa * da + kab * db, kba * da + kbb * db
            if axis == 0:
                fx -= nx * (radial + fr) + tx * (tangential + ft)
                fy -= ny * (radial + fr) + ty * (tangential + ft)
            elif axis == 1:
                jxx += nx * fr + tx * ft
                jyx += ny * fr + ty * ft
            else:
                jxy += nx * fr + tx * ft
                jyy += ny * fr + ty * ft
        worst = max(worst, max(abs(moment), abs(missing * kaa)) / size)
    worst = max(worst, math.hypot(fx, fy) / size)
    det = jxx * jyy - jxy * jyx
    shift = np.empty(2)
    shift[0], shift[1] = (fx * jyy - jxy * fy) / det, (jxx * fy - jyx * fx) / det
    moves = np.empty((n, 2))
    for m in range(n):
        for q in range(2):
            moves[m, q] = constant[m, q] + gradient[m, q, 0] * shift[0] + gradient[m, q, 1] * shift[1]
    return worst, shift, moves
