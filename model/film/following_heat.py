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
from model.film.energy import march
from model.film.matrix import substitute
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import Running
from model.film.reynolds import conductances
from model.film.slopes import keep_ruptured, net_inflow
from rigdata.arrays import ComplexArray, FloatArray

#: Turns of pressure and heat, and the change of temperature at which they end, as a share of the temperature.
_MOST_TURNS, _SETTLED = 60, 1e-7


class _Change(NamedTuple):
    """Changes of thickness along the arc (nt + 1,) [m/m], of temperature [K/m] and pressure [Pa/m], by (a, b)."""

    thicker: FloatArray
    warmer: ComplexArray
    pressure: ComplexArray


@compiled
def heat_impedance(
    grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], running: Running, omega: float
) -> ComplexArray:
    """What the temperature that follows adds to a film's impedance."""
    conductance = conductances(grid, work, wedge[0], wedge[1], wedge[2])
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    out = np.zeros((2, 2), dtype=np.complex128)
    loss = _local_loss(grid, work, running, omega)
    for axis in range(2):
        change = _Change(
            -grid.cos if axis == 0 else -grid.sin,
            np.zeros((nt + 1, nz + 1), dtype=np.complex128),
            np.zeros((nt + 1, nz + 1), dtype=np.complex128),
        )
        settled = False
        answer = np.zeros(work.unknown.shape[0], dtype=np.complex128)
        for _ in range(_MOST_TURNS):
            for i in range(1, nt):
                for j in range(grid.first, nz):
                    k = (i - 1) * (nz - grid.first) + j - grid.first
                    frozen = work.slopes[k, axis] + 1j * omega * work.slopes[k, 2 + axis]
                    change.pressure[i, j] = frozen + answer[k]
            new = _temperature(grid, work, running, conductance, change, loss)
            asked, size = _step_and_size(new, change.warmer)
            change.warmer[:] = new
            _pressure(grid, work, running, omega, new, answer)
            if asked < _SETTLED * size:
                settled = True
                break
        for i in range(1, nt):
            total = 0.0 + 0.0j
            for j in range(grid.first, nz):
                total += grid.area[i, j] * answer[(i - 1) * (nz - grid.first) + j - grid.first]
            out[0, axis] += grid.cos[i] * total
            out[1, axis] += grid.sin[i] * total
        if not settled:
            out[:, axis] = np.nan
    return out


@inner
def _step_and_size(new: ComplexArray, old: ComplexArray) -> tuple[float, float]:
    """Largest difference, and largest value."""
    change, size = 0.0, 1e-300
    for i in range(new.shape[0]):
        for j in range(new.shape[1]):
            change = max(change, abs(new[i, j] - old[i, j]))
            size = max(size, abs(new[i, j]))
    return change, size


@inner
def _lighter(work: FilmWork, oil: tuple[float, float, float, float], i: int, j: int) -> tuple[float, float]:
    """Relative change of the density, and of density over viscosity, per kelvin."""
    density = -oil[2] * oil[3] / work.density[i, j]
    return density, density + oil[1]


@inner
def _pressure(
    grid: FilmGrid, work: FilmWork, running: Running, omega: float, warmer: ComplexArray, answer: ComplexArray
) -> None:
    """Change of pressure by a change of temperature, into `answer` (unknowns,)."""
    h = work.thickness
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    along = np.empty((nt, nz + 1, 1), dtype=np.complex128)
    across = np.empty((nt + 1, nz, 1), dtype=np.complex128)
    for i in range(nt):
        for j in range(nz + 1):
            couette, denser, ratio = _face(grid, work, running, warmer, i, j)
            along[i, j, 0] = couette * denser - (couette - work.flow_x[i, j]) * ratio
    for i in range(nt + 1):
        for j in range(nz):
            across[i, j, 0] = work.flow_z[i, j] * _side(work, running.oil, warmer, i, j)
    values: Any = answer  # the loops of the real ones are compiled for complex numbers too
    rhs = values.reshape((answer.shape[0], 1))
    net_inflow(along, across, grid.first, rhs)
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            stored = work.density[i, j] * _lighter(work, running.oil, i, j)[0] * warmer[i, j] * h[i, j]
            rhs[k, 0] -= 1j * omega * stored * grid.dx * grid.height[j]
    keep_ruptured(work, grid.first, rhs)
    substitute(work.band, values)


