"""The loaded attitudes of one pad: the curve of load over approach on the film as it is, heated.

A pad that tilts freely pushes along its pivot line only. With A = a / (Cp - a), B = b / (Cp - a) every wedge B has one
A at which the film's moment vanishes, with the film as warm as it makes itself there. From a deep wedge on the approach
falls down to a fold, beyond which nothing balances; what comes back from there is unstable in tilt. Cold, a central
pivot's fold is at A = 0; heated, viscosity falls along the film, and it is beyond.

The film is solved at clearance 1, speed 1, inlet viscosity 1: only the heat number is left of speed, clearance and oil.
It is rounded to `_STEP`, so that bearings that are nearly alike share a curve: it is where searches start, and which
pads are near their fold; the film decides.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import heat_step
from model.film.mesh import FilmGrid, FilmWork, film_grid, film_work
from model.film.oil_state import Running, set_viscosity
from model.film.reynolds import FilmForces, solve_film
from model.interpolation import largest
from rigdata.arrays import FloatArray

_MESH = (20, 4)
#: Rounding of the heat number, logarithmic: 2 % of the temperature rise.
_STEP = 0.02
#: What the trailing edge of the first film has lost of the gap at the pivot, and by which factors it goes on.
_FIRST, _DEEPER, _FLATTER = 0.4, 1.4, 0.68
_ROWS = 40
#: Points of a curve from one row to the next: cubics through four rows, straight from point to point.
BETWEEN = 4
#: Films thinner than this share of the clearance, or hotter by so much [K], are of no concern.
_DEEPEST, _HOTTEST = 60.0, 300.0
#: Attitudes beyond this are of no concern: the journal would stand clearances away.
_FARTHEST = -0.8
#: Where a step fails it is halved, up to this factor.
_LEAST_STEP = 0.96
#: Below this wedge, as a share of the first, heat alone balances a film.
_FLATTEST = 0.015


class Attitudes(NamedTuple):
    """Attitudes along the wedge, rising; the first is the parallel film."""

    curvature: FloatArray  #: (n,): A
    wedge: FloatArray  #: (n,): B
    load: FloatArray  #: (n,): Radial force over mu U R^2 L / Cp^2.
    rise: FloatArray  #: (n // `BETWEEN` + 1, rows, columns): Temperature above the inlet [K].


class Heat(NamedTuple):
    """What heats a film of clearance 1, speed 1 and inlet viscosity 1."""

    exponent: float  #: kappa [1/K]
    expansion: float  #: alpha_v at the inlet [1/K]
    capacity: float  #: rho c Cp^2 / (mu U) [1/K, per metre]
    conduction: float  #: k Cp^2 / (mu U^2) [1/K]


ISOTHERMAL = Heat(0.0, 0.0, math.inf, 0.0)


def attitudes(grid: FilmGrid, clearance: float, running: Running, inlet: float, load: float) -> Attitudes:
    """The curve of a film, as deep as a load [N] asks for; an infinite heat capacity: isothermal."""
    oil, (specific, conductivity) = running.oil, running.heat
    viscosity = oil[0] * math.exp(oil[1] * (40.0 - inlet))
    density = oil[2] * (1.0 + oil[3] * (40.0 - inlet))
    heat = ISOTHERMAL
    size = viscosity * running.speed / clearance**2
    if math.isfinite(specific):
        capacity = _rounded(density * specific / size)
        conduction = _rounded(conductivity / (size * running.speed))
        heat = Heat(oil[1], oil[3] * oil[2] / density, capacity, conduction)
    radius = float(grid.dx * (len(grid.angle) - 1) / (grid.angle[-1] - grid.angle[0]))
    length = 2.0 * float(grid.z[-1])
    deepest = load / (size * radius**2 * length)
    depth = 4.0 ** math.ceil(math.log(max(deepest, 1e-3), 4.0))
    ends = round(float(grid.angle[0]), 12), round(float(grid.angle[-1]), 12)
    return _attitudes(ends, round(radius, 12), round(length, 12), heat, depth)


def _rounded(value: float) -> float:
    return math.exp(_STEP * round(math.log(value) / _STEP)) if value > 0.0 else 0.0


@lru_cache(maxsize=256)
def _attitudes(ends: tuple[float, float], radius: float, length: float, heat: Heat, depth: float) -> Attitudes:
    """Solve the attitudes of a film between two angles from the pivot; none if it never carries."""
    grid = film_grid(*ends, radius, length, _MESH, True)
    work = film_work(grid, 40.0)
    shape = work.temperature.shape
    isothermal = math.isinf(heat.capacity)
    oil = (1.0, heat.exponent, 1.0, heat.expansion)
    running = Running(1.0, oil, (1.0 if isothermal else heat.capacity, heat.conduction))
    numbers = np.zeros((2 * _ROWS, 3))
    rises = np.zeros((2 * _ROWS, *shape))
    low, high = walk(grid, work, running, (isothermal, depth * radius**2 * length), (numbers, rises))
    numbers[low - 1] = 0.0  # a parallel film
    if not isothermal:
        rises[low - 1] = rises[low]
    rows = slice(low - 1, high)
    if high - low < 3:
        nothing = np.zeros(1)
        return Attitudes(nothing, nothing, nothing, np.zeros((1, *shape)))
    curvature, wedge, load = _between(numbers[rows]).T.copy()
    return Attitudes(curvature, wedge, load / (radius**2 * length), rises[rows].copy())


def _between(rows: FloatArray) -> FloatArray:
    """Points of a curve (A, B, W) between its rows, (n, 3): cubics in log(B), straight from the parallel film on."""
    along = np.log(rows[:, 1] + rows[1, 1])
    place = np.arange(BETWEEN * (len(rows) - 1) + 1) / BETWEEN
    x = np.interp(place, np.arange(len(rows)), along)
    first = np.clip(place.astype(int) - 1, 1, len(rows) - 4)
    out = np.zeros((len(x), 3))
    for k in range(4):
        others = [(x - along[first + j]) / (along[first + k] - along[first + j]) for j in range(4) if j != k]
        out += np.prod(others, axis=0)[:, None] * rows[first + k]
    straight = place[: BETWEEN + 1, None]
    out[: BETWEEN + 1] = (1.0 - straight) * rows[0] + straight * rows[1]
    out[:, 0] = np.maximum(out[:, 0], _FARTHEST)
    return out


@compiled
def walk(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    limits: tuple[bool, float],
    out: tuple[FloatArray, FloatArray],
) -> tuple[int, int]:
    """Fill rows (A, B, W) and temperature rises, from the middle on deeper and flatter; first row and end.

    `limits`: whether the film is isothermal, the largest load.
    """
    numbers, rises = out
    isothermal, depth = limits
    middle = numbers.shape[0] // 2
    if not grid.angle[-1] > 0.0 or not grid.angle[0] < 0.0:
        return middle, middle
    first = _FIRST / np.sin(grid.angle[-1])
    low, high, curvature = middle, middle, 0.1
    for row in range(middle, numbers.shape[0]):
        wedge = first * _DEEPER ** (row - middle)
        if row > middle + 1:
            slope = (numbers[row - 1, 0] - numbers[row - 2, 0]) / (numbers[row - 1, 1] - numbers[row - 2, 1])
            curvature = numbers[row - 1, 0] + slope * (wedge - numbers[row - 1, 1])
            _warm(work, rises, row - 1, row - 2)
        found, curvature, load = _balance(grid, work, running, isothermal, curvature, wedge)
        if not found:
            break
        _keep(work, numbers, rises, row, (curvature, wedge, load))
        high = row + 1
        hottest = largest(rises[row].reshape(-1))
        if load > depth or curvature > _DEEPEST or hottest > _HOTTEST:
            break
    if high == middle:
        return middle, middle
    row, flatter = middle - 1, _FLATTER
    while row > 0 and flatter < _LEAST_STEP:
        before = row + 1
        wedge = numbers[before, 1] * flatter
        if wedge < _FLATTEST * first:
            break
        curvature = numbers[before, 0] * flatter
        if row + 2 < high:
            slope = (numbers[before, 0] - numbers[row + 2, 0]) / (numbers[before, 1] - numbers[row + 2, 1])
            most = 0.3 * (1.0 + numbers[before, 0])
            curvature = numbers[before, 0] + min(max(slope * (wedge - numbers[before, 1]), -most), most)
        _warm(work, rises, before, min(before + 1, high - 1))
        work.ruptured[:] = False
        found, curvature, load = _balance(grid, work, running, isothermal, max(curvature, -0.75), wedge)
        if found and load > 0.0:
            _keep(work, numbers, rises, row, (curvature, wedge, load))
            low, row = row, row - 1
            if curvature == _FARTHEST:
                break
        else:
            flatter = np.sqrt(flatter)
    return low, high


@inner
def _warm(work: FilmWork, rises: FloatArray, last: int, before: int) -> None:
    """Temperatures as the last two rows head, row by row."""
    for i in range(work.temperature.shape[0]):
        for j in range(work.temperature.shape[1]):
            rise = rises[last, i, j]
            work.temperature[i, j] = 40.0 + min(max(2.0 * rise - rises[before, i, j], 0.5 * rise), 1.5 * rise)


@inner
def _keep(
    work: FilmWork, numbers: FloatArray, rises: FloatArray, row: int, attitude: tuple[float, float, float]
) -> None:
    numbers[row, 0], numbers[row, 1], numbers[row, 2] = attitude
    for i in range(work.temperature.shape[0]):
        for j in range(work.temperature.shape[1]):
            rises[row, i, j] = work.temperature[i, j] - 40.0


@inner
def _balance(
    grid: FilmGrid, work: FilmWork, running: Running, isothermal: bool, curvature: float, wedge: float
) -> tuple[bool, float, float]:
    """A at which the heated film has no moment, and its load: more A takes the pressure upstream."""
    shift = np.empty(work.unknown.shape[0])
    load, share, last = 0.0, 1.0, 0.0
    for _step in range(40):
        set_viscosity(work, running.oil)
        room = 1.0 / (1.0 + curvature)
        forces: FilmForces = solve_film(grid, work, (1.0, curvature * room, wedge * room), 1.0, False)
        if forces.steps <= 0:  # gone at the trailing edge: a larger A opens it
            curvature, last = 1.5 * curvature + 0.2, 0.0
            continue
        moment, load, warmer, hottest = forces.force[1], forces.force[0], 0.0, 0.0
        if not isothermal:
            warmer, _, radial, tangential = heat_step(grid, work, running, (40.0, 1.0, 30.0), shift)
            moment = moment + tangential
            load = load + radial
            hottest = work.temperature[-1, 0] - 40.0
        slope = room * room * (forces.stiffness[1, 0] - wedge * forces.stiffness[1, 1])
        move = -moment / slope if slope < 0.0 else np.copysign(0.1 * (1.0 + curvature), moment)
        settled = warmer < max(0.3, 0.01 * hottest)
        if settled and curvature == _FARTHEST and move < 0.0:
            return True, curvature, load  # the pad carries as far off as is of concern
        if settled and abs(move) < 1e-3 * (1.0 + curvature):
            return True, curvature + share * move, load
        # a film that comes nearer grows hotter, and needs less of a step than one that stays as warm (Aitken)
        if last != 0.0:
            turn = 1.0 - move / last
            share = min(max(share / turn, 0.15), 1.0) if turn > 0.0 else 1.0
        last = move
        most = 0.3 * (1.0 + curvature)
        curvature = max(curvature + min(max(share * move, -most), most), _FARTHEST)
        if curvature > 3.0 * _DEEPEST:
            break
    return False, curvature, load
