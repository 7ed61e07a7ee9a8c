"""A first guess of the equilibrium: the loaded attitudes of an isothermal film, tabulated once per pad shape.

With h = (Cp - a) [1 + A (1 - cos alpha) - B sin alpha], A = a / (Cp - a), B = b / (Cp - a), the film force is
mu U R^2 L / (Cp - a)^2 times a function of (A, B), and the attitudes that tilt freely are a curve A(B). A central
pivot carries for A > 0 only. A pivot behind the middle carries down to a fold at A < 0; on a pivot that gives way
it carries somewhat beyond, because a pad that sheds load also comes closer.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from model.film.mesh import film_grid, film_work
from model.film.reynolds import solve_film
from model.interpolation import bracketed_root, evaluated, monotone_cubics
from rigdata.arrays import FloatArray

_TABLE_MESH = (32, 4)
#: (A, B) -> tilting force and load over mu U R^2 L; the tilting force is infinite where the film is gone.
_Force = Callable[[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Branch:
    """Loaded attitudes of one pad on its pivot, against the approach of the journal to a rigid pivot.

    The rigid approach is Cp - Cb + n . (x, y): what `a` would be on a rigid pivot. It rises along the branch.
    """

    #: (n,): Rigid approach, a and b [m]; below the first rigid approach the pad has no loaded attitude.
    rigid_approach: FloatArray
    approach: FloatArray
    #: (n,): Rigid approach, a and b [m]; below the first rigid approach the pad has no loaded attitude.
    wedge: FloatArray
    load: FloatArray  #: (n,), N

    def at(self, rigid_approach: float) -> tuple[float, float]:
        """Guess (a, b) at a rigid approach, all [m]."""
        a = float(np.interp(rigid_approach, self.rigid_approach, self.approach))
        return a, float(np.interp(rigid_approach, self.rigid_approach, self.wedge))


@dataclass(frozen=True, eq=False)
class LoadedAttitude:
    """Attitudes that tilt freely, and their load, along the wedge."""

    curvature: FloatArray  #: (n,): A(B).
    wedge: FloatArray  #: (n,): B, rising from 0.
    load: FloatArray  #: (n,): Radial force over mu U R^2 L / (Cp - a)^2.

    def branch(self, clearance: float, scale: float, deflection: Callable[[float], float]) -> Branch:
        """The loaded attitudes of a pad; from an infinite approach on if it has none."""
        if len(self.curvature) < 2:
            return Branch(np.array([math.inf, math.inf]), *np.zeros((3, 2)))
        room = clearance / (1.0 + self.curvature)
        load = scale * self.load / room**2
        approach = clearance - room
        some = load[::4]
        order = np.argsort(some)
        deflected = np.array([deflection(w) for w in some[order].tolist()])
        rigid = approach + np.interp(load, some[order], deflected)
        falling = np.flatnonzero(np.diff(rigid) <= 0.0)
        rising = slice(int(falling[-1]) + 1 if len(falling) else 0, None)
        return Branch(rigid[rising], approach[rising], (self.wedge * room)[rising], load[rising])


#: A film that starts behind the pivot, or a pivot at an edge: never carries.
_NEVER = LoadedAttitude(np.zeros(1), np.zeros(1), np.zeros(1))


@functools.lru_cache(maxsize=64)
def loaded_attitude(start: float, end: float, radius: float, length: float) -> LoadedAttitude:
    """Tabulate the loaded attitudes of a film from `start` to `end` [rad from the pivot].

    The film is solved at unit clearance scale; only ratios enter, so one table serves every clearance, speed and
    viscosity.
    """
    grid = film_grid(start, end, radius, length, _TABLE_MESH, True)
    work = film_work(grid, 40.0)
    work.viscosity[:] = 1.0
    work.density[:] = 1.0
    unit = radius**2 * length

    @functools.cache  # roots are sought between places that are asked for already
    def force(curvature: float, wedge: float) -> tuple[float, float]:
        # (Cp - a) = 1: Cp = 1 + A
        work.ruptured[:] = False
        f = solve_film(grid, work, (1.0 + curvature, curvature, wedge), 1.0, False)
        return (f.force[1] / unit, f.force[0] / unit) if f.steps > 0 else (math.inf, math.inf)

    rows = [(0.0, 0.0)]
    gentle = _free_wedge(force, _CURVATURES[0], end)
    if gentle is not None:
        rows += [(_free_curvature(force, share * gentle), share * gentle) for share in _SHARES]
    for curvature in _CURVATURES:
        wedge = _free_wedge(force, curvature, end)
        if wedge is not None:
            rows.append((curvature, wedge))
    if len(rows) < 4:
        return _NEVER
    coarse = np.array([(*row, force(*row)[1]) for row in rows])
    coarse[0, 2] = 0.0
    return LoadedAttitude(*_refined(coarse).T)


def _refined(rows: FloatArray) -> FloatArray:
    """Four times as many rows, between them smooth in the wedge."""
    at = np.arange(len(rows))
    fine = np.interp(np.arange(4 * len(rows) - 3) / 4.0, at, rows[:, 1])
    return evaluated(rows[:, 1], monotone_cubics(rows[:, 1], rows), fine)


_CURVATURES = (0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0, 6.5, 10.0, 16.0, 25.0, 40.0, 65.0, 100.0)
#: Wedges below that of the first curvature, as shares of it.
_SHARES = (0.03, 0.06, 0.1, 0.16, 0.23, 0.31, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
#: Attitudes beyond this are of no concern: the journal would stand clearances away.
_LEAST_CURVATURE = -0.8


def _free_curvature(force: _Force, wedge: float) -> float:
    """A at which a pad with this B tilts freely: more A takes the pressure upstream."""
    if not force(_LEAST_CURVATURE, wedge)[0] > 0.0:
        return _LEAST_CURVATURE
    low, high = _LEAST_CURVATURE, _CURVATURES[0]
    while math.isinf(force(low, wedge)[0]):  # the film is gone at the trailing edge
        low = 0.5 * (low + high)
    return bracketed_root(lambda c: force(c, wedge)[0], low, high, 1e-5)


def _free_wedge(force: _Force, curvature: float, end: float) -> float | None:
    """Root of the tilting force in B for A > 0, the loaded one: where it rises through zero."""
    touch = (1.0 + curvature * (1.0 - math.cos(end))) / math.sin(end)  # film gone at the trailing edge
    if math.atan2(math.sqrt(1.0 + 2.0 * curvature), curvature) < end:
        touch = math.sqrt(1.0 + 2.0 * curvature)  # ... or before it
    upper = 0.98 * touch
    if not 0.0 < force(curvature, upper)[0] < math.inf:
        return None
    lower = 0.7 * upper
    while force(curvature, lower)[0] >= 0.0:
        upper, lower = lower, 0.7 * lower
        if lower < 1e-3 * curvature * touch:
            return None
    return bracketed_root(lambda w: force(curvature, w)[0], lower, upper, 1e-6 * upper)
