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
from numpy.typing import NDArray

from model.film import solve_film
from model.film_mesh import film_grid, film_work
from model.kernel import compiled

FloatArray = NDArray[np.float64]
_TABLE_MESH = (32, 4)
#: (A, B) -> tilting force and load over mu U R^2 L; the tilting force is infinite where the film is gone.
_Force = Callable[[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Branch:
    """Loaded attitudes of one pad on its pivot, against the reach of the journal.

    The reach is Cp - Cb + n . (x, y): the approach `a` if the pivot did not give way. It rises along the branch.

    Attributes
    ----------
    reach, approach, wedge : (n,) ndarray
        Reach, a and b [m]; below the first reach the pad has no loaded attitude.
    load : (n,) ndarray
        [N]
    """

    reach: FloatArray
    approach: FloatArray
    wedge: FloatArray
    load: FloatArray

    def at(self, reach: float) -> tuple[float, float]:
        """Guess (a, b) [m] at a reach."""
        a = float(np.interp(reach, self.reach, self.approach))
        return a, float(np.interp(reach, self.reach, self.wedge))


@dataclass(frozen=True)
class LoadedAttitude:
    """Attitudes that tilt freely, and their load, along the wedge.

    Attributes
    ----------
    curvature : (n,) ndarray
        A(B).
    wedge : (n,) ndarray
        B, rising from 0.
    load : (n,) ndarray
        Radial force over mu U R^2 L / (Cp - a)^2.
    """

    curvature: FloatArray
    wedge: FloatArray
    load: FloatArray

    def branch(self, clearance: float, scale: float, give: Callable[[float], float]) -> Branch:
        """The loaded attitudes of a pad; from an infinite reach on if it has none.

        Parameters
        ----------
        clearance : float
            Cp [m].
        scale : float
            mu U R^2 L [N m^2].
        give : callable
            Pivot deflection [m] by load [N].
        """
        if len(self.curvature) < 2:
            return Branch(np.array([math.inf, math.inf]), *np.zeros((3, 2)))
        room = clearance / (1.0 + self.curvature)
        load = scale * self.load / room**2
        approach = clearance - room
        some = load[::4]
        order = np.argsort(some)
        deflection = np.array([give(w) for w in some[order].tolist()])
        reach = approach + np.interp(load, some[order], deflection)
        falling = np.flatnonzero(np.diff(reach) <= 0.0)
        rising = slice(int(falling[-1]) + 1 if len(falling) else 0, None)
        return Branch(reach[rising], approach[rising], (self.wedge * room)[rising], load[rising])


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
    from scipy.interpolate import PchipInterpolator

    at = np.arange(len(rows))
    fine = np.interp(np.arange(4 * len(rows) - 3) / 4.0, at, rows[:, 1])
    return np.asarray(PchipInterpolator(rows[:, 1], rows)(fine))


_CURVATURES = (0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0, 6.5, 10.0, 16.0, 25.0, 40.0, 65.0, 100.0)
#: Wedges below that of the first curvature, as shares of it.
_SHARES = (0.03, 0.06, 0.1, 0.16, 0.23, 0.31, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
#: Attitudes beyond this are of no concern: the journal would stand clearances away.
_LEAST_CURVATURE = -0.8


def _free_curvature(force: _Force, wedge: float) -> float:
    """A at which a pad with this B tilts freely: more A takes the pressure upstream."""
    from scipy.optimize import brentq

    if not force(_LEAST_CURVATURE, wedge)[0] > 0.0:
        return _LEAST_CURVATURE
    low, high = _LEAST_CURVATURE, _CURVATURES[0]
    while math.isinf(force(low, wedge)[0]):  # the film is gone at the trailing edge
        low = 0.5 * (low + high)
    return float(brentq(lambda c: force(c, wedge)[0], low, high, xtol=1e-5))


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
    from scipy.optimize import brentq

    return float(brentq(lambda w: force(curvature, w)[0], lower, upper, xtol=1e-6 * upper, rtol=1e-6))


def first_position(load: FloatArray, normals: FloatArray, gaps: FloatArray, branches: list[Branch]) -> FloatArray:
    """Journal position that balances a load on tabulated isothermal films.

    Parameters
    ----------
    load : (2,) ndarray
        [N]
    normals : (n_pads, 2) ndarray
        Unit vectors at the pivots.
    gaps : (n_pads,) ndarray
        Cp - Cb [m].
    branches : list of Branch

    Returns
    -------
    (2,) ndarray
        [m]
    """
    longest = max(len(b.reach) for b in branches)
    curves = np.full((len(branches), 2, longest), math.nan)
    for row, branch in zip(curves, branches, strict=True):
        row[0, : len(branch.reach)] = branch.reach
        row[1, : len(branch.load)] = branch.load
    lengths = np.array([len(b.reach) for b in branches])
    room = min(float(b.approach[-1]) - g for b, g in zip(branches, gaps, strict=True))
    return _first_position(np.asarray(load, float), np.column_stack([normals, gaps]), curves, lengths, room)


@compiled
def _first_position(
    load: FloatArray, pads: FloatArray, curves: FloatArray, lengths: NDArray[np.int64], room: float
) -> FloatArray:
    size = math.hypot(load[0], load[1])
    position = np.zeros(2)
    if size == 0.0:
        return position
    position = load / size * 0.4 * room
    residual = load - _pull(position, pads, curves, lengths)
    error = math.hypot(residual[0], residual[1])
    step = 1e-4 * room
    for _ in range(60):
        if error < 0.002 * size:
            break
        jacobian = np.zeros((2, 2))
        for axis in range(2):
            ahead, behind = position.copy(), position.copy()
            ahead[axis] += step
            behind[axis] -= step
            slope = _pull(ahead, pads, curves, lengths) - _pull(behind, pads, curves, lengths)
            jacobian[:, axis] = slope / (2 * step)
        det = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]
        if abs(det) <= 1e-9 * np.sum(jacobian**2):  # nothing carries in some direction: go where the load pushes
            move = 0.1 * room * residual / error
        else:
            move = np.array(
                [
                    (residual[0] * jacobian[1, 1] - jacobian[0, 1] * residual[1]) / det,
                    (jacobian[0, 0] * residual[1] - jacobian[1, 0] * residual[0]) / det,
                ]
            )
            move *= min(1.0, 0.2 * room / max(math.hypot(move[0], move[1]), 1e-30))
        for halving in range(8):  # a pad that takes up or sheds its load on the way bends the force sharply
            trial = position + move * 0.5**halving
            missing = load - _pull(trial, pads, curves, lengths)
            left = math.hypot(missing[0], missing[1])
            if left < error or halving == 7:
                position, residual, error = trial, missing, left
                break
    return position


@compiled
def _pull(position: FloatArray, pads: FloatArray, curves: FloatArray, lengths: NDArray[np.int64]) -> FloatArray:
    """Force of all tabulated films at a position."""
    total = np.zeros(2)
    for m in range(pads.shape[0]):
        reach = pads[m, 2] + pads[m, 0] * position[0] + pads[m, 1] * position[1]
        reaches, loads = curves[m, 0], curves[m, 1]
        if reach < reaches[0]:
            continue
        i = min(np.searchsorted(reaches[: lengths[m]], reach), lengths[m] - 1)  # beyond the end: the last slope
        i = max(i, 1)
        slope = (loads[i] - loads[i - 1]) / (reaches[i] - reaches[i - 1])
        carried = loads[i - 1] + slope * (reach - reaches[i - 1])
        total[0] += pads[m, 0] * carried
        total[1] += pads[m, 1] * carried
    return total
