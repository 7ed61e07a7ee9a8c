"""The oil's temperature, Eq. (3), constant across the film; adiabatic at shaft and pad unless they exchange heat.

Marched along the arc from the leading edge: the box scheme of Keller along the flow (second order, exact mass
flows of the Reynolds solution), centred differences and conduction across, one tridiagonal system per line.
Conduction along the flow is left out: the Peclet number of a film is of the order of 1e6.

Where the film is ruptured, dissipation and flow shrink alike, so that the temperature rises as in a full film;
the mass flows used here are those of the full film.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import Running
from model.film.slopes import pressure_change
from model.interpolation import largest
from rigdata.arrays import FloatArray

#: Least share of the Couette flow that is taken to run downstream. A pressure peak near a leading edge pushes oil
#: back there; what the journal drags in mixes with what returns, so that the net flow is no measure of the heat
#: carried along, and with less than this the temperature there runs away. Bearings as they are run stay above it.
_LEAST_FLOW = 0.2


@compiled
def solve_energy(grid: FilmGrid, work: FilmWork, inlet: float, running: Running, temperature: FloatArray) -> float:
    """March the film temperature from the leading edge: `temperature` (nt + 1, nz + 1) [degC]."""
    rows, columns = temperature.shape
    fields = temperature.reshape((1, rows, columns))
    loss = np.empty((rows, columns))
    sources = np.empty((1, rows, columns))
    heat_sources(grid, work, running, 1.0, sources[0], loss)
    for j in range(columns):
        temperature[0, j] = inlet
    return march(grid, work, running, loss, fields, between(sources))


@inner
def heat_sources(
    grid: FilmGrid, work: FilmWork, running: Running, kept: float, made: FloatArray, loss: FloatArray
) -> None:
    """What stations make [W] and lose per kelvin [W/K] if a share is kept: a hotter film makes less heat."""
    dissipate(grid, work, running.speed, made, loss)
    for i in range(made.shape[0]):
        for j in range(made.shape[1]):
            sheared, pressed = made[i, j], loss[i, j]
            fewer = kept * running.oil[1] * max(sheared - pressed, 0.0)
            made[i, j] = kept * (sheared + pressed + work.gained[i, j]) + fewer * work.temperature[i, j]
            loss[i, j] = work.exchange[i, j] + fewer


@inner
def between(sources: FloatArray) -> FloatArray:
    """What stations make, (m, nt + 1, nz + 1), as what is made between them, (m, nt, nz + 1)."""
    count, rows, columns = sources.shape
    made = np.empty((count, rows - 1, columns))
    for m in range(count):
        for i in range(rows - 1):
            for j in range(columns):
                made[m, i, j] = 0.5 * (sources[m, i, j] + sources[m, i + 1, j])
    return made


@compiled
def march(grid: FilmGrid, work: FilmWork, running: Running, loss: Any, fields: Any, sources: Any) -> float:
    """March any number of temperature fields that differ in their inlet and sources: the equation is linear.

    Real or complex: `loss` (nt + 1, nz + 1) [W/K], `fields` (m, nt + 1, nz + 1) [degC], `sources` (m, nt, nz + 1) [W].
    """
    nz, count = work.flow_z.shape[1], fields.shape[0]
    conduct = np.empty(nz)
    for j in range(nz):
        conduct[j] = 0.25 * running.heat[1] * grid.dx / grid.dz[j]
    main = np.zeros(nz + 1, dtype=loss.dtype)
    rhs = np.zeros((nz + 1, count), dtype=fields.dtype)
    line = (np.zeros(nz + 1), main, np.zeros(nz + 1), rhs)
    return _march_lines(grid, work, running, (loss, fields, sources), line, conduct)


@inner
def _march_lines(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    march: tuple[Any, Any, Any],
    line: tuple[Any, Any, Any, Any],
    conduct: FloatArray,
) -> float:
    """Set up and solve the equations of every line between two stations; see `march`."""
    (loss, fields, sources), (lower, main, upper, rhs) = march, line
    specific, nz, limited = running.heat[0], work.flow_z.shape[1], 0.0
    h, flow_x, flow_z, density = work.thickness, work.flow_x, work.flow_z, work.density
    for i in range(flow_x.shape[0]):
        for j in range(nz + 1):
            dragged = h[i, j] * density[i, j] + h[i + 1, j] * density[i + 1, j]
            couette = 0.25 * running.speed * dragged * grid.height[j]
            flow = flow_x[i, j]
            if flow < _LEAST_FLOW * couette:
                limited = max(limited, 1.0 - flow / couette)
                flow = _LEAST_FLOW * couette
            # factors of (T[j-1] - T[j]) and (T[j+1] - T[j]); half of them act at i, half at i + 1
            low = high = 0.0
            if j > 0:
                south = 0.5 * (flow_z[i, j - 1] + flow_z[i + 1, j - 1])
                film = h[i, j] + h[i, j - 1] + h[i + 1, j] + h[i + 1, j - 1]
                low = -0.5 * (0.5 * specific * south + conduct[j - 1] * film)
                if j == nz:  # the edge is upwind: what leaves takes its temperature along
                    low = -0.25 * specific * max(south, 0.0)
            if j < nz:
                north = 0.5 * (flow_z[i, j] + flow_z[i + 1, j])
                film = h[i, j] + h[i, j + 1] + h[i + 1, j] + h[i + 1, j + 1]
                high = -0.5 * (-0.5 * specific * north + conduct[j] * film)
                if j == 0 and grid.first == 1:
                    high = -0.25 * specific * max(-north, 0.0)
            advect = specific * flow
            lower[j] = low
            main[j] = advect - low - high + 0.5 * loss[i + 1, j]
            upper[j] = high
            for m in range(rhs.shape[1]):
                t = fields[m]
                value = (advect + low + high - 0.5 * loss[i, j]) * t[i, j]
                value += sources[m, i, j]
                if j > 0:
                    value -= low * t[i, j - 1]
                if j < nz:
                    value -= high * t[i, j + 1]
                rhs[j, m] = value
        tridiagonal(lower, main, upper, rhs)
        for m in range(rhs.shape[1]):
            for j in range(nz + 1):
                fields[m, i + 1, j] = rhs[j, m]
    return limited


@compiled
def heat_step(
    grid: FilmGrid, work: FilmWork, running: Running, thermal: tuple[float, float, float], shift: FloatArray
) -> tuple[float, float, float, float]:
    """Temperature for the pressure at hand, and what it will do to that pressure: one call for one film.

    `shift` (unknowns,).
    """
    new = np.empty(work.temperature.shape)
    limited = solve_energy(grid, work, thermal[0], running, new)
    new -= work.temperature
    change, radial, tangential = warm(grid, work, running, new, (thermal[1], thermal[2]), shift)
    return change, limited, radial, tangential


@inner
def warm(
    grid: FilmGrid, work: FilmWork, running: Running, asked: FloatArray, limits: tuple[float, float], shift: FloatArray
) -> tuple[float, float, float]:
    """Change a film's temperature by a share of what is asked for, no more than a limit.

    Returns the largest change asked for [K], and the change of the film's force.
    """
    change = largest(asked.reshape(-1))
    share = limits[0] * min(1.0, limits[1] / max(change, 1e-30))
    for i in range(asked.shape[0]):
        for j in range(asked.shape[1]):
            work.temperature[i, j] += share * asked[i, j]
    force = pressure_change(grid, work, running.speed, running.oil, shift)
    return change, force[0], force[1]


@inner
def dissipate(grid: FilmGrid, work: FilmWork, speed: float, sheared: FloatArray, pressed: FloatArray) -> None:
    """Heat made by shear and by pressure per station of length dx and control-volume height [W], full film.

    Where the viscosity falls by a share, there is less of the one by it and more of the other; (nt + 1, nz + 1).
    """
    h, mu = work.thickness, work.viscosity
    for i in range(h.shape[0]):
        for j in range(h.shape[1]):
            downstream, sideways = slope_products(grid, work.pressure, work.pressure, i, j)
            station = grid.dx * grid.height[j]
            sheared[i, j] = mu[i, j] * speed**2 / h[i, j] * station
            pressed[i, j] = h[i, j] ** 3 / (12.0 * mu[i, j]) * (downstream + sideways) * station


@inner
def slope_products(grid: FilmGrid, p: Any, q: Any, i: int, j: int) -> Any:
    """Products of two pressures' slopes at a node: along, the mean of both sides, which the box scheme sees; across."""
    nt, nz = p.shape[0] - 1, p.shape[1] - 1
    product, sides = 0.0 * q[i, j], 0
    if i > 0:
        product += ((p[i, j] - p[i - 1, j]) / grid.dx) * ((q[i, j] - q[i - 1, j]) / grid.dx)
        sides += 1
    if i < nt:
        product += ((p[i + 1, j] - p[i, j]) / grid.dx) * ((q[i + 1, j] - q[i, j]) / grid.dx)
        sides += 1
    if j == nz:
        wide = grid.dz[nz - 1]
        low = nz - 1
        high = nz
    elif j == 0:
        wide, low, high = grid.dz[0], 0, grid.first  # at a line of symmetry there is no slope
    else:
        wide = grid.dz[j] + grid.dz[j - 1]
        low = j - 1
        high = j + 1
    return product / sides, ((p[i, high] - p[i, low]) / wide) * ((q[i, high] - q[i, low]) / wide)


@inner
def tridiagonal(lower: Any, main: Any, upper: Any, rhs: Any) -> None:
    """Thomas' algorithm in place, real or complex, for the columns of `rhs`, (n, m); the solutions are left there."""
    n, count = rhs.shape
    for j in range(n):
        if j > 0:
            factor = lower[j] * main[j - 1]
            main[j] -= factor * upper[j - 1]
            for m in range(count):
                rhs[j, m] -= factor * rhs[j - 1, m]
        main[j] = 1.0 / main[j]
    for m in range(count):
        rhs[n - 1, m] *= main[n - 1]
        for j in range(n - 2, -1, -1):
            rhs[j, m] = (rhs[j, m] - upper[j] * rhs[j + 1, m]) * main[j]
