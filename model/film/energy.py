"""The oil's temperature, Eq. (3), constant across the film; adiabatic at shaft and pad unless they exchange heat.

Marched along the arc from the leading edge: the box scheme of Keller along the flow (second order, exact mass
flows of the Reynolds solution), centred differences and conduction across, one tridiagonal system per line.
Conduction along the flow is left out: the Peclet number of a film is of the order of 1e6.

Where the film is ruptured, dissipation and flow shrink alike, so that the temperature rises as in a full film;
the mass flows used here are those of the full film.
"""

from __future__ import annotations

import numpy as np

from model.arrays import FloatArray
from model.compilation import compiled
from model.film.mesh import FilmGrid, FilmWork
from model.film.slopes import pressure_change

#: Least share of the Couette flow that is taken to run downstream. A pressure peak near a leading edge pushes oil
#: back there; what the journal drags in mixes with what returns, so that the net flow is no measure of the heat
#: carried along, and with less than this the temperature there runs away. Bearings as they are run stay above it.
LEAST_FLOW = 0.2


@compiled
def solve_energy(
    grid: FilmGrid, work: FilmWork, inlet: float, speed: float, heat: tuple[float, float], temperature: FloatArray
) -> float:
    """March the film temperature from the leading edge.

    Parameters
    ----------
    grid, work
        Mesh and the pressure solution (pressure, thickness, viscosity, density, flows).
    inlet : float
        Temperature at the leading edge [degC].
    speed : float
        Surface speed of the journal [m/s].
    heat : tuple of float
        Specific heat [J/kg/K] and conductivity [W/m/K] of the oil.
    temperature : (nt + 1, nz + 1) ndarray
        Overwritten with the new temperature [degC].

    Returns
    -------
    float
        Largest share of a line's flow that had to be limited (0: no flow back at the leading edge).

    Notes
    -----
    Integrated over the film thickness, Eq. (3) reads
    rho c h (u T_x + w T_z) = k h T_zz + mu U^2 / h + h^3 / (12 mu) (p_x^2 + p_z^2) - exchange T + gained;
    the last two are what pad and journal take and give (`model.statics.heat_paths`), zero in the adiabatic baseline.
    """
    fields = temperature.reshape((1, temperature.shape[0], temperature.shape[1]))
    sources = np.empty((1, temperature.shape[0], temperature.shape[1]))
    made = dissipation(grid, work, speed)
    for i in range(temperature.shape[0]):
        for j in range(temperature.shape[1]):
            sources[0, i, j] = made[i, j] + work.gained[i, j]
    for j in range(temperature.shape[1]):
        temperature[0, j] = inlet
    return march(grid, work, speed, heat, fields, sources)


@compiled
def march(
    grid: FilmGrid, work: FilmWork, speed: float, heat: tuple[float, float], fields: FloatArray, sources: FloatArray
) -> float:
    """March any number of temperature fields that differ in their inlet and sources: the equation is linear.

    Parameters
    ----------
    grid, work, speed, heat
        As for `solve_energy`; `work.exchange` is what every kelvin loses [W/K].
    fields : (m, nt + 1, nz + 1) ndarray
        Row 0 holds the temperature at the leading edge; the rest is overwritten [degC].
    sources : (m, nt + 1, nz + 1) ndarray
        Heat per station of length dx and control-volume height [W].

    Returns
    -------
    float
        Largest share of a line's flow that had to be limited.
    """
    nz = work.flow_z.shape[1]
    count = fields.shape[0]
    limited = 0.0
    lower, main, upper = np.zeros(nz + 1), np.zeros(nz + 1), np.zeros(nz + 1)
    right = np.zeros((nz + 1, count))
    h, flow_x, flow_z, density = work.thickness, work.flow_x, work.flow_z, work.density
    conduct = heat[1] * grid.dx
    for i in range(work.flow_x.shape[0]):
        for j in range(nz + 1):
            couette = 0.25 * speed * (h[i, j] * density[i, j] + h[i + 1, j] * density[i + 1, j]) * grid.height[j]
            flow = flow_x[i, j]
            if flow < LEAST_FLOW * couette:
                limited = max(limited, 1.0 - flow / couette)
                flow = LEAST_FLOW * couette
            # factors of (T[j-1] - T[j]) and (T[j+1] - T[j]); half of them act at i, half at i + 1
            low = high = 0.0
            if j > 0:
                south = 0.5 * (flow_z[i, j - 1] + flow_z[i + 1, j - 1])
                film = 0.25 * (h[i, j] + h[i, j - 1] + h[i + 1, j] + h[i + 1, j - 1])
                low = -0.5 * (0.5 * heat[0] * south + conduct / grid.dz[j - 1] * film)
                if j == nz:  # the edge is upwind: what leaves takes its temperature along
                    low = -0.25 * heat[0] * max(south, 0.0)
            if j < nz:
                north = 0.5 * (flow_z[i, j] + flow_z[i + 1, j])
                film = 0.25 * (h[i, j] + h[i, j + 1] + h[i + 1, j] + h[i + 1, j + 1])
                high = -0.5 * (-0.5 * heat[0] * north + conduct / grid.dz[j] * film)
                if j == 0 and grid.first == 1:
                    high = -0.25 * heat[0] * max(-north, 0.0)
            advect = heat[0] * flow
            lower[j], main[j], upper[j] = low, advect - low - high + 0.5 * work.exchange[i + 1, j], high
            for m in range(count):
                t = fields[m]
                value = (advect + low + high - 0.5 * work.exchange[i, j]) * t[i, j]
                value += 0.5 * (sources[m, i, j] + sources[m, i + 1, j])
                if j > 0:
                    value -= low * t[i, j - 1]
                if j < nz:
                    value -= high * t[i, j + 1]
                right[j, m] = value
        _tridiagonal(lower, main, upper, right)
        for m in range(count):
            for j in range(nz + 1):
                fields[m, i + 1, j] = right[j, m]
    return limited


