"""Find a static equilibrium, Eq. (1): from a neighbour, from the curves of its pads, or by raising load or heat."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from model.conditions import named, pads_of, said
from model.setup import Setup
from model.statics import conditions
from model.statics.equilibrium import Equilibrium
from model.statics.pad_flow import starved
from model.statics.physics import couples_heat
from model.statics.search import Search
from rigdata.arrays import FloatArray

#: First share of the load or the heat, where the whole of it finds no equilibrium at once, and the least step on.
_FIRST_SHARE, _LEAST_STEP = 0.25, 0.02
#: Share of the clearance within which the curve of a pad may be wrong about its fold, because its mesh is coarse; and
#: because pads bend or drink hot oil. Within it the film is tried: this costs time, and decides nothing.
_NEAR, _NEAR_SOFT = 0.02, 0.1
#: Share of the clearance from a fold within which the mesh decides whether a pad carries.
_EDGE = 3e-4
#: Pads whose sets are tried one by one where nothing else finds an equilibrium: 57 sets of six.
_MOST_PADS = 6


def solve_equilibrium(
    setup: Setup, load: FloatArray, speed: float, start: Equilibrium | None = None, patient: bool = True
) -> Equilibrium:
    """Find where the journal stands: `load` (2,) [N]; `patient`: by raising load or heat too, where nothing else does.

    That takes some hundred times as long as an equilibrium from a neighbour.
    """
    load = np.asarray(load, float)
    warm = None
    if start is not None:
        search = Search(setup, load, speed)
        if search.start_from(start):
            warm = _settled(search, search.run())
            # where pads are left idle that could carry, another start may leave others
            loose = pads_of("pads {pads} cannot keep their load", warm.status)
            if warm.converged and not loose and sum(f.idle for f in warm.films) <= np.isnan(search.begun.tilt).sum():
                return warm
    search = Search(setup, load, speed).stand()
    near = [m for m, above in enumerate(search.margins()) if abs(above) < _NEAR and not search.pads["idle"][m]]
    result = _settled(search, search.run())
    if near and not result.converged:  # they may find no rest where they carry
        search = Search(setup, load, speed).stand()
        search.let_idle(near)
        other = _settled(search, search.run())
        result = other if other.converged or len(other.status) > len(result.status) else result
    if not result.converged and warm is not None and warm.converged:
        return warm
    for attempt in _ATTEMPTS:
        if patient and not result.converged:
            result = attempt(setup, load, speed, result)
    return result


def _try_sets(setup: Setup, load: FloatArray, speed: float, failed: Equilibrium) -> Equilibrium:
    """Try every set of two pads or more, those with the most first; where none finds rest, that is named.

    Only where which pads carry is all that is in doubt, in films that are soon solved and lost none.
    """
    count = len(failed.films)
    few = count <= _MOST_PADS and not setup.flexible_pads and not couples_heat(setup)
    found_out = (c.severity == "error" and c != "not converged" and not c.pads for c in failed.status)
    if not few or setup.friction or setup.rotational_stiffness or any(found_out):
        return failed
    for size in range(count, 1, -1):
        for pads in itertools.combinations(range(count), size):
            search = Search(setup, load, speed).stand()
            loaded = np.isin(np.arange(count), pads)
            search.load_pads(loaded & (search.pads["rows"] >= 2))
            search.let_idle(np.flatnonzero(~loaded).tolist())
            result = _settled(search, search.run())
            if result.converged:
                return result
    return replace(failed, status=(*failed.status, named("no set of pads finds rest")))


def _settled(search: Search, result: Equilibrium, held: frozenset[int] = frozenset()) -> Equilibrium:
    """An equilibrium with the most pads loaded: idle ones near or above their folds are put on their films and tried.

    `held` are pads (from 0) that friction holds off, or that lack oil.
    """
    if not result.converged or not any(f.idle for f in result.films):
        return result
    refused = set(held)
    near = _NEAR_SOFT if search.setup.flexible_pads or couples_heat(search.setup) else _NEAR
    while True:
        above = search.margins()
        doubtful = [m for m, f in enumerate(result.films) if f.idle and above[m] > -near and m not in refused]
        if not doubtful:
            return _named(search, result, near, held)
        pad = max(doubtful, key=lambda m: float(above[m]))
        trial = Search(search.setup, search.load, search.speed, search.heat)
        trial.start_from(result)
        trial.case = trial.case._replace(tried=pad)
        trial.load_pads(np.arange(len(trial.films)) == pad)
        other = trial.run()
        refused.add(pad)
        if trial.pads["idle"][pad] and above[pad] < 0.0 and near == _NEAR:
            # where its own film carries nothing, those of pads with the same curve that stand farther off do not either
            refused.update(m for m in doubtful if search.rises[m] is search.rises[pad])
        idle = trial.pads["idle"]
        fewer = idle.sum() < sum(f.idle for f in result.films)
        if other.converged and not idle[pad] and (fewer or not np.any(idle & (trial.margins() > near))):
            search, result = trial, other


def _named(search: Search, result: Equilibrium, near: float, held: frozenset[int]) -> Equilibrium:
    """An equilibrium with what is to be said of its idle pads.

    One that would carry where it idles, and carrying pushes the journal off, is left idle where its film opens both
    ways; where it does not, nothing keeps it idle either.
    """
    films, above = result.films, search.margins()
    even = search.even_films()
    off, restless = [], []
    for m, film in enumerate(films):
        opens = search.reach[m] <= 0.0
        if film.idle and (m in held or (above[m] > near and opens)):
            off.append(film.number)
        elif film.idle and above[m] > near:
            restless.append(film.number)
    edge = [f.number for f in films if abs(above[f.number - 1]) < _EDGE and f.number not in even]
    another = search.other.any() and not restless
    names = (
        (restless, "pads {pads} can neither carry nor idle", restless),
        (restless, "not converged"),
        (off and not restless, "pads {pads} cannot keep their load", off),
        (even and not restless, "pads {pads} stand concentric", even),
        (edge, "pads {pads} on the edge of carrying", edge),
        (another, "another equilibrium exists", (np.flatnonzero(~search.other) + 1).tolist()),
    )
    return replace(result, status=(*said(names), *result.status))


def _let_held_idle(setup: Setup, load: FloatArray, speed: float, failed: Equilibrium) -> Equilibrium:
    """Let pads idle that friction holds where their film loses its load, or whose oil fills no gap: nothing else is."""
    if not setup.friction and math.isinf(setup.bearing.oil.supply_flow):
        return failed
    search, held = Search(setup, load, speed).stand(), frozenset[int]()
    for _ in range(len(search.films) + 1):
        result = search.run()
        # those that idle where a full gap at their leading edge would take more oil than there is
        held |= frozenset(k - 1 for k in starved(search.films) if search.films[k - 1].idle)
        if result.converged:
            return _settled(search, result, held)
        swinging = pads_of("pads {pads} neither stick nor slide at rest", result.status)
        loaded = [k - 1 for k in swinging if not search.pads["idle"][k - 1]]
        if not loaded:
            break
        held |= frozenset(loaded)
        search.let_idle(loaded)
    return failed


def _raise(quantity: str, setup: Setup, load: FloatArray, speed: float, failed: Equilibrium) -> Equilibrium:
    """Raise load, heat, speed or want of oil from `_FIRST_SHARE` to 1, each step started from the one before.

    Where heat goes round, with journal and clearances, cold films are no start for hot ones; a bearing that is lost on
    the way because it grows hotter and closer for ever, above some share of its heat, is named.
    """
    oil = setup.bearing.oil
    if (quantity == "heat" and not couples_heat(setup)) or (quantity == "want" and math.isinf(oil.supply_flow)):
        return failed
    reached, step = 0.0, _FIRST_SHARE
    last: Equilibrium | None = None
    while reached < 1.0 and step > _LEAST_STEP:
        share = min(1.0, reached + step)
        shares = {"load": 1.0, "heat": 1.0, "speed": 1.0, quantity: share}
        if quantity == "want":
            setup = setup.change_oil(supply_flow=oil.supply_flow / share)
        search = Search(setup, shares["load"] * load, shares["speed"] * speed, shares["heat"])
        if last is None or not search.start_from(last):
            search.stand()
        result = _settled(search, search.run())
        if result.converged:
            last, reached = result, share
        else:
            step *= 0.5
    if last is not None and reached == 1.0:
        return last
    hottest = max(float(f.work.temperature.max()) for f in failed.films)
    if quantity == "heat" and last is not None and hottest >= conditions.HOTTEST_FILM:
        return replace(failed, status=(named("heat runs away", number=100 * reached), *failed.status))
    return failed


#: What is tried one after another where an equilibrium is not found at once.
_ATTEMPTS: tuple[Callable[..., Equilibrium], ...] = (
    *(partial(_raise, quantity) for quantity in ("heat", "load", "speed", "want")),
    _let_held_idle,
    _try_sets,
)
