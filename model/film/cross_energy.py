"""The energy equation with the temperature across the film, marched from the leading edge.

    rho c (u T_x + v T_y + w T_z) = k (T_yy + T_zz) + mu (u_y^2 + w_y^2)

in cells between surfaces eta = const, which follow the film's thickness. Heat balances of the cells between two
stations; the flows of oil through their faces are those of the pressure solution, shared among the cells by the
velocity across. Journal: one temperature. Pad: a heat flux that is given, and with it the face's temperature.

Between two stations the exchange with the neighbours is taken half at either (second order), except where a cell
near a wall exchanges more than it carries along: there as far at the later one as keeps the balance monotone. Oil that
runs back near a leading edge carries no heat upstream (T. A. Reyhner, I. Flugge-Lotz, Int. J. Non-Linear Mech. 3
(1968) 173).
"""

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_film import CrossFilm, CrossOperator
from model.film.energy import slope_products
from model.film.matrix import factorise_general
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

_Film = tuple[FilmGrid, FilmWork, CrossFilm]
#: Least share of its Couette flow that a cell is taken to carry downstream.
_LEAST_FLOW = 1e-3
#: Net flow over the leading edge, as a share of the Couette flow, below which the heat balance there is said to be off.
_LEAST_NET_FLOW = 0.2
#: Share of the net flow over the leading edge that may run back beside it before the same is said: with 0.15 a
#: twentieth of the heat is missing in the balance, with 0.2 a seventh.
_MOST_BACK = 0.15


@compiled
def cross_operator(
    grid: FilmGrid,
    work: FilmWork,
    cross: CrossFilm,
    speed: float,
    heat: tuple[float, float, float, float, float],
    operator: CrossOperator,
) -> float:
    """Set up and factorise the heat balances of a film."""
    (nt, lines, cells), n = operator.flows.shape, operator.factor.shape[1]
    factor, before, journal, dissipation, carried, flows = operator
    factor[:] = 0.0
    before[:] = 0.0
    film = (grid, work, cross)
    for i in range(nt):
        for j in range(lines):
            _shared_flow(film, speed, i, j, flows[i, j])
    shape, heating = (lines, cells), np.zeros((nt + 1, n))
    over = np.zeros((lines, cells + 1)), np.zeros((lines + 1, cells))
    space = _Space(*over, np.zeros((4, *shape)), np.zeros(shape), np.zeros(shape))
    for i in range(nt + 1):
        _dissipation(film, speed, i, heating[i])
    # a hotter film shears with less heat: taken as it will be, or the two would swing
    dissipation[:] = 0.5 * heat[2] * (heating[:-1] + heating[1:])
    less = heat[4] * dissipation
    dissipation += less * cross.temperature[1:].reshape((nt, n))
    for i in range(nt):
        _box(film, speed, heat, i, flows, space)
        _set_rows(space, factor[i], before[i])
        exchange, share = space.coupling[1, :, -1], space.theta[:, -1]
        journal[i, :, 0], journal[i, :, 1] = (1.0 - share) * exchange, share * exchange
        factor[i, :, cells] += less[i]
        factorise_general(factor[i])
    carried[:] = heat[0] * np.maximum(flows[-1], 0.0)
    return _flow_back(grid, work, speed, flows[0])


@inner
def _flow_back(grid: FilmGrid, work: FilmWork, speed: float, flows: FloatArray) -> float:
    """See what `cross_operator` returns; `flows` of the cells over the leading edge."""
    net, back = 0.0, 0.0
    for flow in flows.reshape(-1):
        net += flow
        back -= min(flow, 0.0)
    back = max(0.0, back - _MOST_BACK * net) / max(net, 1e-300)
    for j in range(flows.shape[0]):
        dragged = 0.25 * speed * (work.thickness[0, j] * work.density[0, j] + work.thickness[1, j] * work.density[1, j])
        back = max(back, 1.0 - work.flow[0, j] / (_LEAST_NET_FLOW * dragged * grid.height[j]))
    return back


