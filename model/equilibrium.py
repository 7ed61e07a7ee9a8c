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
from numpy.typing import NDArray

from model.film import FilmForces
from model.pad_film import PadFilm, film_step, oil_constants, pad_films
from model.setup import Setup
from model.start import LoadedAttitude, loaded_attitude

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 80
#: Residuals that count as equilibrium: share of the load; metres of the pivots; kelvin of the film.
FORCE_TOLERANCE = 1e-8
TEMPERATURE_TOLERANCE = 1e-5
#: A film may shrink to this share of itself in one step.
SHRINK = 0.4
RELAXATION = 0.88


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
    status : tuple of str
        Named conditions; empty when all is well.
    """

    position: FloatArray
    films: tuple[PadFilm, ...]
    iterations: int
    force_residual: float
    temperature_residual: float
    status: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether the residuals are below the tolerances."""
        return "not converged" not in self.status and "film lost" not in self.status


@dataclass
class _Search:
    """What the Newton iteration carries along."""

    setup: Setup
    load: FloatArray
    speed: float
    films: list[PadFilm]
    tables: list[LoadedAttitude]
    position: FloatArray = field(default_factory=lambda: np.zeros(2))
    limited: float = 0.0
    deformation_change: float = 0.0

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
    films = pad_films(setup)
    tables = [
        loaded_attitude(
            round(float(f.grid.angle[0]), 12), round(float(f.grid.angle[-1]), 12),
            setup.bearing.journal_radius, setup.bearing.length,
        )
        for f in films
    ]  # fmt: skip
    search = _Search(setup, np.asarray(load, float), speed, films, tables)
    if start is not None and _warm_start(search, start):
        result = _iterate(search)
        if result.converged:
            return result
        search.films = pad_films(setup)
    _cold_start(search)
    return _iterate(search)


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
            film.work.extra[:] = other.work.extra
    search.position = start.position.copy()
    return True


def _cold_start(search: _Search) -> None:
    """Balance the load with the tabulated isothermal films, by fixed steps on two scalars."""
    setup, oil = search.setup, search.setup.bearing.oil
    viscosity = float(oil.viscosity(setup.inlet_temperature + (0.0 if setup.thermal == "isothermal" else 3.0)))
    scale = viscosity * search.surface_speed * setup.bearing.journal_radius**2 * setup.bearing.length

    def pull(position: FloatArray) -> FloatArray:
        total = np.zeros(2)
        for film, table in zip(search.films, search.tables):
            reach = film.gap + float(film.normal @ position)
            a = _balanced_approach(film, table, scale, reach, setup.pivots[film.number - 1])
            film.deflection = reach - a
            _, factor = table.at(film.pad.pad_clearance, a)
            if a / (film.pad.pad_clearance - a) > table.least:
                total += film.normal * (scale * factor)
        return total

    size = float(np.hypot(*search.load))
    room = min(f.pad.pad_clearance - f.gap for f in search.films)
    position = search.load / max(size, 1e-30) * 0.4 * room
    if size > 0:
        position = _balance(pull, position, search.load, room)
    else:
        position = np.zeros(2)
    pull(position)
    search.position = position
    for film, table in zip(search.films, search.tables):
        film.work.temperature[:] = film.inlet
        film.work.ruptured[:] = False
        _set_loaded(search, film, table)


def _balanced_approach(film: PadFilm, table: LoadedAttitude, scale: float, reach: float, law) -> float:  # type: ignore[no-untyped-def]
    """Solve a + delta(W(a)) = reach by bisection on the table (W rises with a)."""
    clearance = film.pad.pad_clearance
    low, high = -0.9 * clearance, min(reach, 0.995 * clearance)
    if law.deflection(1.0) == 0.0 or high <= low:
        return reach
    for _ in range(30):
        middle = 0.5 * (low + high)
        _, factor = table.at(clearance, middle)
        carries = middle / (clearance - middle) > table.least and math.isfinite(factor)
        give = law.deflection(scale * factor) if carries else 0.0
        if middle + give > reach:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