@inner
def _face(
    grid: FilmGrid, work: FilmWork, running: Running, warmer: ComplexArray, i: int, j: int
) -> tuple[float, complex, complex]:
    """Couette flow of a face along [kg/s], relative change of its density and of its density over viscosity."""
    density, density_next = work.density[i, j], work.density[i + 1, j]
    light, light_next = density / work.viscosity[i, j], density_next / work.viscosity[i + 1, j]
    couette = (
        0.125
        * running.speed
        * (work.thickness[i, j] + work.thickness[i + 1, j])
        * (density + density_next)
        * grid.height[j]
    )
    change, change_next = _lighter(work, running.oil, i, j), _lighter(work, running.oil, i + 1, j)
    denser = (density * change[0] * warmer[i, j] + density_next * change_next[0] * warmer[i + 1, j]) / (
        density + density_next
    )
    ratio = (light * change[1] * warmer[i, j] + light_next * change_next[1] * warmer[i + 1, j]) / (light + light_next)
    return couette, denser, ratio


@inner
def _side(work: FilmWork, oil: tuple[float, float, float, float], warmer: ComplexArray, i: int, j: int) -> complex:
    """Relative change of density over viscosity at a face across."""
    light = work.density[i, j] / work.viscosity[i, j]
    light_next = work.density[i, j + 1] / work.viscosity[i, j + 1]
    change, change_next = _lighter(work, oil, i, j)[1], _lighter(work, oil, i, j + 1)[1]
    return complex((light * change * warmer[i, j] + light_next * change_next * warmer[i, j + 1]) / (light + light_next))


@inner
def _local_loss(grid: FilmGrid, work: FilmWork, running: Running, omega: float) -> ComplexArray:
    """What a kelvin at a node stores and makes less, per station [W/K]."""
    p, h, mu = work.pressure, work.thickness, work.viscosity
    speed, oil, heat = running
    out = np.empty(p.shape, dtype=np.complex128)
    for i in range(p.shape[0]):
        for j in range(p.shape[1]):
            station = grid.dx * grid.height[j]
            steep = _steepness(grid, p, p, i, j)
            shear, pressed = mu[i, j] * speed**2 / h[i, j], h[i, j] ** 3 / (12.0 * mu[i, j]) * steep
            stored = 1j * omega * work.density[i, j] * heat[0] * h[i, j]
            out[i, j] = (stored + oil[1] * (shear - pressed)) * station + work.exchange[i, j]
    return out


@inner
def _steepness(grid, p, q, i, j):  # type: ignore[no-untyped-def]
    """Product of the gradients of p and q at a node, as `model.film.energy.dissipation` takes them."""
    nt, nz = p.shape[0] - 1, p.shape[1] - 1
    total, sides = 0.0 * q[i, j], 0
    if i > 0:
        total += (p[i, j] - p[i - 1, j]) * (q[i, j] - q[i - 1, j])
        sides += 1
    if i < nt:
        total += (p[i + 1, j] - p[i, j]) * (q[i + 1, j] - q[i, j])
        sides += 1
    total /= sides * grid.dx * grid.dx
    if j == nz:
        total += (p[i, nz] - p[i, nz - 1]) * (q[i, nz] - q[i, nz - 1]) / grid.dz[nz - 1] ** 2
    elif j > 0:
        wide = grid.dz[j] + grid.dz[j - 1]
        total += (p[i, j + 1] - p[i, j - 1]) * (q[i, j + 1] - q[i, j - 1]) / wide**2
    elif grid.first == 1:
        total += (p[i, 1] - p[i, 0]) * (q[i, 1] - q[i, 0]) / grid.dz[0] ** 2
    return total


