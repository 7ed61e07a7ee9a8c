"""From a search to the arrays of a compiled one and back, where the compiled one knows all of the physics."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np

from model.film.loaded_attitude import Branch, LoadedAttitude
from model.film.reynolds import FilmForces
from model.options import Options
from model.pad.bending import SHAPES
from model.setup import Setup
from model.statics import conditions
from model.statics.carrying import attitude_of
from model.statics.compiled.bending import BodyStack, Shapes, stacked_bodies
from model.statics.compiled.carrying import Case
from model.statics.compiled.iteration import BOUNDLESS_HEAT, FILM_LOST, RESTARTING, SETTLED, SINGULAR, iterate
from model.statics.compiled.laws import encoded
from model.statics.compiled.stack import PadStack, PadState, stacked_grids
from model.statics.equilibrium import Equilibrium
from model.statics.newton_iteration import ended, settled_status
from model.statics.search import Search
from model.statics.tilt_hold import rolling_radius
from rigdata.arrays import FloatArray, IntArray

#: Parts of a set-up that the compiled search takes into account, or that do not concern it; any other one must be at
#: its default.
_KNOWN = frozenset({
    "bearing", "pivots", "thermal", "mesh", "supply_change", "options", "rotational_stiffness", "pivot_damping",
    "misalignment", "starvation", "rolling", "vibration", "heat_loss", "bending", "series_compliance", "added_mass",
    "parallel_stiffness", "parallel_damping", "instruments", "clearance_change", "accuracy", "grown",
})  # fmt: skip
_DEFAULTS = {
    f.name: f.default for f in dataclasses.fields(Setup) if f.name not in _KNOWN
}  # those of others are no factories
_PLAIN = Options()


def able(setup: Setup) -> bool:
    """Whether the compiled search knows all of a set-up's physics."""
    if setup.thermal == "thd" or _felt(setup) != _PLAIN:
        return False
    if any(getattr(setup, name) != value for name, value in _DEFAULTS.items()):
        return False
    return encoded(setup.pivots) is not None


def _felt(setup: Setup) -> Options:
    """Options without those that do nothing in the statics, or where films keep their inlet's temperature."""
    options = dataclasses.replace(setup.options, perturbed_heat=False, perturbed_bending=False)
    if not setup.pads_follow:
        options = dataclasses.replace(options, axial_tilt=False)
    if setup.grown:
        options = dataclasses.replace(options, growth=None)
    if setup.thermal != "isothermal":
        return options
    return dataclasses.replace(options, conduction=False, isothermal_journal=False)


def iterate_at_once(search: Search, cold: bool) -> Equilibrium:
    """Iterate from where a search stands, or from a cold start, in one compiled call."""
    setup, films = search.setup, search.films
    pads = _pads(search)
    state = _state(search, pads.attitudes.shape[2])
    roll = setup.rolling * rolling_radius(setup.bearing.pivot) if setup.rolling else 0.0
    size = setup.bearing.journal_radius**2 * setup.bearing.length
    running = films[0].running(search.surface_speed, setup.bearing.oil)
    hold = (float(setup.rotational_stiffness), roll)
    case = Case(search.load, running, hold, size, setup.accuracy, setup.thermal == "isothermal")
    shapes = Shapes(stacked_grids(tuple(f.grid for f in films)), _bodies(search))
    code, iterations, residual, heat, limited = iterate(shapes, pads, search.works, state, case, cold)
    _take_over(search, state)
    search.limited = limited
    figures = iterations, residual, heat
    if code in (SETTLED, RESTARTING):
        return ended(search, figures, settled_status(search))
    names = {
        FILM_LOST: conditions.FILM_LOST, BOUNDLESS_HEAT: conditions.BOUNDLESS_HEAT, SINGULAR: conditions.SINGULAR,
    }  # fmt: skip
    why = (names[code],) if code in names else conditions.never_at_rest(films)
    return ended(search, figures, (*why, conditions.NOT_CONVERGED))


