"""Static equilibrium, Eq. (1): journal position, pad tilts and pivot deflections, found by one Newton iteration.

Per pad two equations stand beside the two of the journal: the film's moment about the pivot vanishes (or is held
by k_theta), and the pivot has given way by delta(W). They are eliminated pad by pad, which leaves two equations
for the journal. The films' own derivatives with respect to (a, b) are the Jacobian; temperature and pad
deformation follow one step behind and contract by a factor of about ten per iteration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from model.arrays import FloatArray
from model.bearing import Oil
from model.conditions import Condition, has_answer
from model.film.oil_state import least_share
from model.pad.bending import bending_step, change_of_shape, wanted_shapes
from model.setup import Setup
from model.statics.acceleration import Anderson
from model.statics.carrying import (
    MAX_FLIPS,
    find_branch,
    leave_unstable,
    longest_step,
    set_loaded,
    shed_pads,
    shorten,
    wake_or_rest,
)
from model.statics.conditions import (
    BOUNDLESS_HEAT,
    FILM_LOST,
    FLOW_BACK,
    NOT_CONVERGED,
    SINGULAR,
    UNSUPPORTED,
    idle,
    left_unloaded,
    overloaded,
    overloaded_pads,
    regimes,
    restless,
    torn,
    unsupported,
)
from model.statics.first_position import first_position
from model.statics.heat_paths import BOUNDLESS, couples_heat, settle_temperatures
from model.statics.newton_step import newton_step
from model.statics.pad_film import PadFilm, pad_films

MAX_ITERATIONS = 80
#: Film temperatures count as settled when one more step would change them by this times `Setup.accuracy` [K].
HEAT_PER_FORCE = 300.0
#: Below this residual the iteration is accelerated; above it the temperature is held back, because a much hotter
#: film carries less and heats less: undamped, the two would swing.
NEAR = 0.3
NEAR_HEAT = 25.0
HELD_BACK = 0.6
#: Steps that leave more than this share of what was left are accelerated; the others need no help.
SLOW = 0.4
#: Largest change of a film temperature in one step [K].
HEATING_STEP = 15.0
#: A film may shrink to this share of itself in one step.
SHRINK = 0.4


@dataclass(frozen=True)
class Equilibrium:
    """A static solution.

    Attributes
    ----------
    position : (2,) ndarray
        Journal centre from the bearing centre [m].
    films : tuple of PadFilm
        Pads with their films, as they stand.
    iterations : int
    force_residual : float
        Share of the load (or of 1 N) that is not balanced.
    temperature_residual : float
        Largest change that one more step would make [K].
    journal_temperature : float
        [degC]; NaN where the journal takes no heat.
    status : tuple of Condition
        Named conditions; empty when all is well.
    """

    position: FloatArray
    films: tuple[PadFilm, ...]
    iterations: int
    force_residual: float
    temperature_residual: float
    journal_temperature: float
    status: tuple[Condition, ...]

    @property
    def converged(self) -> bool:
        """Whether the residuals are below the tolerances."""
        return has_answer(self.status)

    @property
    def mean_journal_temperature(self) -> float:
        """The journal's temperature, or the mean over the films that carry where it takes no heat [degC]."""
        if math.isfinite(self.journal_temperature):
            return self.journal_temperature
        carrying = [f for f in self.films if not f.idle]
        if not carrying:
            return self.films[0].inlet
        area = sum(float(f.grid.area.sum()) for f in carrying)
        return sum(float((f.grid.area * f.work.temperature).sum()) for f in carrying) / area


@dataclass
class _Search:
    """What the Newton iteration carries along."""

    setup: Setup
    load: FloatArray
    speed: float
    films: list[PadFilm]
    position: FloatArray = field(default_factory=lambda: np.zeros(2))
    limited: float = 0.0
    journal: float = math.nan
    relaxation: float = HELD_BACK

    @property
    def surface_speed(self) -> float:
        return self.speed * self.setup.bearing.journal_radius