@inner
def _temperature(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    conductance: tuple[FloatArray, FloatArray],
    change: _Change,
    loss: ComplexArray,
) -> ComplexArray:
    """March the change of temperature for changes of thickness and pressure, (nt + 1, nz + 1) [K/m]."""
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    fields = np.zeros((1, nt + 1, nz + 1), dtype=np.complex128)
    gained = np.empty((1, nt, nz + 1), dtype=np.complex128)
    _gain(grid, work, running, conductance, change, gained[0])
    march(grid, work, running, loss, fields, gained)
    return fields[0]


@inner
def _gain(
    grid: FilmGrid,
    work: FilmWork,
    running: Running,
    conductance: tuple[FloatArray, FloatArray],
    change: _Change,
    gained: ComplexArray,
) -> None:
    """Change of the heat that the oil gains between stations at its old temperature, (nt, nz + 1) [W/m]."""
    gx, gz = conductance
    thicker, warmer, pressure = change
    t, h, flow_x, flow_z = work.temperature, work.thickness, work.flow_x, work.flow_z
    heat, nz = running.heat, flow_z.shape[1]
    dissipated = np.empty((2, nz + 1), dtype=np.complex128)
    sides = np.empty((2, nz), dtype=np.complex128)
    _dissipation(grid, work, running.speed, change, 0, dissipated[1])
    _sides(work, running.oil, gz, change, 0, sides[1])
    for i in range(flow_x.shape[0]):
        dissipated[0], sides[0] = dissipated[1], sides[1]
        _dissipation(grid, work, running.speed, change, i + 1, dissipated[1])
        _sides(work, running.oil, gz, change, i + 1, sides[1])
        thick = 0.5 * (thicker[i] + thicker[i + 1])
        for j in range(nz + 1):
            couette, denser, ratio = _face(grid, work, running, warmer, i, j)
            share = thick / (0.5 * (h[i, j] + h[i + 1, j]))
            driven = couette - flow_x[i, j]
            flow = couette * (share + denser) - driven * (3.0 * share + ratio)
            flow -= gx[i, j] * (pressure[i + 1, j] - pressure[i, j])
            value = 0.5 * (dissipated[0, j] + dissipated[1, j]) - heat[0] * flow * (t[i + 1, j] - t[i, j])
            for side in range(-1, 2, 2):
                line = j + side
                if not 0 <= line <= nz:
                    continue
                face, edge = min(j, line), j == (nz if side < 0 else 0) and (side < 0 or grid.first == 1)
                out = side * 0.5 * (flow_z[i, face] + flow_z[i + 1, face])
                changed = side * 0.25 * heat[0] * (sides[0, face] + sides[1, face]) * 0.5
                if not edge:
                    changed -= 0.5 * heat[1] * grid.dx / grid.dz[face] * thick
                elif not out < 0.0:
                    changed *= 0.0
                value -= changed * (t[i + 1, line] - t[i + 1, j] + t[i, line] - t[i, j])
            gained[i, j] = value


@inner
def _dissipation(
    grid: FilmGrid, work: FilmWork, speed: float, change: _Change, i: int, dissipated: ComplexArray
) -> None:
    """Change of the heat made at a station, at the old temperature [W/m]."""
    thicker, _, pressure = change
    for j in range(dissipated.shape[0]):
        h, mu = work.thickness[i, j], work.viscosity[i, j]
        share, wide = thicker[i] / h, h**3 / (12.0 * mu)
        steep, turned = (
            _steepness(grid, work.pressure, work.pressure, i, j),
            _steepness(grid, work.pressure, pressure, i, j),
        )
        density = -mu * speed**2 / h * share + wide * (3.0 * share * steep + 2.0 * turned)
        dissipated[j] = density * grid.dx * grid.height[j]


@inner
def _sides(
    work: FilmWork,
    oil: tuple[float, float, float, float],
    gz: FloatArray,
    change: _Change,
    i: int,
    sides: ComplexArray,
) -> None:
    """Change of the flows across at a station [kg/s/m]."""
    thicker, warmer, pressure = change
    for j in range(sides.shape[0]):
        share = 2.0 * thicker[i] / (work.thickness[i, j] + work.thickness[i, j + 1])
        changed = work.flow_z[i, j] * (3.0 * share + _side(work, oil, warmer, i, j))
        sides[j] = changed - gz[i, j] * (pressure[i, j + 1] - pressure[i, j])
