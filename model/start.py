"""A first guess of the equilibrium: the loaded attitude of an isothermal film, tabulated once per pad shape.

With h = (Cp - a) [1 + A (1 - cos alpha) - B sin alpha], A = a / (Cp - a), B = b / (Cp - a), the film force is
mu U R^2 L / (Cp - a)^2 times a function of (A, B), and the attitude that tilts freely is a function B(A). A
central pivot has a loaded attitude for A > 0 only; below it the film cannot carry.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from model.film import JIT, film_grid, film_work, solve_film
from model.pad_film import PadFilm

FloatArray = NDArray[np.float64]
_TABLE_MESH = (32, 4)


@dataclass(frozen=True)
class LoadedAttitude:
    """Free-tilt attitude and load of an isothermal film against its relative curvature A.

    Attributes
    ----------
    curvature : (n,) ndarray
        A, increasing; the first one is where the pad just stops carrying.
    wedge : (n,) ndarray
        B(A).
    load : (n,) ndarray
        Radial force over mu U R^2 L / (Cp - a)^2.
    """

    curvature: FloatArray
    wedge: FloatArray
    load: FloatArray

    @property
    def least(self) -> float:
        """Smallest A with a loaded attitude."""
        return float(self.curvature[0])

    def at(self, clearance: float, a: float) -> tuple[float, float]:
        """Guess b [m] and the load factor (times mu U R^2 L [N]) at an approach a."""
        room = clearance - a
        curvature = a / room if room > 0 else math.inf
        if curvature > self.curvature[-1]:
            if room <= 0:
                return float(self.wedge[-1] / math.sqrt(self.curvature[-1])) * math.sqrt(abs(a) * clearance), math.inf
            growth = math.sqrt(curvature / self.curvature[-1])
            return float(self.wedge[-1]) * growth * room, float(self.load[-1]) / room**2
        # wedge and load grow like the square root of A where a central pivot begins to carry
        key, keys = _root(curvature), _root(self.curvature)
        b = float(np.interp(key, keys, self.wedge)) * room
        return b, float(np.interp(key, keys, self.load)) / room**2


def _root(curvature: FloatArray | float) -> FloatArray:
    return np.sign(curvature) * np.sqrt(np.abs(curvature))


@functools.lru_cache(maxsize=64)
def loaded_attitude(start: float, end: float, radius: float, length: float) -> LoadedAttitude:
    """Tabulate the loaded attitude of a film from `start` to `end` [rad from the pivot].

    The film is solved at unit minimum-clearance scale; only ratios enter, so one table serves every clearance,
    speed and viscosity.
    """
    grid = film_grid(start, end, radius, length, _TABLE_MESH, True)
    work = film_work(grid, 40.0)
    work.viscosity[:] = 1.0
    work.density[:] = 1.0
    unit = radius**2 * length

    def force(curvature: float, wedge: float) -> tuple[float, float, float]:
        # (Cp - a) = 1: Cp = 1 + A
        work.ruptured[:] = False
        f = solve_film(grid, work, (1.0 + curvature, curvature, wedge), 1.0, False)
        return (f.force[0] / unit, f.force[1] / unit, f.steps)

    rows = []
    for curvature in _curvatures(start, end):
        wedge = _free_wedge(force, curvature, start, end)
        if wedge is not None:
            rows.append((curvature, wedge, force(curvature, wedge)[0]))
    if len(rows) < 4:
        raise ValueError(
            f"a pad from {math.degrees(start):.1f} to {math.degrees(end):.1f} deg about its pivot has no loaded attitude"
        )
    table = np.array(rows)
    if table[0, 0] == min(_POSITIVE):  # central pivot: carries from A = 0 on, in proportion to A
        table = np.vstack([[0.0, 0.0, 0.0], table])
    return LoadedAttitude(table[:, 0], table[:, 1], table[:, 2])


_POSITIVE = (
    1e-3,
    0.02,
    0.06,
    0.12,
    0.2,
    0.35,
    0.6,
    1.0,
    1.6,
    2.5,
    4.0,
    6.5,
    10.0,
    16.0,
    25.0,
    40.0,
    65.0,
    100.0,
)


def _curvatures(start: float, end: float) -> list[float]:
    if abs(start + end) < 1e-6 * (end - start):
        return list(_POSITIVE)
    return [-0.8, -0.5, -0.3, -0.2, -0.1, -0.05, *_POSITIVE]


def _free_wedge(force, curvature: float, start: float, end: float) -> float | None:  # type: ignore[no-untyped-def]
    """Root of the tilting force in B, the loaded one: where it rises through zero."""
    touch = (1.0 + curvature * (1.0 - math.cos(end))) / math.sin(end)  # film gone at the trailing edge
    if curvature > 0 and math.atan2(math.sqrt(1.0 + 2.0 * curvature), curvature) < end:
        touch = math.sqrt(1.0 + 2.0 * curvature)  # ... or before it
    upper = 0.98 * touch
    f_upper = force(curvature, upper)
    if f_upper[2] < 0 or f_upper[1] <= 0:
        return None
    lower = upper
    while lower > 1e-3 * abs(curvature) * touch + 1e-6:
        lower *= 0.7
        f_lower = force(curvature, lower)
        if f_lower[1] < 0:
            break
        upper, f_upper = lower, f_lower
    else:
        return None
    from scipy.optimize import brentq

    return float(brentq(lambda w: force(curvature, w)[1], lower, upper, xtol=1e-6 * upper, rtol=1e-6))


def first_position(
    load: FloatArray, scale: float, give: FloatArray, films: list[PadFilm], tables: list[LoadedAttitude]
) -> tuple[FloatArray, FloatArray]:
    """Journal position and pivot deflections that balance a load on tabulated isothermal films.

    Parameters
    ----------
    load : (2,) ndarray
        [N]
    scale : float
        mu U R^2 L [N m^2].
    give : (n_pads,) ndarray
        Secant compliance of every pivot [m/N].

    Returns
    -------
    position : (2,) ndarray
        [m]
    deflection : (n_pads,) ndarray
        [m]
    """
    pads = np.array([[*f.normal, f.gap, f.pad.pad_clearance, c] for f, c in zip(films, give, strict=True)])
    longest = max(len(t.curvature) for t in tables)
    curves = np.full((len(tables), 2, longest), math.inf)
    for row, t in zip(curves, tables, strict=True):
        row[0, : len(t.curvature)] = _root(t.curvature)
        row[1, : len(t.load)] = t.load
    return _first_position(np.asarray(load, float), scale, pads, curves)


@njit(**JIT)
def _first_position(
    load: FloatArray, scale: float, pads: FloatArray, curves: FloatArray
) -> tuple[FloatArray, FloatArray]:
    n = pads.shape[0]
    room = np.min(pads[:, 3] - pads[:, 2])
    size = math.hypot(load[0], load[1])
    deflection = np.zeros(n)
    position = np.zeros(2)
    if size == 0.0:
        _pull(position, scale, pads, curves, deflection)
        return position, deflection
    position = load / size * 0.4 * room
    step = 1e-3 * room
    for _ in range(40):
        residual = load - _pull(position, scale, pads, curves, deflection)
        error = math.hypot(residual[0], residual[1])
        if error < 0.005 * size:
            break
        jacobian = np.zeros((2, 2))
        for axis in range(2):
            ahead, behind = position.copy(), position.copy()
            ahead[axis] += step
            behind[axis] -= step
            slope = _pull(ahead, scale, pads, curves, deflection) - _pull(behind, scale, pads, curves, deflection)
            jacobian[:, axis] = slope / (2 * step)
        det = jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]
        if abs(det) <= 1e-9 * np.sum(jacobian**2):  # nothing carries in some direction: go where the load pushes
            position = position + 0.1 * room * residual / error
            continue
        move = np.array(
            [
                (residual[0] * jacobian[1, 1] - jacobian[0, 1] * residual[1]) / det,
                (jacobian[0, 0] * residual[1] - jacobian[1, 0] * residual[0]) / det,
            ]
        )
        position = position + move * min(1.0, 0.2 * room / max(math.hypot(move[0], move[1]), 1e-30))
    _pull(position, scale, pads, curves, deflection)
    return position, deflection


@njit(**JIT)
def _pull(
    position: FloatArray, scale: float, pads: FloatArray, curves: FloatArray, deflection: FloatArray
) -> FloatArray:
    """Force of all tabulated films at a position; also sets every pivot's deflection."""
    total = np.zeros(2)
    for m in range(pads.shape[0]):
        reach = pads[m, 2] + pads[m, 0] * position[0] + pads[m, 1] * position[1]
        clearance, compliance = pads[m, 3], pads[m, 4]
        low, high = -0.9 * clearance, min(reach, 0.999 * clearance)
        if compliance > 0.0:  # a + c W(a) rises with a
            for _ in range(30):
                middle = 0.5 * (low + high)
                if middle + compliance * _tabulated(middle, clearance, scale, curves[m]) > reach:
                    high = middle
                else:
                    low = middle
        carried = _tabulated(high, clearance, scale, curves[m])
        deflection[m] = compliance * carried
        total[0] += pads[m, 0] * carried
        total[1] += pads[m, 1] * carried
    return total


@njit(**JIT)
def _tabulated(a: float, clearance: float, scale: float, curve: FloatArray) -> float:
    room = clearance - a
    ratio = a / room
    key = math.sqrt(abs(ratio)) * (1.0 if ratio >= 0 else -1.0)
    keys, loads = curve[0], curve[1]
    if key <= keys[0]:
        return 0.0
    i = np.searchsorted(keys, key)
    if i >= len(keys) or not math.isfinite(keys[i]):
        return scale * loads[i - 1] / room**2
    share = (key - keys[i - 1]) / (keys[i] - keys[i - 1])
    return scale * (loads[i - 1] + share * (loads[i] - loads[i - 1])) / room**2