def solve_equilibrium(setup: Setup, load: FloatArray, speed: float, start: Equilibrium | None = None) -> Equilibrium:
    """Find where the journal stands.

    Parameters
    ----------
    setup : Setup
    load : (2,) ndarray
        Static load on the shaft [N]; the film pushes the housing with the same force.
    speed : float
        Shaft speed [rad/s], counter-clockwise, positive.
    start : Equilibrium, optional
        A neighbouring solution on the same mesh (warm start).

    Returns
    -------
    Equilibrium
        ``status`` names what is wrong, if anything is.
    """
    search = _Search(setup, np.asarray(load, float), speed, pad_films(setup))
    if start is not None and _warm_start(search, start):
        result = _iterate(search)
        if result.converged:
            return result
        search.films = pad_films(setup)
    _cold_start(search)
    result = _iterate(search)
    return result if result.converged else _approach_by_steps(search, result)


def _approach_by_steps(search: _Search, failed: Equilibrium) -> Equilibrium:
    """Raise the load in steps, each started from the one before: hot, thin films are far from the isothermal guess."""
    load, reached, step = search.load.copy(), 0.0, 0.25
    last: Equilibrium | None = None
    while reached < 1.0 and step > 0.02:
        share = min(1.0, reached + step)
        search.load = share * load
        search.films = pad_films(search.setup)
        if last is None or not _warm_start(search, last):
            _cold_start(search)
        result = _iterate(search)
        if result.converged:
            last, reached = result, share
        else:
            step *= 0.5
    search.load = load
    return last if last is not None and reached == 1.0 else failed


def _warm_start(search: _Search, start: Equilibrium) -> bool:
    """Take over a neighbour's state; False if its mesh does not fit."""
    if len(start.films) != len(search.films) or not start.converged:
        return False
    for film, other in zip(search.films, start.films):
        if film.work.pressure.shape != other.work.pressure.shape:
            return False
        film.tilt, film.deflection, film.idle = other.tilt, other.deflection, other.idle
        film.work.temperature[:] = other.work.temperature
        film.work.ruptured[:] = other.work.ruptured
        film.work.pressure[:] = other.work.pressure
        if search.setup.flexible_pads:
            film.bent[:] = other.bent
            film.work.extra[:] += other.bent
    search.position = start.position.copy()
    return True


def _cold_start(search: _Search) -> None:
    """Balance the load with the tabulated isothermal films, then put every pad on its loaded attitude."""
    warmer = 0.0 if search.setup.thermal == "isothermal" else 3.0
    branches = []
    for film in search.films:
        film.work.temperature[:] = film.inlet
        film.branch = find_branch(search.setup, film, search.surface_speed, warmer)
        branches.append(film.branch)
    normals, gaps = np.array([f.normal for f in search.films]), np.array([f.gap for f in search.films])
    search.position = first_position(search.load, normals, gaps, branches)
    for film in search.films:
        set_loaded(film, search.position)


def _iterate(search: _Search) -> Equilibrium:
    best, residual, stalled = math.inf, math.inf, 0
    left = best_left = math.inf
    memory = Anderson()
    accuracy = search.setup.accuracy
    isothermal = search.setup.thermal == "isothermal" and not search.setup.flexible_pads
    for iteration in range(1, MAX_ITERATIONS + 1):
        if wake_or_rest(search.setup, search.films, search.position, search.surface_speed):
            memory.reset()
        before = _state(search) if left > SLOW * best_left and not isothermal else None
        heat_change = _solve_films(search)
        if not heat_change < BOUNDLESS:
            name = FILM_LOST if any(f.lost for f in search.films) else BOUNDLESS_HEAT
            return _result(search, iteration, math.inf, heat_change, (name, NOT_CONVERGED))
        residual, shift, moves = newton_step(search.setup, search.load, search.films)
        if not (math.isfinite(residual) and np.isfinite([*search.position, *shift]).all() and np.isfinite(moves).all()):
            return _result(search, iteration, math.inf, heat_change, (SINGULAR, NOT_CONVERGED))
        best_left, left = min(best_left, left), max(residual, heat_change / HEAT_PER_FORCE)
        near = residual < NEAR and heat_change < NEAR_HEAT
        search.relaxation = 1.0 if near else HELD_BACK
        if residual < accuracy and heat_change < HEAT_PER_FORCE * accuracy:
            if leave_unstable(search.setup, search.films, search.position):
                memory.reset()
                continue
            resting, restarting = shed_pads(search.films, search.position)
            if restarting:
                return _result(search, iteration, residual, heat_change, (torn(restarting), NOT_CONVERGED))
            _sharpen(search)
            names = (left_unloaded(resting),) if resting else ()
            return _result(search, iteration, residual, heat_change, names)
        stalled = 0 if residual < 0.7 * best else stalled + 1
        best = min(best, residual)
        whole = _apply(search, (shift, moves), 0.5 if stalled > 12 else 1.0)
        # steps that were cut short, or still far off, say nothing of the iteration's slow modes
        if before is not None and whole and near and left > SLOW * best_left:
            _set_state(search, memory.next(before, _state(search)))
        else:
            memory.reset()
    flipping = [f.number for f in search.films if f.flips >= MAX_FLIPS]
    names = (restless(flipping),) if flipping else ()
    return _result(search, iteration, residual, heat_change, (*names, NOT_CONVERGED))