@compiled
def heat_step(
    grid: FilmGrid,
    work: FilmWork,
    speed: float,
    oil: tuple[float, float, float, float],
    heat: tuple[float, float],
    thermal: tuple[float, float, float],
    shift: FloatArray,
) -> tuple[float, float, float, float]:
    """Temperature for the pressure at hand, and what it will do to that pressure: one call for one film.

    Parameters
    ----------
    grid, work, speed, heat
        As for `solve_energy`; `work.temperature` is moved towards the new one.
    oil : tuple of float
        See `model.statics.pad_film.oil_constants`.
    thermal : tuple of float
        Inlet temperature [degC]; relaxation of the temperature; largest step [K].
    shift : (unknowns,) ndarray
        Overwritten with the change of pressure; see `model.film.slopes.pressure_change`.

    Returns
    -------
    tuple of float
        Largest change of temperature that the pressure asks for [K]; limited share of a flow, see `march`; change of
        the radial and of the tangential force [N].
    """
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    new = np.empty((nt + 1, nz + 1))
    limited = solve_energy(grid, work, thermal[0], speed, heat, new)
    change = 0.0
    for i in range(nt + 1):
        for j in range(nz + 1):
            change = max(change, abs(new[i, j] - work.temperature[i, j]))
    share = thermal[1] * min(1.0, thermal[2] / max(change, 1e-30))
    for i in range(nt + 1):
        for j in range(nz + 1):
            work.temperature[i, j] += share * (new[i, j] - work.temperature[i, j])
    force = pressure_change(grid, work, speed, oil, shift)
    return change, limited, force[0], force[1]


@compiled
def dissipation(grid: FilmGrid, work: FilmWork, speed: float) -> FloatArray:
    """Heat made per station of length dx and control-volume height [W], full film; shape (nt + 1, nz + 1).

    Parameters
    ----------
    grid : FilmGrid
        Mesh of the film.
    work : FilmWork
        Solved pressure, thickness and viscosity.
    speed : float
        Surface speed of the journal [m/s].
    """
    p, h, mu = work.pressure, work.thickness, work.viscosity
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    out = np.empty((nt + 1, nz + 1))
    for i in range(nt + 1):
        for j in range(nz + 1):
            # mean of the squared slopes on both sides: what the box between two stations sees, to second order
            squared, sides = 0.0, 0
            if i > 0:
                squared += ((p[i, j] - p[i - 1, j]) / grid.dx) ** 2
                sides += 1
            if i < nt:
                squared += ((p[i + 1, j] - p[i, j]) / grid.dx) ** 2
                sides += 1
            if j == nz:
                slope = (p[i, nz] - p[i, nz - 1]) / grid.dz[nz - 1]
            elif j == 0:
                slope = 0.0 if grid.first == 0 else (p[i, 1] - p[i, 0]) / grid.dz[0]
            else:
                slope = (p[i, j + 1] - p[i, j - 1]) / (grid.dz[j] + grid.dz[j - 1])
            shear = mu[i, j] * speed**2 / h[i, j]
            pressed = h[i, j] ** 3 / (12.0 * mu[i, j]) * (squared / sides + slope**2)
            out[i, j] = (shear + pressed) * grid.dx * grid.height[j]
    return out


@compiled
def _tridiagonal(lower: FloatArray, main: FloatArray, upper: FloatArray, right: FloatArray) -> None:
    """Thomas' algorithm in place for the columns of `right`, (n, m); the solutions are left there."""
    n, count = right.shape
    for j in range(1, n):
        factor = lower[j] / main[j - 1]
        main[j] -= factor * upper[j - 1]
        for m in range(count):
            right[j, m] -= factor * right[j - 1, m]
    for m in range(count):
        right[n - 1, m] /= main[n - 1]
        for j in range(n - 2, -1, -1):
            right[j, m] = (right[j, m] - upper[j] * right[j + 1, m]) / main[j]
