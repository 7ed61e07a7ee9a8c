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
from model.film.dense import product
from model.film.energy import heat_step
from model.film.mesh import FilmGrid, FilmWork, film_grid, film_work
from model.film.oil_state import Running, set_viscosity
from model.film.reynolds import FilmForces, solve_film
from model.interpolation import lagrange, largest
from rigdata.arrays import FloatArray

_MESH = (20, 4)
#: Rounding of the heat number, logarithmic: 2 % of the temperature rise.
_STEP = 0.02
#: What the trailing edge of the first film has lost of the gap at the pivot, and by which factors it goes on.
_FIRST, _DEEPER, _FLATTER = 0.4, 1.5, 0.5
#: And what its leading edge has more, about: of central pivots 0.65 to 0.7, of those at 0.65 of the arc 0.6 to 0.7.
_OPENS = 0.66
_ROWS = 24
#: Points of a curve from one row to the next; straight from point to point.
_BETWEEN = 8
#: Films thinner than this share of the clearance, or hotter by so much [K], are of no concern.
_DEEPEST, _HOTTEST = 60.0, 300.0
#: Attitudes beyond this are of no concern: the journal would stand clearances away.
_FARTHEST = -0.8
#: Where a step fails it is halved, up to this factor.
_LEAST_STEP = 0.96
#: A last move by this share of the gap leaves less than the mesh does.
_MOVED = 1e-2
#: Below this wedge, as a share of the first, heat alone balances a film.
_FLATTEST = 0.015


class Attitudes(NamedTuple):
    """Attitudes along the wedge, rising; the first carries nothing."""

    curvature: FloatArray  #: (n,): A
    wedge: FloatArray  #: (n,): B
    load: FloatArray  #: (n,): Radial force [N].
    rise: FloatArray  #: (n, rows, columns): Temperature above the inlet [K].


def attitudes(grid: FilmGrid, clearance: float, running: Running, inlet: float, load: float) -> Attitudes:
    """The curve of a film, as deep as a load [N] asks for; an infinite heat capacity: isothermal."""
    oil, (specific, conductivity) = running.oil, running.heat
    viscosity = oil[0] * math.exp(oil[1] * (40.0 - inlet))
    density = oil[2] * (1.0 + oil[3] * (40.0 - inlet))
    alone = Running(1.0, (1.0, 0.0, 1.0, 0.0), (math.inf, 0.0))
    size = viscosity * running.speed / clearance**2
    if math.isfinite(specific):
        heat = _rounded(density * specific / size), _rounded(conductivity / (size * running.speed))
        alone = Running(1.0, (1.0, oil[1], 1.0, oil[3] * oil[2] / density), heat)
    radius = float(grid.dx / (grid.angle[1] - grid.angle[0]))
    length = 2.0 * float(grid.z[-1])
    unit = size * radius**2 * length
    depth = 4.0 ** math.ceil(math.log(max(load / unit, 1e-3), 4.0))
    ends = round(float(grid.angle[0]), 12), round(float(grid.angle[-1]), 12)
    curve = _attitudes(ends, round(radius, 12), round(length, 12), alone, depth)
    return curve._replace(load=unit * curve.load)


def _rounded(value: float) -> float:
    return math.exp(_STEP * round(math.log(value) / _STEP)) if value > 0.0 else 0.0


@lru_cache(maxsize=256)
def _attitudes(ends: tuple[float, float], radius: float, length: float, running: Running, depth: float) -> Attitudes:
    """Solve the attitudes of a film between two angles from the pivot; none if it never carries.

    `depth` and the loads are over mu U R^2 L / Cp^2.
    """
    grid = film_grid(*ends, radius, length, _MESH, True)
    work = film_work(grid, 40.0)
    numbers = np.zeros((2 * _ROWS, 3))
    rises = np.zeros((2 * _ROWS, work.temperature.size))
    low, high = walk(grid, work, running, depth * radius**2 * length, (numbers, rises))
    if high - low < 3:
        nothing = np.zeros(1)
        return Attitudes(nothing, nothing, nothing, np.zeros((1, *work.temperature.shape)))
    (curvature, wedge, load), rise = points_between(numbers[low - 1 : high], rises[low:high])
    return Attitudes(curvature, wedge, load / (radius**2 * length), rise.reshape(-1, *work.temperature.shape))