@inner
def _shared_flow(film: _Film, speed: float, i: int, j: int, flow: FloatArray) -> None:
    """Mass flow of every cell through the face between stations i and i + 1 [kg/s]; their sum is the face's."""
    grid, work, cross = film
    edges, cells = cross.edges, len(cross.edges) - 1
    f0, f1 = 0.0, 0.0
    for m in range(cells):
        light = 0.5 * (cross.fluidity[i, j, m] + cross.fluidity[i + 1, j, m]) * (edges[m + 1] - edges[m])
        f0 += light
        f1 += light * 0.5 * (edges[m + 1] + edges[m])
    centre = f1 / f0
    h = 0.5 * (work.thickness[i, j] + work.thickness[i + 1, j])
    pull = (work.pressure[i + 1, j] - work.pressure[i, j]) / grid.dx * h * h
    pull *= 0.5 * (cross.driven[i, j, 0] + cross.driven[i + 1, j, 0])
    mass = 0.5 * (work.density[i, j] + work.density[i + 1, j]) * h * grid.height[j]
    below, total, driven = 0.0, 0.0, 0.0
    for m in range(cells):
        light = 0.5 * (cross.fluidity[i, j, m] + cross.fluidity[i + 1, j, m])
        inside, below = _across_cell(edges, m, centre, (below, speed / f0 * light, pull * light))
        flow[m] = mass * inside
        total += flow[m]
        driven += (edges[m + 1] - edges[m]) * 0.5 * (edges[m] + edges[m + 1])
    # averages over the face differ in the second order: what is left goes with the shear
    missing = work.flow[0, i * grid.steps[0] + j] - total
    for m in range(cells):
        flow[m] += missing * (edges[m + 1] - edges[m]) * 0.5 * (edges[m] + edges[m + 1]) / driven


@inner
def _side_flow(cross: CrossFilm, i: int, j: int, aside: float, flow: FloatArray) -> None:
    """Every cell's part of a flow that pressure drives, between lines j and j + 1 and stations i and i + 1."""
    edges, cells = cross.edges, len(cross.edges) - 1
    centre = 0.25 * (cross.centre[i, j] + cross.centre[i + 1, j] + cross.centre[i, j + 1] + cross.centre[i + 1, j + 1])
    below, total = 0.0, 0.0
    for m in range(cells):
        light = cross.fluidity[i, j, m] + cross.fluidity[i + 1, j, m]
        light += cross.fluidity[i, j + 1, m] + cross.fluidity[i + 1, j + 1, m]
        flow[m], below = _across_cell(edges, m, centre, (below, 0.0, light))
        total += flow[m]
    flow *= aside / total


@inner
def _across_cell(edges: FloatArray, m: int, centre: float, profile: tuple[float, float, float]) -> tuple[float, float]:
    """Integral over a cell of below + shear (eta - a) + slope [(eta^2 - a^2) / 2 - centre (eta - a)]; its end."""
    below, shear, slope = profile
    a, b = edges[m], edges[m + 1]
    wide = b - a
    inside = below * wide + 0.5 * shear * wide * wide
    inside += slope * (((b**3 - a**3) / 3.0 - a * a * wide) * 0.5 - 0.5 * centre * wide * wide)
    return inside, below + shear * wide + slope * (0.5 * (b * b - a * a) - centre * wide)


class _Space(NamedTuple):
    """Flows and couplings of the cells between two stations, (nz + 1, cells) unless said otherwise."""

    up: FloatArray  #: (nz + 1, cells + 1): Over the faces below and above the cells [kg/s].
    sideways: FloatArray  #: (nz + 2, cells): From the line before [kg/s].
    coupling: FloatArray  #: (4, ..): To the cells below and above, the lines before and after [W/K].
    carried: FloatArray  #: Along [W/K].
    theta: FloatArray  #: The later station's share in the exchange.


@inner
def _box(
    film: _Film,
    speed: float,
    heat: tuple[float, float, float, float, float],
    i: int,
    flows: FloatArray,
    space: _Space,
) -> None:
    """Flows and couplings of the cells between stations i and i + 1."""
    grid, work, cross = film
    lines, cells = space.theta.shape
    edges, conductivity, specific = cross.edges, heat[1], heat[0]
    up, sideways, (low, high, first, last), carried, theta = space
    resists = np.empty(cells)  # of half a cell
    for j in range(lines - 1):
        aside = 0.5 * (work.flow[1, i * lines + j] + work.flow[1, (i + 1) * lines + j])
        _side_flow(cross, i, j, aside, sideways[j + 1])
    for j in range(lines):
        h = 0.5 * (work.thickness[i, j] + work.thickness[i + 1, j])
        station = conductivity * grid.dx * grid.height[j] / h
        least = 0.25 * _LEAST_FLOW * speed * h * (work.density[i, j] + work.density[i + 1, j]) * grid.height[j]
        _upward(flows, sideways, grid.first, i, j, up[j])
        for m in range(cells):
            resists[m] = (edges[m + 1] - edges[m]) / (cross.mixing[i, j, m] + cross.mixing[i + 1, j, m])
        for m in range(cells):
            wide = edges[m + 1] - edges[m]
            carried[j, m] = specific * max(flows[i, j, m], least * wide)
            high[j, m] = heat[3] * station / resists[m]
            if m < cells - 1:
                pass_on, rises = station / (resists[m + 1] + resists[m]), specific * up[j, m + 1]
                low[j, m + 1] = max(pass_on + 0.5 * rises, rises, 0.0)
                high[j, m] = max(pass_on - 0.5 * rises, -rises, 0.0)
            if j == lines - 1:  # the edge is upwind: what leaves takes its temperature along
                first[j, m] = 0.5 * specific * max(sideways[j, m], 0.0)
            elif j > 0:
                first[j, m] = conductivity * grid.dx / grid.dz[j - 1] * h * wide + 0.5 * specific * sideways[j, m]
            if j == 0 and grid.first == 1:
                last[j, m] = 0.5 * specific * max(-sideways[1, m], 0.0)
            elif j < lines - 1:
                last[j, m] = conductivity * grid.dx / grid.dz[j] * h * wide - 0.5 * specific * sideways[j + 1, m]
            magnitude = low[j, m] + high[j, m] + first[j, m] + last[j, m]
            theta[j, m] = max(0.5, 1.0 - carried[j, m] / max(magnitude, 1e-300))


