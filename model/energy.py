"""The oil's temperature, Eq. (3), constant across the film and adiabatic at shaft and pad.

Marched along the arc from the leading edge: the box scheme of Keller along the flow (second order, exact mass
flows of the Reynolds solution), centred differences and conduction across, one tridiagonal system per line.
Conduction along the flow is left out: the Peclet number of a film is of the order of 1e6.

Where the film is ruptured, dissipation and flow shrink alike, so that the temperature rises as in a full film;
the mass flows used here are those of the full film.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from model.film import FilmGrid, FilmWork

FloatArray = NDArray[np.float64]

#: Least share of the Couette flow that is taken to run downstream. A pressure peak right at a leading edge can
#: push oil back; what then enters is fresh oil, and the march stays well posed.
LEAST_FLOW = 0.05


@njit(cache=True)
def solve_energy(
    grid: FilmGrid,
    work: FilmWork,
    inlet: float,
    speed: float,
    heat: tuple[float, float],
    temperature: FloatArray,
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
    rho c h (u T_x + w T_z) = k h T_zz + mu U^2 / h + h^3 / (12 mu) (p_x^2 + p_z^2).
    """
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    limited = 0.0
    temperature[0, :] = inlet
    lower = np.zeros(nz + 1)
    main = np.zeros(nz + 1)
    upper = np.zeros(nz + 1)
    right = np.zeros(nz + 1)
    for i in range(nt):
        for j in range(nz + 1):
            couette = (
                0.25
                * speed
                * (work.thickness[i, j] * work.density[i, j] + work.thickness[i + 1, j] * work.density[i + 1, j])
                * grid.height[j]
            )
            flow = work.flow_x[i, j]
            if flow < LEAST_FLOW * couette:
                limited = max(limited, 1.0 - flow / couette)
                flow = LEAST_FLOW * couette
            advect = heat[0] * flow
            # half of the cross-flow terms act at i, half at i + 1
            low, high = _across(grid, work, heat, i, j)
            main[j] = advect - low - high
            lower[j] = low
            upper[j] = high
            right[j] = (advect + low + high) * temperature[i, j] + _dissipation(grid, work, speed, i, j)
            if j > 0:
                right[j] -= low * temperature[i, j - 1]
            if j < nz:
                right[j] -= high * temperature[i, j + 1]
        _thomas(lower, main, upper, right)
        temperature[i + 1, :] = right
    return limited


@njit(cache=True)
def _across(grid: FilmGrid, work: FilmWork, heat: tuple[float, float], i: int, j: int) -> tuple[float, float]:
    """Coefficients of (T[j-1] - T[j]) and (T[j+1] - T[j]) in the half-step's cross-flow terms [W/K]."""
    nz = work.flow_z.shape[1]
    low = high = 0.0
    if j > 0:
        south = 0.5 * (work.flow_z[i, j - 1] + work.flow_z[i + 1, j - 1])
        h = 0.25 * (
            work.thickness[i, j] + work.thickness[i, j - 1] + work.thickness[i + 1, j] + work.thickness[i + 1, j - 1]
        )
        low = -0.5 * (0.5 * heat[0] * south + heat[1] * h * grid.dx / grid.dz)
        if (
            j == nz
        ):  # the edge: only the half volume's own face, and upwind, because what leaves takes its temperature along
            low = -0.5 * (0.5 * heat[0] * max(south, 0.0))
    if j < nz:
        north = 0.5 * (work.flow_z[i, j] + work.flow_z[i + 1, j])
        h = 0.25 * (
            work.thickness[i, j] + work.thickness[i, j + 1] + work.thickness[i + 1, j] + work.thickness[i + 1, j + 1]
        )
        high = -0.5 * (-0.5 * heat[0] * north + heat[1] * h * grid.dx / grid.dz)
        if j == 0 and grid.first == 1:
            high = -0.5 * (0.5 * heat[0] * max(-north, 0.0))
    return low, high


@njit(cache=True)
def _dissipation(grid: FilmGrid, work: FilmWork, speed: float, i: int, j: int) -> float:
    """Heat made in the volume between lines i and i + 1 [W]."""
    p, h, mu = work.pressure, work.thickness, work.viscosity
    nz = work.flow_z.shape[1]
    slope_x = (p[i + 1, j] - p[i, j]) / grid.dx
    total = 0.0
    for m in range(i, i + 2):
        if j == 0:
            slope_z = 0.0 if grid.first == 0 else (p[m, 1] - p[m, 0]) / grid.dz
        elif j == nz:
            slope_z = (p[m, nz] - p[m, nz - 1]) / grid.dz
        else:
            slope_z = 0.5 * (p[m, j + 1] - p[m, j - 1]) / grid.dz
        shear = mu[m, j] * speed**2 / h[m, j]
        total += 0.5 * (shear + h[m, j] ** 3 / (12.0 * mu[m, j]) * (slope_x**2 + slope_z**2))
    return total * grid.dx * grid.height[j]


@njit(cache=True)
def _thomas(lower: FloatArray, main: FloatArray, upper: FloatArray, right: FloatArray) -> None:
    n = len(main)
    for j in range(1, n):
        factor = lower[j] / main[j - 1]
        main[j] -= factor * upper[j - 1]
        right[j] -= factor * right[j - 1]
    right[n - 1] /= main[n - 1]
    for j in range(n - 2, -1, -1):
        right[j] = (right[j] - upper[j] * right[j + 1]) / main[j]
