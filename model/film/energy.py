"""The oil's temperature, Eq. (3), constant across the film; adiabatic at shaft and pad unless they exchange heat.

Marched along the arc from the leading edge: the box scheme of Keller along the flow (second order, exact mass
flows of the Reynolds solution), centred differences and conduction across, one tridiagonal system per line.
Conduction along the flow is left out: the Peclet number of a film is of the order of 1e6.

Where the film is ruptured, dissipation and flow shrink alike, so that the temperature rises as in a full film;
the mass flows used here are those of the full film.
"""

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
    sources, loss = heat_sources(grid, work, running, 1.0)
    shape = (1, *temperature.shape)
    temperature[0] = inlet
    return march(grid, work, running, loss, temperature.reshape(shape), between(sources.reshape(shape)))


@inner
def heat_sources(grid: FilmGrid, work: FilmWork, running: Running, share: float) -> tuple[FloatArray, FloatArray]:
    """What stations make [W] and lose per kelvin [W/K] if a share is kept: a hotter film makes less heat."""
    heat = dissipated(grid, work, running.speed)
    sheared, pressed = heat[0], heat[1] + heat[2]
    fewer = share * running.oil[1] * np.maximum(sheared - pressed, 0.0)
    return share * (sheared + pressed + work.gained) + fewer * work.temperature, work.exchange + fewer


@inner
def between(sources: FloatArray) -> FloatArray:
    """What stations make, (m, nt + 1, nz + 1), as what is made between them, (m, nt, nz + 1)."""
    return 0.5 * (sources[:, :-1] + sources[:, 1:])


@compiled
def march(grid: FilmGrid, work: FilmWork, running: Running, loss: Any, fields: Any, sources: Any) -> float:
    """March any number of temperature fields that differ in their inlet and sources: the equation is linear.

    Real or complex: `loss` (nt + 1, nz + 1) [W/K], `fields` (m, nt + 1, nz + 1) [degC], `sources` (m, nt, nz + 1) [W].
    """
    specific, h, density = running.heat[0], work.thickness, work.density
    (count, rows, lines), limited = fields.shape, 0.0
    sides, main = np.zeros((2, lines)), np.zeros(lines, dtype=loss.dtype)
    rhs = np.zeros((lines, count), dtype=fields.dtype)
    for i in range(rows - 1):
        side_exchange(grid, running, i, (work.flow, h), work.flow, sides)
        for j in range(lines):
            low, high, flow = sides[0, j], sides[1, j], work.flow[0, i * lines + j]
            dragged = h[i, j] * density[i, j] + h[i + 1, j] * density[i + 1, j]
            couette = 0.25 * running.speed * dragged * grid.height[j]
            if flow < _LEAST_FLOW * couette:
                limited = max(limited, 1.0 - flow / couette)
                flow = _LEAST_FLOW * couette
            advect = specific * flow
            main[j] = advect - low - high + 0.5 * loss[i + 1, j]
            for m in range(count):
                t = fields[m, i]
                value = (advect + low + high - 0.5 * loss[i, j]) * t[j] + sources[m, i, j]
                if j > 0:
                    value -= low * t[j - 1]
                if j < lines - 1:
                    value -= high * t[j + 1]
                rhs[j, m] = value
        tridiagonal(sides[0], main, sides[1], rhs)
        for m in range(count):
            for j in range(lines):
                fields[m, i + 1, j] = rhs[j, m]
    return limited


@inner
def side_exchange(
    grid: FilmGrid, running: Running, i: int, carried: tuple[Any, FloatArray], steady: FloatArray, sides: Any
) -> None:
    """Factors of (T[j-1] - T[j]) and (T[j+1] - T[j]) after station i, (2, lines); half of them act there, half beyond.

    Linear in what is carried, mass flow (2, nodes) and thickness (nt + 1, nz + 1), real or complex; the sense of a
    `steady` flow says whether oil enters at an edge.
    """
    (flow, h), (lower, upper), lines = carried, sides, sides.shape[1]
    for j in range(lines - 1):
        n = i * lines + j
        aside = 0.25 * running.heat[0] * (flow[1, n] + flow[1, n + lines])
        film = h[i, j] + h[i, j + 1] + h[i + 1, j] + h[i + 1, j + 1]
        conducted = 0.25 * running.heat[1] * grid.dx / grid.dz[j] * film
        upper[j], lower[j + 1] = 0.5 * (aside - conducted), -0.5 * (aside + conducted)
        # the edges are upwind: what leaves takes its temperature along
        leaves = steady[1, n] + steady[1, n + lines] > 0.0
        if j == lines - 2:
            lower[j + 1] = -0.5 * aside if leaves else 0.0 * aside
        if j == 0 and grid.first == 1:
            upper[j] = 0.0 * aside if leaves else 0.5 * aside


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
    grid: FilmGrid, work: FilmWork, running: Running, rise: FloatArray, limits: tuple[float, float], shift: FloatArray
) -> tuple[float, float, float]:
    """Change a film's temperature by a share of the rise that is asked for, no more than a limit.

    Returns the largest change asked for [K], and the change of the film's force.
    """
    change = largest(rise.reshape(-1))
    work.temperature[:] += limited_share(change, limits) * rise
    radial, tangential = pressure_change(grid, work, running.speed, running.oil, shift)
    return change, radial, tangential


@inner
def limited_share(change: float, limits: tuple[float, float]) -> float:
    """Share of a change of temperature [K] that is made, of two limits: a share, and kelvins."""
    return limits[0] * min(1.0, limits[1] / max(abs(change), 1e-30))


@inner
def dissipated(grid: FilmGrid, work: FilmWork, speed: float) -> FloatArray:
    """Heat made by shear, by pressure along and across, per station of length dx and control-volume height [W], full.

    (3, nt + 1, nz + 1). Where the viscosity falls by a share, there is less of the first by it and more of the others.
    """
    h, mu = work.thickness, work.viscosity
    heat = np.empty((3, h.shape[0], h.shape[1]))
    for i in range(h.shape[0]):
        for j in range(h.shape[1]):
            downstream, sideways = slope_products(grid, work.pressure, work.pressure, i, j)
            station = grid.dx * grid.height[j]
            driven = h[i, j] ** 3 / (12.0 * mu[i, j]) * station
            heat[0, i, j] = mu[i, j] * speed**2 / h[i, j] * station
            heat[1, i, j], heat[2, i, j] = driven * downstream, driven * sideways
    return heat


@inner
def slope_products(grid: FilmGrid, p: Any, q: Any, i: int, j: int) -> Any:
    """Products of two pressures' slopes at a node: along, the mean of both sides, which the box scheme sees; across."""
    behind, ahead, left, right = max(i - 1, 0), min(i + 1, len(p) - 1), max(j - 1, 0), min(j + 1, len(grid.dz))
    along = (p[i, j] - p[behind, j]) * (q[i, j] - q[behind, j]) + (p[ahead, j] - p[i, j]) * (q[ahead, j] - q[i, j])
    wide = grid.z[right] - grid.z[left]
    if j < 1 - grid.first:
        left = right  # at a line of symmetry there is no slope
    across = (p[i, right] - p[i, left]) * (q[i, right] - q[i, left])
    return along / ((ahead - behind) * grid.dx**2), across / wide**2


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
