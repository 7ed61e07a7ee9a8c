"""One step of all films, and one Newton step of journal and pads, on the arrays of a search."""

import math

import numpy as np

from model.compilation import inner
from model.film.dense import BOUNDLESS, product
from model.film.models import solve_by
from model.film.oil_state import least_share, set_viscosity
from model.statics.compiled.bending import axial_shape, bend_pads, change_shape
from model.statics.compiled.case import ACROSS, HEAT_PER_FORCE, HEATING_STEP, Problem, film_of
from model.statics.compiled.heat import rest_films
from model.statics.compiled.place import let_idle, rescue
from model.statics.compiled.stack import GROWING, GROWN, JOURNAL, along, rigid_approach, towards
from rigdata.arrays import FloatArray

#: Largest step of the journal, as a share of the least clearance: the films' slopes are those of where it stands.
#: Half and twice of it change nothing.
_LONGEST_STEP = 0.3
#: A film may shrink to this share of itself in one step.
_SHRINK = 0.4


@inner
def solve_pressures(problem: Problem, sharp: bool) -> bool:
    """Pressure of every film that carries, at its present temperature; False if one is lost.

    A film without force is that of the unloaded attitude, in which nothing holds the pad: the loaded one counts.
    """
    pads, state, case, lost = problem.pads, problem.state, problem.case, False
    for k in range(len(pads.order)):
        m = pads.order[k]
        pad, (grid, work) = pads.table[m], film_of(problem, m)
        pad.supplied = case.fresh + case.mixing * pads.table[pads.order[k - 1]].passed / case.length
        while not pad.idle:
            if not sharp and case.thermal != ACROSS:
                set_viscosity(work, case.running.oil)
            a = rigid_approach(pad, state.position) - pad.deflection
            b = along(pad, state.position) + pad.pivot_radius * pad.tilt
            wedge, speed = (pad.clearance, a, b), case.running.speed
            forces = solve_by(case.rupture, grid, work, wedge, speed, sharp, pad.supplied)
            pad.wedge[0], pad.wedge[1], pad.solved = a, b, True
            pad.least, pad.steps = forces.min_film, forces.steps
            pad.force[:], pad.stiffness[:], pad.damping[:] = forces.force, forces.stiffness, forces.damping
            if not sharp:
                pad.corrected[:] = forces.force
            if sharp or forces.steps < 0 or forces.force[0] > 0.0 or case.hold.flexure > 0.0:
                break
            if not rescue(pad, work, state.position):
                let_idle(pad)
        if pad.idle:
            pad.solved = False
            work.pressure[1:] = 0.0
        elif pad.steps < 0:
            lost = True
    rest_films(problem)
    return not lost


@inner
def grow_and_bend(problem: Problem, relaxation: float, change: float) -> float:
    """What a journal grows, what pads bend; returns the largest change asked for, from `change` on [K]."""
    figures, pads = problem.state.figures, problem.pads.table
    if problem.case.closing > 0.0 and change < BOUNDLESS:
        warmth = figures[JOURNAL]
        if not math.isfinite(warmth):  # as the films that carry, by area; as the oil where it enters if none does
            area, warmth = 0.0, 0.0
            for m in range(len(pads)):
                if not pads[m].idle:
                    weight = problem.grids.area[m].reshape(-1)
                    area += product(weight, np.ones(len(weight)))
                    warmth += product(weight, problem.works.temperature[m].reshape(-1))
            warmth = warmth / area if area > 0.0 else pads[0].inlet
        increment = warmth - figures[GROWN]
        figures[GROWING] = relaxation * min(max(increment, -HEATING_STEP), HEATING_STEP)
        change = max(change, abs(increment))
    for m in range(len(pads)):
        pad = pads[m]
        pad.felt[:], pad.felt_stiffness[:] = pad.corrected, pad.stiffness
    # a deformation counts like a temperature change of the same weight in the film's resistance
    share = bend_pads(problem.bodies, problem) if change < BOUNDLESS else 0.0
    return max(change, HEAT_PER_FORCE * share)


@inner
def move(problem: Problem, shift: FloatArray, damping: float) -> bool:
    """Move journal and pads, no further than lets every film keep a share of its thickness; True if all the way."""
    pads, state, case = problem.pads, problem.state, problem.case
    scale, extra = damping, np.empty((0, 0))
    closing = case.closing * state.figures[GROWING]
    moves = np.zeros((len(pads.table), 3))
    length = max(math.hypot(shift[0], shift[1]), 1e-30)
    for m in range(len(pads.table)):
        pad = pads.table[m]
        scale = min(scale, _LONGEST_STEP * pad.clearance / length)
        moves[m, 0], moves[m, 1] = pad.moves[0], pad.moves[1]
        if pad.solved:
            grid, work = film_of(problem, m)
            da = towards(pad, shift) - moves[m, 1] + closing
            db = along(pad, shift) + pad.pivot_radius * moves[m, 0]
            if state.bent.size > 0:
                moves[m, 2] = change_shape(problem.bodies, problem, m, da, db)
                extra = state.mismatch[m] + moves[m, 2] * axial_shape(grid)
            worst = least_share(grid, work, da, db, extra)
            if worst * damping < _SHRINK - 1.0:
                scale = min(scale, (_SHRINK - 1.0) / worst)
    change_state(problem, shift, moves, scale)
    return scale == 1.0


@inner
def change_state(problem: Problem, shift: FloatArray, moves: FloatArray, scale: float) -> None:
    """Change the state by a share of a step: of the journal [m], and of every pad's tilt, deflection, axial tilt.

    What a journal will grow by and what is missing of deformations stand in the state.
    """
    pads, state = problem.pads, problem.state
    hotter = scale * state.figures[GROWING]
    state.position[:] += scale * shift
    state.figures[GROWN] += hotter
    state.figures[GROWING] = 0.0
    for m in range(len(pads.table)):
        pad = pads.table[m]
        pad.clearance -= problem.case.closing * hotter
        # a pad that friction stops where it does not tilt stops there, whatever the step's length
        pad.tilt = 0.0 if moves[m, 0] == -pad.tilt else pad.tilt + scale * moves[m, 0]
        pad.deflection += scale * moves[m, 1]
        if state.bent.size > 0 and pad.solved:
            grid, work = film_of(problem, m)
            work.extra[:] += scale * (state.mismatch[m] + moves[m, 2] * axial_shape(grid))
            state.bent[m] += scale * state.mismatch[m]
            pad.axial += scale * moves[m, 2]
