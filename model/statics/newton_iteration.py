"""One Newton iteration for journal, tilts and pivot deflections, from a start to an equilibrium or a named failure.

The films' own derivatives with respect to (a, b) are the Jacobian; temperature and pad deformation follow one step
behind and contract by a factor of about ten per iteration.
"""

from __future__ import annotations

import math

import numpy as np

from model.conditions import has_answer
from model.film.oil_state import least_share
from model.statics import conditions
from model.statics.acceleration import Anderson
from model.statics.axial_tilt import axial_shape, shape_change
from model.statics.carrying import leave_unstable, longest_step, unloaded_pads, update_carrying
from model.statics.compiled.constants import (
    ACROSS,
    BOUNDLESS,
    HEAT_PER_FORCE,
    MAX_ITERATIONS,
    NEAR,
    NEAR_HEAT,
    PATIENCE,
    PROGRESS,
    RELAXATION,
    SHRINK,
    SLOW,
    SLOW_ACROSS,
)
from model.statics.equilibrium import Equilibrium
from model.statics.film_step import refine_derivatives, solve_films
from model.statics.newton_step import newton_step
from model.statics.search import Search
from rigdata.arrays import FloatArray
from rigdata.problem import Condition

#: A pad that tilts by this share of the largest tilt in the last step swings, too.
_SWINGING = 0.3


def iterate(search: Search) -> Equilibrium:
    """Iterate from where a search stands."""
    best, residual, heat, stalled = math.inf, math.inf, math.inf, 0
    left = best_left = math.inf
    memory, setup = Anderson(), search.setup
    isothermal = setup.thermal == "isothermal" and not setup.flexible_pads
    # a film with temperatures across knows that it makes less heat when it is hotter: it does not swing
    across = setup.thermal == "thd"
    relaxed, slow = (1.0, SLOW_ACROSS) if across else (RELAXATION, SLOW)
    accuracy = setup.accuracy * (ACROSS if across else 1.0)
    search.relaxation = 1.0 if search.warm else relaxed
    for iteration in range(1, MAX_ITERATIONS + 1):
        if update_carrying(setup, search.films, search.position, search.surface_speed):
            memory.reset()
        before = search.vector() if left > slow * best_left and not isothermal else None
        heat = solve_films(search)
        if not heat < BOUNDLESS:
            lost = any(f.lost for f in search.films)
            return _failed(search, iteration, heat, conditions.FILM_LOST if lost else conditions.BOUNDLESS_HEAT)
        residual, shift, moves = newton_step(setup, search.load, search.films)
        if not (math.isfinite(residual) and np.isfinite([*search.position, *shift]).all() and np.isfinite(moves).all()):
            return _failed(search, iteration, heat, conditions.SINGULAR)
        best_left, left = min(best_left, left), max(residual, heat / HEAT_PER_FORCE)
        near = residual < NEAR and heat < NEAR_HEAT
        search.relaxation = 1.0 if near else relaxed
        if residual < accuracy and heat < HEAT_PER_FORCE * accuracy:
            if not leave_unstable(setup, search.films, search.position):
                return _settled(search, iteration, residual, heat)
            memory.reset()
            continue
        stalled = 0 if residual < PROGRESS * best else stalled + 1
        best = min(best, residual)
        whole = _move(search, (shift, moves), 0.5 if stalled > PATIENCE else 1.0)
        # steps that were cut short, or still far off, say nothing of the iteration's slow modes
        if before is not None and whole and near and left > slow * best_left:
            search.set_vector(memory.next(before, search.vector()))
        else:
            memory.reset()
    status = (*(conditions.never_at_rest(search.films) or _swinging(search, moves[:, 0])), conditions.NOT_CONVERGED)
    return ended(search, (MAX_ITERATIONS, residual, heat), status)


def _swinging(search: Search, tilts: FloatArray) -> tuple[Condition, ...]:
    """Names the pads with friction that the last step moved most."""
    if not search.setup.friction:
        return ()
    most = _SWINGING * float(np.abs(tilts).max())
    pads = [f.number for f, tilt in zip(search.films, tilts.tolist(), strict=True) if abs(tilt) >= most]
    return (conditions.stick_and_slip(pads),)


def _move(search: Search, step: tuple[FloatArray, FloatArray], damping: float) -> bool:
    """Move journal and pads, no further than lets every film keep a share of its thickness; True if all the way."""
    shift, moves = step
    scale = min(damping, longest_step(search.films, shift))
    bent: list[tuple[FloatArray, float]] = []
    for film, move in zip(search.films, moves, strict=True):
        bent.append((_RIGID, 0.0))
        if film.forces is None:
            continue
        da = float(film.normal @ shift) - move[1] + film.closing
        db = float(film.tangent @ shift) + film.pivot_radius * move[0]
        if film.step is not None:
            bent[-1] = shape_change(search.setup, film, da, db)
        worst = least_share(film.grid, film.work, da, db, bent[-1][0])
        if worst * damping < SHRINK - 1.0:
            scale = min(scale, (SHRINK - 1.0) / worst)
    search.position = search.position + scale * shift
    search.grow(scale)
    for film, move, (change, axial) in zip(search.films, moves, bent, strict=True):
        # a pad that friction stops where it does not tilt stops there, whatever the step's length
        film.tilt = 0.0 if move[0] == -film.tilt else film.tilt + float(scale * move[0])
        film.deflection += float(scale * move[1])
        if change.size:
            film.work.extra[:] += scale * change
            film.bent += scale * (change - axial * axial_shape(film.grid) if search.setup.pads_follow else change)
            film.axial_tilt += scale * axial
    return scale == 1.0


#: What the film's thickness changes by besides its (a, b), where the pads are rigid.
_RIGID = np.empty((0, 0))


def _settled(search: Search, iterations: int, residual: float, heat: float) -> Equilibrium:
    """What an iteration ends with whose residuals are below the tolerances."""
    status = settled_status(search)
    if has_answer(status):
        refine_derivatives(search)
    return ended(search, (iterations, residual, heat), status)


def settled_status(search: Search) -> tuple[Condition, ...]:
    """What is to be said of pads that idle where an iteration has settled."""
    staying, restarting = unloaded_pads(search.films, search.position)
    if search.held:  # without friction they would carry
        staying = sorted(staying + [k for k in restarting if k in search.held])
        restarting = [k for k in restarting if k not in search.held]
    if restarting:
        return (conditions.undecided(restarting), conditions.NOT_CONVERGED)
    return (conditions.left_unloaded(staying),) if staying else ()


def _failed(search: Search, iterations: int, heat: float, why: Condition) -> Equilibrium:
    return ended(search, (iterations, math.inf, heat), (why, conditions.NOT_CONVERGED))


def ended(search: Search, figures: tuple[int, float, float], status: tuple[Condition, ...]) -> Equilibrium:
    """The state as an answer."""
    names = list(status)
    for film in search.films:
        film.rest(search.position, search.surface_speed, search.setup.bearing.oil)
    found = has_answer(names)
    if not found and conditions.unsupported(search.setup, search.load):
        names.insert(0, conditions.UNSUPPORTED)
    overloaded = conditions.overloaded_pads(search.films)
    if overloaded and found:
        names.append(conditions.overloaded(overloaded))
    idle = [f.number for f in search.films if f.idle]
    if idle:
        names.append(conditions.idle(idle))
    if search.limited > 0:
        names.append(conditions.FLOW_BACK)
    names += conditions.regimes(search.setup, search.films, search.surface_speed)
    return Equilibrium(
        search.position.copy(), tuple(search.films), *figures, search.journal, tuple(names), search.surface_speed
    )
