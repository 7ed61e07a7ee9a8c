"""Find a static equilibrium, Eq. (1): from a neighbour, from the curves of its pads, or by raising load or heat."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from model.conditions import conditions_of, named, pads_of
from model.setup import Setup
from model.statics import conditions
from model.statics.compiled.start import stand_on_curves
from model.statics.equilibrium import Equilibrium
from model.statics.pad_flow import starved
from model.statics.physics import couples_heat
from model.statics.search import Search
from rigdata.arrays import BoolArray, FloatArray

#: First share of the load or the heat, where the whole of it finds no equilibrium at once, and the least step on.
_FIRST_SHARE, _LEAST_STEP = 0.25, 0.02
#: Share of the clearance within which the curve of a pad may be wrong about its fold, because its mesh is coarse; and
#: because pads bend or drink hot oil. Within it the film is tried: this costs time, and decides nothing.
_NEAR, _NEAR_SOFT = 0.02, 0.1
#: Share of the clearance from a fold within which the mesh decides whether a pad carries.
_EDGE = 3e-4
#: Pads whose sets are tried one by one where nothing else finds an equilibrium: 64 sets of six.
_MOST_PADS = 6


def solve_equilibrium(
    setup: Setup,
    load: FloatArray,
    speed: float,
    start: Equilibrium | None = None,
    patient: bool = True,
    near: bool = False,
) -> Equilibrium:
    """Find where the journal stands: `load` (2,) [N]; `patient`: by raising load or heat too, where nothing else does.

    That takes some hundred times as long as an equilibrium from a neighbour. `near`: so small a step from `start` that
    the same pads carry, where they can.
    """
    warm = None
    if start is not None:
        search = Search(setup, load, speed)
        if search.start_from(start):
            warm = search.run()
            if near and warm.converged and np.all(warm.idle == start.idle):
                return warm
            warm = _settled(search, warm)
            # where pads are left idle that could carry, another start may leave others
            if warm.converged and not any(warm.loose) and warm.idle.sum() <= np.isnan(search.begun.tilt).sum():
                return warm
    search = Search(setup, load, speed).stand()
    above, loaded = search.margins(), ~search.pads["idle"]
    doubtful = np.abs(above) < _doubt(setup)
    result = _settled(search, search.run())
    of_sets = _is_of_sets(setup)
    if of_sets and not result.converged:  # pads near their folds may find no rest where they carry
        result = _most_loaded(setup, load, speed, result, loaded, doubtful & loaded)
    elif of_sets and any(result.loose):
        doubtful |= np.array(result.loose) | (~loaded & (above > 0.0))
        return _most_loaded(setup, load, speed, result, ~result.idle, doubtful)
    for attempt in _ATTEMPTS:
        if patient and not result.converged:
            result = attempt(setup, load, speed, result)
    return result if result.converged or warm is None or not warm.converged else warm


def _with_pads(setup: Setup, load: FloatArray, speed: float, loaded: BoolArray) -> Equilibrium:
    """Equilibrium from where the curves of those pads that are loaded carry; the others idle, unless they can carry."""
    search = Search(setup, load, speed).stand()
    loaded = loaded & (search.pads["rows"] >= 2)
    stand_on_curves(search.case.load, search.pads, loaded, search.state.position)
    search.load_pads(loaded)
    search.let_idle(~loaded)
    return _settled(search, search.run())


def _is_of_sets(setup: Setup) -> bool:
    """Whether which pads carry is all that can be in doubt, in films that are soon solved."""
    few = len(setup.bearing.pads) <= _MOST_PADS and not setup.flexible_pads and not couples_heat(setup)
    return few and not setup.friction and not setup.rotational_stiffness


def _doubt(setup: Setup) -> float:
    """Share of the clearance within which a curve may be wrong about its fold: a leaning shaft moves its ends off."""
    bearing, (angle, _) = setup.bearing, setup.misalignment
    lean = 0.5 * bearing.length * angle / min(pad.pad_clearance for pad in bearing.pads)
    return lean + (_NEAR_SOFT if setup.flexible_pads or couples_heat(setup) else _NEAR)


def _most_loaded(
    setup: Setup, load: FloatArray, speed: float, fallback: Equilibrium, loaded: BoolArray, doubtful: BoolArray
) -> Equilibrium:
    """The equilibrium with most of the doubtful pads loaded, no more than `loaded` has; what is known where none is.

    Of those with as many the one that idles the last pads; that another exists is named.
    """
    pads = np.flatnonzero(doubtful)
    alike = dict[tuple[bool, ...], Equilibrium]()
    for size in range(int(loaded[pads].sum()), -1, -1):
        for chosen in itertools.combinations(pads.tolist(), size):
            carrying = loaded.copy()
            carrying[pads] = np.isin(pads, chosen)
            if not fallback.converged and np.array_equal(carrying, ~np.isnan(fallback.begun.tilt)):
                continue  # what is known began with these
            is_fallback = fallback.converged and np.all(carrying != fallback.idle)
            trial = fallback if is_fallback else _with_pads(setup, load, speed, carrying)
            if trial.converged:
                alike.setdefault(tuple(trial.idle.tolist()), trial)
            elif not fallback.converged and len(trial.status) > len(fallback.status):
                fallback = trial  # the one with the most to say
        if alike:
            break
    else:
        return fallback
    first, *rivals = sorted(alike, key=sum)
    if not rivals or sum(rivals[0]) > sum(first):
        return alike[first]
    another = named("another equilibrium exists", (np.flatnonzero(rivals[0]) + 1).tolist())
    return replace(alike[first], status=(another, *alike[first].status))


def _try_sets(setup: Setup, load: FloatArray, speed: float, failed: Equilibrium) -> Equilibrium:
    """Try every set of pads, those with the most first; where none finds rest, that is named.

    Only where which pads carry is all that is in doubt.
    """
    found_out = (c.severity == "error" and c != "not converged" and not c.pads for c in failed.status)
    if not _is_of_sets(setup) or any(found_out):
        return failed
    all_pads = np.ones(len(failed.films), bool)
    result = _most_loaded(setup, load, speed, failed, all_pads, all_pads)
    if result.converged:
        return result
    return replace(result, status=(*result.status, named("no set of pads finds rest")))


def _settled(search: Search, result: Equilibrium, held: frozenset[int] = frozenset()) -> Equilibrium:
    """An equilibrium with the most pads loaded: idle ones near or above their folds are put on their films and tried.

    `held` are pads (from 0) that friction holds off, or that lack oil.
    """
    if not result.converged:
        return result
    refused = set(held)
    near = _doubt(search.setup)
    while True:
        above, idle = search.margins(), result.idle
        if not held and np.where(idle, -above, np.abs(above)).min() > near:
            return result
        doubtful = [m for m in np.flatnonzero(idle & (above > -near)).tolist() if m not in refused]
        if not doubtful:
            return _named(search, result, near, held)
        pad = max(doubtful, key=lambda m: above[m])
        trial = Search(search.setup, search.load, search.speed, search.heat)
        trial.start_from(result)
        trial.load_pads(np.arange(len(idle)) == pad)
        outcome = trial.run()
        refused.add(pad)
        if outcome.converged and not outcome.idle[pad] and outcome.idle.sum() < idle.sum():
            search, result = trial, outcome


def _named(search: Search, result: Equilibrium, near: float, held: frozenset[int]) -> Equilibrium:
    """An equilibrium with what is to be said of its idle pads.

    One that would carry where it idles, and carrying pushes the journal off, is left idle where its film opens both
    ways; where it does not, nothing keeps it idle either.
    """
    above = search.margins()
    even = search.even_films()
    above_fold = result.idle & (above > near)
    opens = above_fold & (search.reach <= 0.0)
    opens[list(held)] |= result.idle[list(held)]
    off, restless = ((np.flatnonzero(pads) + 1).tolist() for pads in (opens, above_fold & ~opens))
    edge = [pad for pad in (np.flatnonzero(np.abs(above) < _EDGE) + 1).tolist() if pad not in even]
    names = (
        (restless, "pads {pads} can neither carry nor idle", restless),
        (restless, "not converged"),
        (off and not restless, "pads {pads} cannot keep their load", off),
        (even and not restless, "pads {pads} stand concentric", even),
        (edge, "pads {pads} on the edge of carrying", edge),
    )
    return replace(result, status=(*conditions_of(names), *result.status), loose=tuple(result.idle & (above > _EDGE)))


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