def _balance(pull, position: FloatArray, load: FloatArray, room: float) -> FloatArray:  # type: ignore[no-untyped-def]
    """A few damped Newton steps with a finite-difference Jacobian on the tabulated films."""
    size = float(np.hypot(*load))
    step = 1e-3 * room
    for _ in range(25):
        residual = load - pull(position)
        if float(np.hypot(*residual)) < 0.01 * size:
            break
        if not np.all(np.isfinite(residual)):  # a film is gone: go back towards the centre
            position = 0.7 * position
            continue
        jacobian = np.column_stack(
            [(pull(position + step * e) - pull(position - step * e)) / (2 * step) for e in np.eye(2)]
        )
        if not np.all(np.isfinite(jacobian)) or abs(np.linalg.det(jacobian)) < 1e-9 * np.sum(jacobian**2):
            position = position + 0.1 * room * residual / np.hypot(*residual)
            continue
        move = np.linalg.solve(jacobian, residual)
        length = float(np.hypot(*move))
        position = position + move * min(1.0, 0.2 * room / max(length, 1e-30))
    return position


def _set_loaded(search: _Search, film: PadFilm, table: LoadedAttitude) -> None:
    """Put a pad on its loaded attitude for its present approach, or let it idle."""
    a, _ = film.approach(search.position)
    room = film.pad.pad_clearance - a
    curvature = a / room if room > 0 else math.inf
    film.idle = curvature <= table.least + 1e-9
    if film.idle:
        film.deflection = 0.0
        film.tilt = 0.0
        return
    b, _ = table.at(film.pad.pad_clearance, a)
    film.tilt = (b - float(film.tangent @ search.position)) / film.pivot_radius
    film.work.ruptured[:] = False


def _iterate(search: _Search) -> Equilibrium:
    best = math.inf
    stalled = 0
    for iteration in range(1, MAX_ITERATIONS + 1):
        _wake_or_rest(search)
        heat_change = _solve_films(search)
        if any(not f.idle and f.forces is not None and f.forces.steps < 0 for f in search.films):
            return _result(search, iteration, math.inf, heat_change, ("film lost", "not converged"))
        residual, moves = _newton_step(search)
        if residual < FORCE_TOLERANCE and heat_change < TEMPERATURE_TOLERANCE:
            return _result(search, iteration, residual, heat_change, ())
        stalled = 0 if residual < 0.7 * best else stalled + 1
        best = min(best, residual)
        _apply(search, moves, 0.5 if stalled > 12 else 1.0)
    return _result(search, iteration, residual, heat_change, ("not converged",))


def _wake_or_rest(search: _Search) -> None:
    """Pads that have come near enough to carry are given their loaded attitude; others idle."""
    for film, table in zip(search.films, search.tables):
        a, b = film.approach(search.position)
        room = film.pad.pad_clearance - a
        if film.idle:
            if room <= 0 or a / room > table.least + 1e-7:
                _set_loaded(search, film, table)
        elif room > 0 and a / room <= table.least and search.setup.rotational_stiffness == 0:
            film.deflection = 0.0
            a = film.approach(search.position)[0]
            if a / (film.pad.pad_clearance - a) <= table.least:
                film.idle, film.tilt = True, 0.0
            else:
                _set_loaded(search, film, table)


def _solve_films(search: _Search) -> float:
    """One step of every film at the present geometry; returns the largest temperature change asked for."""
    setup, oil = search.setup, search.setup.bearing.oil
    relaxation = 0.0 if setup.thermal == "isothermal" else RELAXATION
    change = 0.0
    search.limited = 0.0
    if setup.carryover:
        _carry_over(search)
    for film in search.films:
        if film.idle:
            film.forces = None
            film.work.pressure[:] = 0.0
            continue
        a, b = film.approach(search.position)
        film.forces, film.temperature_change, limited = film_step(
            film.grid, film.work, (film.pad.pad_clearance, a, b), search.surface_speed,
            oil_constants(oil), (oil.specific_heat, oil.conductivity), (film.inlet, relaxation),
        )  # fmt: skip
        change = max(change, film.temperature_change)
        search.limited = max(search.limited, limited)
    return change


def _carry_over(search: _Search) -> None:
    """Inlet temperature of every pad from the outlet of the one before it (rotation is counter-clockwise)."""
    supply, share = search.setup.inlet_temperature, search.setup.carryover
    order = sorted(search.films, key=lambda f: f.pad.pivot_angle % (2 * math.pi))
    for before, film in zip([order[-1], *order[:-1]], order):
        film.inlet = supply + share * (outlet_temperature(before) - supply)


def outlet_temperature(film: PadFilm) -> float:
    """Flow-weighted temperature at the trailing edge [degC]; an idle pad passes its inlet temperature on."""
    flow = film.work.flow_x[-1]
    total = float(flow.sum())
    if film.idle or total <= 0:
        return film.inlet
    return float(flow @ film.work.temperature[-1]) / total