#: Scale of lengths in the state that is accelerated [m]: a micrometre weighs as much as a kelvin.
_MICRO = 1e-6


def _state(search: _Search) -> FloatArray:
    """Journal, pads and film temperatures as one vector, in micrometres and kelvins."""
    parts = [search.position / _MICRO]
    for film in search.films:
        parts.append(np.array([film.tilt * film.pivot_radius, film.deflection]) / _MICRO)
        parts.append(film.work.temperature.ravel() * (0.0 if film.idle else 1.0))
        if search.setup.flexible_pads:
            parts.append(film.bent.ravel() / _MICRO)
    return np.concatenate(parts)


def _set_state(search: _Search, state: FloatArray) -> None:
    search.position = state[:2] * _MICRO
    at = 2
    for film in search.films:
        film.tilt = float(state[at]) * _MICRO / film.pivot_radius
        film.deflection = float(state[at + 1]) * _MICRO
        at += 2
        size = film.work.temperature.size
        if not film.idle:
            film.work.temperature.ravel()[:] = state[at : at + size]
        at += size
        if search.setup.flexible_pads:
            bent = state[at : at + size].reshape(film.bent.shape) * _MICRO
            film.work.extra[:] += bent - film.bent
            film.bent[:] = bent
            at += size


def _solve_films(search: _Search) -> float:
    """One step of every film at the present geometry; returns the largest temperature change asked for."""
    setup, oil = search.setup, search.setup.bearing.oil
    search.limited = 0.0
    for film in search.films:
        if not film.idle:
            _solve_pressure(search, film)
        if film.idle:
            film.forces = film.foreseen = film.step = None
            film.work.pressure[:] = 0.0
    if any(f.lost for f in search.films):
        return math.inf  # what has no pressure has no flow that could carry heat
    change = 0.0
    if setup.thermal != "isothermal":
        change = _warm_films(search, [f for f in search.films if f.forces is not None and f.forces.steps > 0], oil)
    if setup.flexible_pads and change < BOUNDLESS:
        # a deformation counts like a temperature change of the same weight in the film's resistance
        change = max(change, HEAT_PER_FORCE * _bend_pads(search))
    return change


def _solve_pressure(search: _Search, film: PadFilm) -> None:
    """Pressure of one film; on its loaded attitude, where it has slipped off that."""
    oil = search.setup.bearing.oil
    film.solve(search.position, search.surface_speed, oil)
    assert film.forces is not None
    if film.forces.steps > 0 and not film.forces.force[0] > 0.0 and search.setup.rotational_stiffness == 0:
        # the unloaded attitude, in which nothing holds the pad: the loaded one counts
        set_loaded(film, search.position)
        if not film.idle:
            film.solve(search.position, search.surface_speed, oil)
            film.idle = not film.forces.force[0] > 0.0


