"""Find a static equilibrium, Eq. (1): from a neighbour, from tabulated films, or by raising the load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from model.setup import Setup
from model.statics import conditions
from model.statics.at_once import able, iterate_at_once
from model.statics.carrying import let_idle
from model.statics.compiled.constants import MAX_LOAD_CHANGES
from model.statics.conditions import HOTTEST_FILM, runaway
from model.statics.equilibrium import Equilibrium
from model.statics.heat_paths import couples_heat
from model.statics.newton_iteration import iterate
from model.statics.search import Search
from rigdata.arrays import FloatArray

#: First share of the load or the heat, where the whole of it finds no equilibrium at once, and the least step on.
_FIRST_SHARE, _LEAST_STEP = 0.25, 0.02


def solve_equilibrium(setup: Setup, load: FloatArray, speed: float, start: Equilibrium | None = None) -> Equilibrium:
    """Find where the journal stands: `load` (2,) [N]."""
    search = Search(setup, np.asarray(load, float), speed)
    if start is not None and search.start_from(start):
        result = _iterated(search, cold=False)
        if result.converged:
            return result
        search.lay_out()
    result = _iterated(search, cold=True)
    if not result.converged and couples_heat(setup):
        result = _raise_heat(search, result)
    if not result.converged:
        result = _raise_load(search, result)
    if not result.converged and setup.friction:
        search.lay_out()
        result = _let_held_idle(search, _iterated(search, cold=True))
    return result


def _iterated(search: Search, cold: bool) -> Equilibrium:
    """Iterate from where a search stands, or from a cold start; in one compiled call where that is possible."""
    if able(search.setup):
        return iterate_at_once(search, cold)
    if cold:
        search.start_cold()
    return iterate(search)


def _let_held_idle(search: Search, failed: Equilibrium) -> Equilibrium:
    """Let pads idle that friction holds where their film loses its load: they have no other rest."""
    result = failed
    for _ in search.films:
        held = [f for f in search.films if f.number in conditions.held_off(result.status) and not f.idle]
        if not held:
            return failed
        for film in held:
            let_idle(film)
            film.load_changes = MAX_LOAD_CHANGES
        search.held |= {f.number for f in held}
        result = iterate(search)
        if result.converged:
            return result
    return failed


def _raise_load(search: Search, failed: Equilibrium) -> Equilibrium:
    """Raise the load in steps, each started from the one before: hot, thin films are far from the isothermal guess."""
    load = search.load.copy()
    found, _ = _raise(search, lambda share: setattr(search, "load", share * load))
    return found or failed


def _raise_heat(search: Search, failed: Equilibrium) -> Equilibrium:
    """Raise the heat in steps: where it goes round, with journal and clearances, cold films are no start for hot ones.

    Names a bearing that is lost on the way because it grows hotter and closer for ever: above some share of its heat.
    """
    found, reached = _raise(search, lambda share: setattr(search, "heat", share))
    hottest = max(float(f.work.temperature.max()) for f in failed.films)
    if found is not None or not reached or hottest < HOTTEST_FILM:
        return found or failed
    return replace(failed, status=(runaway(reached), *failed.status))


def _raise(search: Search, put: Callable[[float], None]) -> tuple[Equilibrium | None, float]:
    """Raise what `put` sets a share of from `_FIRST_SHARE` to 1; the equilibrium there, and the share reached."""
    reached, step = 0.0, _FIRST_SHARE
    last: Equilibrium | None = None
    while reached < 1.0 and step > _LEAST_STEP:
        share = min(1.0, reached + step)
        put(share)
        search.lay_out()
        result = _iterated(search, cold=last is None or not search.start_from(last))
        if result.converged:
            last, reached = result, share
        else:
            step *= 0.5
    put(1.0)
    return (last if reached == 1.0 else None), reached
