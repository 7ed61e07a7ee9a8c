"""Find a static equilibrium, Eq. (1): from a neighbour, from tabulated films, or by raising the load."""

from __future__ import annotations

import numpy as np

from model.arrays import FloatArray
from model.setup import Setup
from model.statics.at_once import able, iterate_at_once
from model.statics.equilibrium import Equilibrium
from model.statics.newton_iteration import iterate
from model.statics.search import Search

#: First share of the load, where the whole of it finds no equilibrium at once, and the least step from one to the next.
FIRST_SHARE, LEAST_STEP = 0.25, 0.02


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
    search = Search(setup, np.asarray(load, float), speed)
    if start is not None and search.start_from(start):
        result = _iterated(search, cold=False)
        if result.converged:
            return result
        search.lay_out()
    result = _iterated(search, cold=True)
    return result if result.converged else _raise_load(search, result)


def _iterated(search: Search, cold: bool) -> Equilibrium:
    """Iterate from where a search stands, or from a cold start; in one compiled call where that is possible."""
    if able(search.setup):
        return iterate_at_once(search, cold)
    if cold:
        search.start_cold()
    return iterate(search)


def _raise_load(search: Search, failed: Equilibrium) -> Equilibrium:
    """Raise the load in steps, each started from the one before: hot, thin films are far from the isothermal guess."""
    load, reached, step = search.load.copy(), 0.0, FIRST_SHARE
    last: Equilibrium | None = None
    while reached < 1.0 and step > LEAST_STEP:
        share = min(1.0, reached + step)
        search.load = share * load
        search.lay_out()
        result = _iterated(search, cold=last is None or not search.start_from(last))
        if result.converged:
            last, reached = result, share
        else:
            step *= 0.5
    search.load = load
    return last if last is not None and reached == 1.0 else failed