def _warm_films(search: _Search, carrying: list[PadFilm], oil: Oil) -> float:
    """Temperatures of the films that carry; returns the largest change asked for [K]."""
    limits = (search.relaxation, HEATING_STEP)
    if not couples_heat(search.setup):
        search.limited = max((f.warm(search.surface_speed, oil, limits) for f in carrying), default=0.0)
        return max((f.temperature_change for f in carrying), default=0.0)
    for film in search.films:
        film.rest(search.position, search.surface_speed, oil)
    change, search.limited, search.journal = settle_temperatures(
        search.setup, search.films, search.surface_speed, search.journal, limits
    )
    for film in carrying:
        film.foresee(search.surface_speed, oil)
    return change


def _bend_pads(search: _Search) -> float:
    """Let every pad ask for the deformation its film gives it; returns the largest change over the least film."""
    setup = search.setup
    carrying = [f for f in search.films if f.forces is not None and f.forces.steps > 0]
    gives = [f.give for f in carrying if f.give is not None]
    pressures = [f.foreseen_pressure() for f in carrying]
    rises = [f.work.temperature - setup.inlet_temperature for f in carrying]
    wanted = wanted_shapes(gives, pressures, rises, setup.bending_factor)
    share = 0.0
    for film, give, shape in zip(carrying, gives, wanted, strict=True):
        assert film.foreseen is not None
        wedge = (film.pad.pad_clearance, *film.approach(search.position))
        film.step = bending_step(
            give, film.grid, film.work, wedge, film.foreseen, shape - film.bent, setup.bending_factor
        )
        share = max(share, film.step.share)
    return share


def _sharpen(search: _Search) -> None:
    """Derivatives once more, with the rupture line between the nodes; the pressure stays."""
    for film in search.films:
        if film.forces is not None:
            wedge = (film.pad.pad_clearance, *film.approach(search.position))
            film.forces = film.solver(film.grid, film.work, wedge, search.surface_speed, True)


def _apply(search: _Search, step: tuple[FloatArray, FloatArray], damping: float) -> bool:
    """Move journal and pads, no further than lets every film keep a share of its thickness; True if all the way."""
    shift, moves = step
    scale = min(damping, longest_step(search.films, shift))
    bent: list[FloatArray | None] = []
    for film, move in zip(search.films, moves, strict=True):
        bent.append(None)
        if film.forces is None:
            continue
        da = float(film.normal @ shift) - move[1]
        db = float(film.tangent @ shift) + film.pivot_radius * move[0]
        if film.give is not None and film.step is not None:
            bent[-1] = change_of_shape(film.give, film.step, da, db)
        worst = least_share(film.grid, film.work, da, db, _NO_CHANGE if bent[-1] is None else bent[-1])
        if worst * damping < SHRINK - 1.0:
            scale = min(scale, (SHRINK - 1.0) / worst)
    scale = shorten(search.films, search.position, shift, scale)
    search.position = search.position + scale * shift
    for film, move, change in zip(search.films, moves, bent, strict=True):
        film.tilt += float(scale * move[0])
        film.deflection += float(scale * move[1])
        if change is not None:
            film.bent += scale * change
            film.work.extra[:] += scale * change
    return scale == 1.0


#: What the film's thickness changes by besides its (a, b), where the pads are rigid.
_NO_CHANGE = np.empty((0, 0))


def _result(
    search: _Search, iterations: int, residual: float, heat: float, status: tuple[Condition, ...]
) -> Equilibrium:
    names = list(status)
    for film in search.films:
        film.rest(search.position, search.surface_speed, search.setup.bearing.oil)
    found = has_answer(names)
    if not found and unsupported(search.setup, search.load):
        names.insert(0, UNSUPPORTED)
    beyond = overloaded_pads(search.films)
    if beyond and found:
        names.append(overloaded(beyond))
    resting = [f.number for f in search.films if f.idle]
    if resting:
        names.append(idle(resting))
    if search.limited > 0:
        names.append(FLOW_BACK)
    names += regimes(search.setup, search.films, search.surface_speed)
    return Equilibrium(
        search.position.copy(), tuple(search.films), iterations, residual, heat, search.journal, tuple(names)
    )
