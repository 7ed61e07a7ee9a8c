"""One step of all films, and one Newton step of journal and pads, on the arrays of a compiled search."""

from __future__ import annotations

import math

import numpy as np

from model.compilation import inner
from model.film.energy import heat_step
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import least_share, set_viscosity
from model.film.reynolds import solve_film
from model.statics.compiled.bending import Shapes, bend_pads, change_shape
from model.statics.compiled.carrying import Case, along, hold_of, rigid_approach, set_loaded
from model.statics.compiled.constants import BOUNDLESS, HEAT_PER_FORCE, HEATING_STEP, LONGEST_STEP, SHRINK
from model.statics.compiled.elimination import PadEquations, eliminate
from model.statics.compiled.laws import compliance, deflection
from model.statics.compiled.stack import PadStack, PadState, grid_of, work_of
from rigdata.arrays import FloatArray


@inner
def solve_pressure(
    film: tuple[FilmGrid, FilmWork], pads: PadStack, state: PadState, case: Case, m: int, sharp: bool
) -> None:
    """Pressure of one film at its present temperature."""
    grid, work = film
    if not sharp:
        set_viscosity(work, case.running.oil)
    a = rigid_approach(pads, state, m) - state.deflection[m]
    b = along(pads, state, m) + pads.pivot_radius[m] * state.tilt[m]
    found = solve_film(grid, work, (pads.clearance[m], a, b), case.running.speed, sharp)
    state.wedge[m, 0], state.wedge[m, 1] = a, b
    state.solved[m] = True
    state.stiffness[m], state.damping[m] = found.stiffness, found.damping
    state.force[m], state.least[m], state.steps[m] = found.force, found.min_film, found.steps
    if not sharp:
        state.corrected[m] = found.force


@inner
def solve_films(
    shapes: Shapes, pads: PadStack, works: FilmWork, state: PadState, case: Case, relaxation: float
) -> tuple[float, float]:
    """Solve every film that carries once: pressure, then temperature, then what the pads' deformation asks."""
    lost = False
    for m in range(len(state.tilt)):
        if not state.idle[m]:
            film = (grid_of(shapes.grids, m), work_of(works, m))
            solve_pressure(film, pads, state, case, m, False)
            if state.steps[m] > 0 and not state.force[m, 0] > 0.0 and case.hold[0] == 0.0:
                set_loaded(pads, works, state, m)
                if not state.idle[m]:
                    solve_pressure(film, pads, state, case, m, False)
                    state.idle[m] = not state.force[m, 0] > 0.0
        if state.idle[m]:
            state.solved[m] = False
            works.pressure[m] = 0.0
        elif state.steps[m] < 0:
            lost = True
    if lost:
        return math.inf, 0.0
    change, limited = 0.0, 0.0
    if not case.isothermal:
        for m in range(len(state.tilt)):
            if state.solved[m] and state.steps[m] > 0:
                asked, cut, radial, tangential = heat_step(
                    grid_of(shapes.grids, m), work_of(works, m), case.running,
                    (pads.inlet[m], relaxation, HEATING_STEP), state.shift[m],
                )  # fmt: skip
                state.heating[m] = asked
                state.corrected[m, 0] = state.force[m, 0] + radial
                state.corrected[m, 1] = state.force[m, 1] + tangential
                limited = max(limited, cut)
                if not change >= asked:  # a NaN is not to be lost
                    change = asked
    for m in range(len(state.tilt)):
        state.felt[m], state.felt_stiffness[m] = state.corrected[m], state.stiffness[m]
    if len(shapes.bodies.which) > 0 and change < BOUNDLESS:
        change = max(change, HEAT_PER_FORCE * bend_pads(shapes, pads, works, state))
    return change, limited


@inner
def newton(case: Case, pads: PadStack, state: PadState) -> tuple[float, FloatArray, FloatArray]:
    """Solve the linearised equilibrium once: gives shift (2,), moves (n, 2)."""
    n = 0
    for m in range(len(state.tilt)):
        n += 1 if state.solved[m] else 0
    rows = PadEquations(
        np.empty((n, 2, 2)), np.empty((n, 2)), np.empty((n, 2, 2)), np.empty(n), np.empty(n), np.empty((n, 2)),
        np.empty(n), np.empty(n),
    )  # fmt: skip
    k = 0
    for m in range(len(state.tilt)):
        if not state.solved[m]:
            continue
        radial, radius = state.felt[m, 0], pads.pivot_radius[m]
        rows.frame[k], rows.force[k], rows.stiffness[k] = pads.frame[m], state.felt[m], state.felt_stiffness[m]
        rows.pivot_radius[k] = radius
        stiffness, arm = hold_of(case, state, m, radial)
        rows.holding_force[k] = stiffness * state.tilt[m] / radius
        rows.holding_slopes[k, 0], rows.holding_slopes[k, 1] = stiffness / radius, arm / radius
        given = deflection(pads.laws[m], pads.curves[m], max(radial, 0.0))
        rows.missing_deflection[k] = given - state.deflection[m]
        rows.pivot_compliance[k] = compliance(pads.laws[m], pads.curves[m], max(radial, 1e-6))
        k += 1
    residual, shift, moves = eliminate(case.load, rows)
    every = np.zeros((len(state.tilt), 2))
    k = 0
    for m in range(len(state.tilt)):
        if state.solved[m]:
            every[m] = moves[k]
            k += 1
    return residual, shift, every


@inner
def move(
    shapes: Shapes,
    pads: PadStack,
    works: FilmWork,
    state: PadState,
    step: tuple[FloatArray, FloatArray],
    damping: float,
) -> bool:
    """Move journal and pads, no further than lets every film keep a share of its thickness; True if all the way."""
    (grids, bodies), (shift, moves) = shapes, step
    least = math.inf
    for m in range(len(state.tilt)):
        least = min(least, pads.clearance[m])
    longest = LONGEST_STEP * least / max(math.hypot(shift[0], shift[1]), 1e-30)
    scale = min(damping, longest)
    rigid, bending = np.empty((0, 0)), len(bodies.which) > 0
    for m in range(len(state.tilt)):
        if state.solved[m]:
            da = pads.frame[m, 0, 0] * shift[0] + pads.frame[m, 0, 1] * shift[1] - moves[m, 1]
            db = pads.frame[m, 1, 0] * shift[0] + pads.frame[m, 1, 1] * shift[1] + pads.pivot_radius[m] * moves[m, 0]
            if bending:
                change_shape(state, bodies, m, da, db)
            worst = least_share(grid_of(grids, m), work_of(works, m), da, db, state.mismatch[m] if bending else rigid)
            if worst * damping < SHRINK - 1.0:
                scale = min(scale, (SHRINK - 1.0) / worst)
    state.position[0] += scale * shift[0]
    state.position[1] += scale * shift[1]
    for m in range(len(state.tilt)):
        state.tilt[m] += scale * moves[m, 0]
        state.deflection[m] += scale * moves[m, 1]
        if bending and state.solved[m]:
            for i in range(state.bent.shape[1]):
                for j in range(state.bent.shape[2]):
                    change = scale * state.mismatch[m, i, j]
                    state.bent[m, i, j] += change
                    works.extra[m, i, j] += change
    return scale == 1.0
