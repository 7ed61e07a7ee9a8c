"""A film's impedance with a temperature and viscosity that follow the motion.

The perturbation of the baseline freezes the viscosity. Here the energy equation is perturbed too, at the excitation
frequency omega: with h = h0 + h' exp(i omega t), the same for p and T, and mu' = -kappa mu T', rho' = -alpha rho_40 T',

    rho c h (i omega T') + c (m . grad T)' = k (h dT/dz)'_z + made',    div m' + i omega (rho h)' = 0,

m the mass flows, made the dissipation. p' and T' follow from each other; they are found in turn, which contracts as
the heat does in an equilibrium. The oil enters at its own temperature, and journal and pads keep theirs: they are too
heavy to follow. At omega = 0 this is the slope of the static locus; far above one turn of oil it is the frozen film.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import dissipate, march, slope_products
from model.film.matrix import substitute
from model.film.mesh import Faces, FilmGrid, FilmWork, Wedge
from model.film.oil_state import Running
from model.film.reynolds import conductances
from model.film.slopes import flow_changes, force_of, keep_ruptured, net_inflow
from model.interpolation import largest
from rigdata.arrays import ComplexArray, FloatArray

#: Turns of pressure and heat, and the change of temperature at which they end, as a share of the temperature.
_MOST_TURNS, _SETTLED = 60, 1e-7


class _Change(NamedTuple):
    """Changes of thickness along the arc (nt + 1,) [m/m], of temperature [K/m] and pressure [Pa/m], by (a, b)."""

    thicker: FloatArray
    warmer: ComplexArray
    pressure: ComplexArray


@compiled
def heat_impedance(grid: FilmGrid, work: FilmWork, wedge: Wedge, running: Running, omega: float) -> ComplexArray:
    """What the temperature that follows adds to a film's impedance."""
    conductance = conductances(grid, work, wedge)
    shape, unknowns = work.pressure.shape, work.unknown.shape[0]
    width = shape[1] - 1 - grid.first
    out = np.zeros((2, 2), dtype=np.complex128)
    nothing = np.zeros(shape, dtype=np.complex128)
    sheared, pressed = np.empty(shape), np.empty(shape)
    dissipate(grid, work, running.speed, sheared, pressed)
    # what a kelvin at a node stores and makes less [W/K]
    stored = 1j * omega * running.heat[0] * grid.dx * grid.height * work.density * work.thickness
    loss = stored + running.oil[1] * (sheared - pressed) + work.exchange
    for axis in range(2):
        thicker, pressure = -grid.cos if axis == 0 else -grid.sin, nothing.copy()
        warmer, answer = nothing, np.zeros(unknowns, dtype=np.complex128)
        settled = False
        for _ in range(_MOST_TURNS):
            for k in range(unknowns):
                frozen = work.slopes[k, axis] + 1j * omega * work.slopes[k, 2 + axis]
                pressure[k // width + 1, k % width + grid.first] = frozen + answer[k]
            change = _Change(thicker, warmer, pressure)
            gained = _gain(grid, work, running, conductance, change, (sheared, pressed))
            fields = np.zeros((1, shape[0], shape[1]), dtype=np.complex128)
            march(grid, work, running, loss, fields, gained)
            asked = largest((fields[0] - warmer).ravel())
            size = largest(fields[0].ravel())
            warmer = fields[0]
            _pressure(grid, work, running, conductance, _Change(0.0 * thicker, warmer, nothing), omega, answer)
            if asked < _SETTLED * size:
                settled = True
                break
        out[:, axis] = force_of(grid, answer, shape)
        if not settled:
            out[:, axis] = np.nan
    return out


@inner
def _pressure(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    conductance: Faces,
    change: _Change,
    omega: float,
    answer: ComplexArray,
) -> None:
    """Change of pressure by a change of temperature, into `answer` (unknowns,)."""
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    along, across = _flows(grid, work, running, conductance, change)
    rhs: Any = answer.reshape((answer.shape[0], 1))
    net_inflow(along, across, grid.first, rhs)
    by_heat = 1j * omega * running.oil[2] * running.oil[3]
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            rhs[k, 0] += by_heat * change.warmer[i, j] * work.thickness[i, j] * grid.dx * grid.height[j]
    keep_ruptured(work, grid.first, rhs)
    substitute(work.band, answer)


@inner
def _flows(
    grid: FilmGrid, work: FilmWork, running: Running, conductance: Faces, change: _Change
) -> tuple[ComplexArray, ComplexArray]:
    """Change of the mass flows through the faces along, (nt, nz + 1, 1), and across, (nt + 1, nz, 1) [kg/s/m]."""
    gx, gz = conductance
    oil, pressure = running.oil, change.pressure
    denser = -oil[2] * oil[3] * change.warmer
    lighter = work.density / work.viscosity * (denser / work.density + oil[1] * change.warmer)
    along, across = flow_changes(grid, work, running.speed, change.thicker, lighter, denser)
    for i in range(gx.shape[0]):
        for j in range(gx.shape[1]):
            along[i, j, 0] -= gx[i, j] * (pressure[i + 1, j] - pressure[i, j])
    for i in range(gz.shape[0]):
        for j in range(gz.shape[1]):
            across[i, j, 0] -= gz[i, j] * (pressure[i, j + 1] - pressure[i, j])
    return along, across


@inner
def _gain(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    conductance: Faces,
    change: _Change,
    dissipated: tuple[FloatArray, FloatArray],
) -> ComplexArray:
    """Change of the heat that the oil gains between stations at its old temperature, (1, nt, nz + 1) [W/m]."""
    t, flow_z, heat, thicker = work.temperature, work.flow_z, running.heat, change.thicker
    nt, nz = work.flow_x.shape[0], flow_z.shape[1]
    gained = np.empty((1, nt, nz + 1), dtype=np.complex128)
    made = _made(grid, work, dissipated, change)
    along, across = _flows(grid, work, running, conductance, change)
    for i in range(nt):
        for j in range(nz + 1):
            value = 0.5 * (made[i, j] + made[i + 1, j]) - heat[0] * along[i, j, 0] * (t[i + 1, j] - t[i, j])
            for side in range(-1, 2, 2):
                line = j + side
                if not 0 <= line <= nz:
                    continue
                face = min(j, line)
                edge = j == (nz if side < 0 else 0) and (side < 0 or grid.first == 1)
                out = side * 0.5 * (flow_z[i, face] + flow_z[i + 1, face])
                changed = side * 0.125 * heat[0] * (across[i, face, 0] + across[i + 1, face, 0])
                if not edge:
                    changed -= 0.25 * heat[1] * grid.dx / grid.dz[face] * (thicker[i] + thicker[i + 1])
                elif not out < 0.0:
                    changed *= 0.0
                value -= changed * (t[i + 1, line] - t[i + 1, j] + t[i, line] - t[i, j])
            gained[0, i, j] = value
    return gained


@inner
def _made(grid: FilmGrid, work: FilmWork, heat: tuple[FloatArray, FloatArray], change: _Change) -> ComplexArray:
    """Change of the heat made at every station, at the old temperature, (nt + 1, nz + 1) [W/m]."""
    p, h, mu = work.pressure, work.thickness, work.viscosity
    sheared, pressed = heat
    made = np.empty(p.shape, dtype=np.complex128)
    for i in range(p.shape[0]):
        for j in range(p.shape[1]):
            along, across = slope_products(grid, p, change.pressure, i, j)
            turned = h[i, j] ** 3 / (6.0 * mu[i, j]) * (along + across) * grid.dx * grid.height[j]
            made[i, j] = turned + change.thicker[i] / h[i, j] * (3.0 * pressed[i, j] - sheared[i, j])
    return made