@dataclass
class _PadMove:
    """Linear response of a pad's (tilt, deflection) to the journal: constant + gradient @ dX."""

    constant: FloatArray
    gradient: FloatArray


def _newton_step(search: _Search) -> tuple[float, tuple[FloatArray, list[_PadMove | None]]]:
    size = max(float(np.hypot(*search.load)), 1.0)
    unbalanced = search.load.copy()
    jacobian = np.zeros((2, 2))
    worst = 0.0
    moves: list[_PadMove | None] = []
    for film in search.films:
        if film.forces is None:
            moves.append(None)
            continue
        move, force, slope, error = _eliminate_pad(search, film, film.forces)
        moves.append(move)
        unbalanced -= force
        jacobian += slope
        worst = max(worst, error / size)
    # a pad that only touches leaves the journal free in one direction: keep the matrix regular
    jacobian += np.eye(2) * (1e-9 * np.trace(jacobian) + 1.0)
    shift = np.linalg.solve(jacobian, unbalanced)
    return max(worst, float(np.hypot(*unbalanced)) / size), (shift, moves)


def _eliminate_pad(
    search: _Search, film: PadFilm, forces: FilmForces
) -> tuple[_PadMove, FloatArray, FloatArray, float]:
    """Solve the pad's two equations for its tilt and deflection in terms of the journal's move.

    Returns the move, the force at the journal's present place after the pad has moved, its slope, and the pad's
    own residual as a force [N].
    """
    law = search.setup.pivots[film.number - 1]
    radial, tangential = forces.force
    k = forces.stiffness
    hold = search.setup.rotational_stiffness / film.pivot_radius
    compliance = 1.0 / law.stiffness(max(radial, 1e-6))
    moment = tangential + hold * film.tilt
    give = law.deflection(max(radial, 0.0)) - film.deflection
    # d(a, b) = frame @ dX + motion @ (dt, deta)
    frame = np.vstack([film.normal, film.tangent])
    motion = np.array([[0.0, -1.0], [film.pivot_radius, 0.0]])
    response = k @ motion
    matrix = np.array(
        [
            [response[1, 0] + hold, response[1, 1]],
            [-compliance * response[0, 0], 1.0 - compliance * response[0, 1]],
        ]
    )
    right = np.array([[-moment], [give]])
    drive = np.vstack([-(k @ frame)[1], compliance * (k @ frame)[0]])
    solved = np.linalg.solve(matrix, np.hstack([right, drive]))
    move = _PadMove(solved[:, 0], solved[:, 1:])
    force = frame.T @ (forces.force + response @ move.constant)
    slope = frame.T @ (k @ frame + response @ move.gradient)
    return move, force, slope, max(abs(moment), abs(give) * abs(k[0, 0]))


def _apply(search: _Search, step: tuple[FloatArray, list[_PadMove | None]], damping: float) -> None:
    """Move journal and pads, no further than lets every film keep a share of its thickness."""
    shift, moves = step
    scale = damping
    for film, move in zip(search.films, moves):
        if move is not None:
            scale = min(scale, _allowed(film, move, shift, damping))
    search.position = search.position + scale * shift
    for film, move in zip(search.films, moves):
        if move is not None:
            tilt, deflection = scale * (move.constant + move.gradient @ shift)
            film.tilt += float(tilt)
            film.deflection += float(deflection)


def _allowed(film: PadFilm, move: _PadMove, shift: FloatArray, damping: float) -> float:
    tilt, deflection = move.constant + move.gradient @ shift
    da = float(film.normal @ shift) - deflection
    db = float(film.tangent @ shift) + film.pivot_radius * tilt
    change = -(da * film.grid.cos + db * film.grid.sin)
    thickness = film.work.thickness.min(axis=1)
    worst = float(np.min(change / thickness))
    return damping if worst * damping > SHRINK - 1.0 else (SHRINK - 1.0) / worst


def _result(search: _Search, iterations: int, residual: float, heat: float, status: tuple[str, ...]) -> Equilibrium:
    names = list(status)
    idle = [f.number for f in search.films if f.idle]
    if idle:
        names.append("idle pads " + ", ".join(map(str, idle)))
    if search.limited > 0:
        names.append("flow back at a leading edge")
    return Equilibrium(search.position.copy(), tuple(search.films), iterations, residual, heat, tuple(names))