@compiled
def points_between(rows: FloatArray, rises: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (A, B, W) of a curve, (3, n), and their temperatures, (n, nodes): cubics through four rows (A, B, W).

    A is nearly a parabola of the wedge, W nearly a power of it; from the first, which carries nothing, on to the next
    all is straight.
    """
    unloaded, rows = rows[0], rows[1:]
    last, count = len(rows) - 1, min(4, len(rows))
    points = np.zeros((3, _BETWEEN * (last + 1) + 1))
    warm = np.zeros((points.shape[1], rises.shape[1]))
    logarithms = np.log(rows[:, 1:])
    for p in range(points.shape[1]):
        row, share = p // _BETWEEN - 1, p % _BETWEEN / _BETWEEN
        if row < 0:
            points[:, p], warm[p] = unloaded + share * (rows[0] - unloaded), rises[0]
            continue
        first = min(max(row - 1, 0), last + 1 - count)
        place = logarithms[row, 0] + share * (logarithms[min(row + 1, last), 0] - logarithms[row, 0])
        points[1, p], power = np.exp(place), 0.0
        by_wedge = lagrange(rows[first : first + count, 1], points[1, p])
        by_power = lagrange(logarithms[first : first + count, 0], place)
        for k in range(count):
            points[0, p] += by_wedge[k] * rows[first + k, 0]
            power += by_power[k] * logarithms[first + k, 1]
            for q in range(warm.shape[1]):
                warm[p, q] += by_wedge[k] * rises[first + k, q]
        points[0, p], points[2, p] = max(points[0, p], _FARTHEST), np.exp(power)
    return points, warm


@compiled
def walk(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    depth: float,
    out: tuple[FloatArray, FloatArray],
) -> tuple[int, int]:
    """Fill rows (A, B, W) and temperature rises, from the middle on flatter and deeper; first row and end.

    `depth`: the largest load. The row before the first is the film that carries nothing: parallel, or, where heat
    carries down to `_FLATTEST`, one that opens. A soft pivot holds a pad there that a rigid one lets go.
    """
    numbers, rises = out
    middle, ahead = numbers.shape[0] // 2, grid.angle[0]
    if not grid.angle[-1] > 0.0 or not ahead < 0.0:
        return middle, middle
    first = _FIRST / np.sin(grid.angle[-1])
    curvature = max(2.0 * (_OPENS + first * ahead) / ahead**2, -0.75)
    if not _fill(grid, work, running, out, middle, (curvature, first)):
        return middle, middle
    low, high = middle, middle + 1
    flatter = _FLATTER
    while low > 1 and flatter < _LEAST_STEP and numbers[low, 0] != _FARTHEST:
        wedge = numbers[low, 1] * flatter
        if wedge < _FLATTEST * first:
            if high - low > 2 and math.isfinite(running.heat[0]):
                _open(grid, work, running, out, (low, high))
            break
        rises[low - 1] = rises[low]  # the parallel film, where rows are few
        first_row = low if high - low > 3 else low - 1
        curvature = _ahead(work, out, wedge, (first_row, min(low + 3, high), low))
        work.ruptured[:] = False
        if _fill(grid, work, running, out, low - 1, (curvature, wedge)):
            low -= 1
        else:
            flatter = np.sqrt(flatter)
    work.ruptured[:] = False
    while high < len(numbers) and numbers[high - 1, 2] <= depth and numbers[high - 1, 0] <= _DEEPEST:
        wedge = numbers[high - 1, 1] * _DEEPER
        curvature = _ahead(work, out, wedge, (max(high - 3, low), high, high - 1))
        if largest(rises[high - 1]) > _HOTTEST or not _fill(grid, work, running, out, high, (curvature, wedge)):
            break
        high += 1
    return low, high


@inner
def _open(
    grid: FilmGrid, work: FilmWork, running: Running, out: tuple[FloatArray, FloatArray], rows: tuple[int, int]
) -> None:
    """Set the row before the first to where a film opens so far that it carries nothing: load falls with the wedge."""
    numbers, (low, high) = out[0], rows
    wedge = product(lagrange(numbers[low : low + 2, 2], 0.2 * numbers[low, 2]), numbers[low : low + 2, 1])
    curvature = _ahead(work, out, wedge, (low, min(low + 3, high), low))
    if _fill(grid, work, running, out, low - 1, (curvature, wedge)):
        weights = lagrange(numbers[low - 1 : low + 1, 2], 0.0)
        for k in range(2):
            numbers[low - 1, k] = weights[0] * numbers[low - 1, k] + weights[1] * numbers[low, k]
    numbers[low - 1, 2] = 0.0


@inner
def _ahead(work: FilmWork, out: tuple[FloatArray, FloatArray], wedge: float, rows: tuple[int, int, int]) -> float:
    """Curvature at a wedge, and temperatures into `work`, as rows head: from the first on, to an end; the nearest."""
    numbers, rises = out
    first, end, nearest = rows
    weights, curvature, rise = lagrange(numbers[first:end, 1], wedge), 0.0, np.zeros(work.temperature.size)
    for k in range(len(weights)):
        curvature += weights[k] * numbers[first + k, 0]
        rise += weights[k] * rises[first + k]
    last = rises[nearest]
    work.temperature.reshape(-1)[:] = 40.0 + np.minimum(np.maximum(rise, 0.5 * last), 1.5 * last)
    most = 0.5 * (1.0 + numbers[nearest, 0])
    return max(numbers[nearest, 0] + min(max(curvature - numbers[nearest, 0], -most), most), -0.75)


@inner
def _fill(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    out: tuple[FloatArray, FloatArray],
    row: int,
    start: tuple[float, float],
) -> bool:
    """Fill a row from a start (A, B); False where nothing balances at that wedge, or carries nothing."""
    (numbers, rises), (curvature, wedge) = out, start
    is_balanced, curvature, load = _balance(grid, work, running, curvature, wedge)
    if not is_balanced or not load > 0.0:
        return False
    numbers[row, 0], numbers[row, 1], numbers[row, 2] = curvature, wedge, load
    rises[row] = work.temperature.reshape(-1) - 40.0
    return True


@inner
def _balance(
    grid: FilmGrid, work: FilmWork, running: Running, curvature: float, wedge: float
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
        if math.isfinite(running.heat[0]):
            warmer, _, radial, tangential = heat_step(grid, work, running, (40.0, 1.0, 30.0), shift)
            moment = moment + tangential
            load = load + radial
            hottest = work.temperature[-1, 0] - 40.0
        slope = room * room * (forces.stiffness[1, 0] - wedge * forces.stiffness[1, 1])
        move = -moment / slope if slope < 0.0 else np.copysign(0.1 * (1.0 + curvature), moment)
        settled = warmer < max(0.3, 0.01 * hottest)
        if settled and curvature == _FARTHEST and move < 0.0:
            return True, curvature, load  # the pad carries as far off as is of concern
        if settled and abs(move) < _MOVED * (1.0 + curvature):
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