@inner
def _upward(flows: FloatArray, sideways: FloatArray, first: int, i: int, j: int, up: FloatArray) -> None:
    """Oil that crosses the cells' upper faces between two stations, from what enters and leaves at their sides.

    What reaches an edge leaves over it at the same height. What is left over all cells, in a ruptured film, is none:
    there dissipation and flow shrink alike.
    """
    nt, cells = flows.shape[0], flows.shape[2]
    edge = j == sideways.shape[0] - 2 or (j == 0 and first == 1)
    total, magnitude, part = 0.0, 0.0, 0.0
    for m in range(cells):
        gain = flows[max(i - 1, 0), j, m] - flows[min(i + 1, nt - 1), j, m]
        if 0 < i < nt - 1:
            gain *= 0.5
        if not edge:
            gain += sideways[j, m] - sideways[j + 1, m]
        total += gain
        magnitude += abs(flows[i, j, m])
        up[m + 1] = total
    for m in range(cells - 1):
        part += abs(flows[i, j, m])
        up[m + 1] -= total * part / magnitude
    up[cells] = 0.0


@inner
def _set_rows(space: _Space, factor: FloatArray, before: FloatArray) -> None:
    """Rows of the balances: later station into the band, earlier one beside it."""
    theta, carried = space.theta, space.carried
    lines, cells = theta.shape
    for j in range(lines):
        for m in range(cells):
            k = j * cells + m
            factor[k, cells] = before[k, 0] = carried[j, m]
            for side in range(4):
                step = 2 * (side % 2) - 1
                line, cell = (j, m + step) if side < 2 else (j + step, m)
                exchange, share = space.coupling[side, j, m], theta[j, m]
                if 0 <= line < lines and 0 <= cell < cells:  # beyond there is the journal, or nothing
                    share = max(share, theta[line, cell])
                    factor[k, cells + (step if side < 2 else cells * step)] -= share * exchange
                    before[k, 1 + side] = (1.0 - share) * exchange
                factor[k, cells] += share * exchange
                before[k, 0] -= (1.0 - share) * exchange


@inner
def _dissipation(film: _Film, speed: float, i: int, dissipation: FloatArray) -> None:
    """Heat made in the cells of a station, per length dx and control-volume height [W], full film."""
    grid, work, cross = film
    p, edges, cells = work.pressure, cross.edges, len(cross.edges) - 1
    behind, ahead = max(i - 1, 0), min(i + 1, len(p) - 1)
    for j in range(p.shape[1]):
        h = work.thickness[i, j]
        slope = (p[ahead, j] - p[behind, j]) / ((ahead - behind) * grid.dx) * h
        across = slope_products(grid, p, p, i, j)[1] * h * h
        along, aside = cross.driven[i, j, 0], cross.driven[i, j, 1]
        drag = speed * cross.shear[i, j] / h
        driven = along * slope * slope + aside * across
        station = h * grid.dx * grid.height[j]
        for m in range(cells):
            wide = edges[m + 1] - edges[m]
            away = 0.5 * (edges[m + 1] + edges[m]) - cross.centre[i, j]
            squared = (drag + slope * away) * (drag + along * slope * away)
            squared += aside * across * away * away + driven * wide * wide / 12.0
            dissipation[j * cells + m] = squared * cross.fluidity[i, j, m] * wide * station