def _pads(search: Search) -> PadStack:
    setup, films = search.setup, search.films
    known = encoded(setup.pivots)
    assert known is not None
    attitudes, rows = _tables(tuple(attitude_of(setup, f) for f in films))
    count = len(films)
    frame = np.empty((count, 2, 2))
    for m, f in enumerate(films):
        frame[m, 0], frame[m, 1] = f.normal, f.tangent
    numbers = [(f.preload_distance, f.pivot_radius, f.pad.pad_clearance, f.inlet) for f in films]
    preload, radius, clearance, inlet = np.array(numbers, dtype=float).T.copy()
    pivot = np.array([_pivot_station(f.grid.angle) for f in films])
    return PadStack(frame, preload, radius, clearance, inlet, pivot, *known, attitudes, rows)


def _pivot_station(angle: FloatArray) -> tuple[float, float]:
    """Station before the pivot, at angle 0, and how far on to the next one it is; the nearest end where none is."""
    before = min(max(int(np.searchsorted(angle, 0.0, side="right")) - 1, 0), len(angle) - 2)
    return before, min(max(-angle[before] / (angle[before + 1] - angle[before]), 0.0), 1.0)


def _bodies(search: Search) -> BodyStack:
    films, setup = search.films, search.setup
    given = tuple(f.deformation for f in films if f.deformation is not None and setup.flexible_pads)
    grid = films[0].grid
    return stacked_bodies(given, (grid.first, len(grid.z)), setup.bending_factor, setup.inlet_temperature)


@lru_cache(maxsize=64)
def _tables(attitudes: tuple[LoadedAttitude, ...]) -> tuple[FloatArray, IntArray]:
    longest = max(2, *(len(a.curvature) for a in attitudes))
    table = np.zeros((len(attitudes), 3, longest))
    for row, a in zip(table, attitudes, strict=True):
        row[:, : len(a.curvature)] = a.curvature, a.wedge, a.load
    return table, np.array([len(a.curvature) for a in attitudes], dtype=np.int64)


def _state(search: Search, longest: int) -> PadState:
    films = search.films
    n = len(films)
    bent = np.array([f.bent for f in films]) if search.setup.flexible_pads else np.zeros((n, 0, 0))
    return PadState(
        position=np.array(search.position, dtype=float),
        tilt=np.array([f.tilt for f in films], dtype=float),
        deflection=np.array([f.deflection for f in films], dtype=float),
        idle=np.array([f.idle for f in films], dtype=np.bool_),
        solved=np.zeros(n, dtype=np.bool_),
        changes=np.array([f.load_changes for f in films], dtype=np.int64),
        branch=np.zeros((n, 4, longest)),
        length=np.zeros(n, dtype=np.int64),
        wedge=np.zeros((n, 2)),
        force=np.zeros((n, 2)),
        corrected=np.zeros((n, 2)),
        stiffness=np.zeros((n, 2, 2)),
        damping=np.zeros((n, 2, 2)),
        least=np.zeros(n),
        steps=np.zeros(n, dtype=np.int64),
        heating=np.full(n, np.inf),
        shift=search.shifts,
        felt=np.zeros((n, 2)),
        felt_stiffness=np.zeros((n, 2, 2)),
        bent=bent,
        mismatch=np.zeros_like(bent),
        amplitude=np.zeros((n, SHAPES, 3)),
    )


def _take_over(search: Search, state: PadState) -> None:
    """Leave a search where the arrays stand."""
    search.position = state.position
    scalars = zip(
        state.tilt.tolist(), state.deflection.tolist(), state.idle.tolist(), state.changes.tolist(),
        state.heating.tolist(), state.solved.tolist(), state.least.tolist(), state.steps.tolist(),
        state.length.tolist(), strict=True,
    )  # fmt: skip
    for m, (f, (tilt, give, idle, changes, heating, solved, least, steps, rows)) in enumerate(
        zip(search.films, scalars, strict=True)
    ):
        f.tilt, f.deflection, f.idle, f.load_changes, f.temperature_change = tilt, give, idle, changes, heating
        f.forces = f.corrected = None
        if search.setup.flexible_pads:
            f.bent = state.bent[m]
        if solved:
            f.forces = FilmForces(state.force[m], state.stiffness[m], state.damping[m], least, steps)
            f.corrected = FilmForces(state.corrected[m], *f.forces[1:])
        f.branch = Branch(*state.branch[m, :, :rows]) if rows else None
