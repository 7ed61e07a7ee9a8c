"""A film's impedance with a temperature and viscosity that follow the motion.

The perturbation of the baseline freezes the viscosity. Here the energy equation is perturbed too, at the excitation
frequency omega: with h = h0 + h' exp(i omega t), the same for p and T, and mu' = -kappa mu T', rho' = -alpha rho_40 T',

    rho c h (i omega T') + c (m . grad T)' = k (h dT/dz)'_z + made',    div m' + i omega (rho h)' = 0,

m the mass flows, made the dissipation. p' and T' follow from each other; they are found in turn, which contracts as
the heat does in an equilibrium. The oil enters at its own temperature, and journal and pads keep theirs: they are too
heavy to follow. At omega = 0 this is the slope of the static locus; far above one turn of oil it is the frozen film.
"""

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import dissipated, march, side_exchange, slope_products
from model.film.faces import conductances, net_inflow
from model.film.matrix import substitute
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.oil_state import Running
from model.film.slopes import flow_changes, force_of, keep_ruptured
from model.interpolation import largest
from rigdata.arrays import ComplexArray, FloatArray

#: Turns of pressure and heat at most.
_MOST_TURNS = 60


class _Film(NamedTuple):
    """A film at rest, and what its heat and flows change by."""

    grid: FilmGrid
    work: FilmWork
    running: Running
    conductance: FloatArray
    closer: FloatArray  #: (nt + 1, nz + 1): How the heat that a station makes changes with its thickness [W/m].


@compiled
def heat_impedance(
    grid: FilmGrid, work: FilmWork, wedge: Wedge, running: Running, omega: float, settled: float
) -> ComplexArray:
    """What the temperature that follows adds to a film's impedance; it ends when it changes by a share `settled`."""
    shape, heat = work.pressure.shape, dissipated(grid, work, running.speed)
    sheared, pressed = heat[0], heat[1] + heat[2]
    closer = (3.0 * pressed - sheared) / work.thickness
    film = _Film(grid, work, running, conductances(grid, work, wedge), closer)
    out, nothing = np.full((2, 2), np.nan + 0j), np.zeros(shape, dtype=np.complex128)
    # what a kelvin at a node stores and makes less [W/K]
    stored = 1j * omega * running.heat[0] * grid.dx * grid.height * work.density * work.thickness
    loss = stored + running.oil[1] * (sheared - pressed) + work.exchange
    for axis in range(2):
        thicker = np.zeros(shape) - (grid.cos if axis == 0 else grid.sin).reshape((-1, 1))
        frozen = work.slopes[:, axis] + 1j * omega * work.slopes[:, 2 + axis]
        warmer, pressure, answer = nothing, nothing.copy(), np.zeros(len(frozen), dtype=np.complex128)
        for _ in range(_MOST_TURNS):
            pressure.reshape(-1)[grid.node] = frozen + answer
            fields = np.zeros((1, *shape), dtype=np.complex128)
            march(grid, work, running, loss, fields, _gain(film, thicker, warmer, pressure))
            increment, size = largest((fields[0] - warmer).ravel()), largest(fields[0].ravel())
            warmer = fields[0]
            _pressure(film, warmer, omega, answer)
            if increment < settled * size:
                out[:, axis] = force_of(grid, grid.area, answer.reshape((-1, 1)))[:, 0]
                break
    return out


@inner
def _pressure(film: _Film, warmer: ComplexArray, omega: float, answer: ComplexArray) -> None:
    """Change of pressure by a change of temperature, into `answer` (unknowns,)."""
    grid, work, oil = film.grid, film.work, film.running.oil
    net_inflow(grid, _flows(film, None, warmer, 0.0 * warmer), answer)
    stored = 1j * omega * oil[2] * oil[3] * grid.dx * grid.height * warmer * work.thickness
    answer += stored.reshape(-1)[grid.node]
    keep_ruptured(grid, work, answer)
    substitute(work.band, answer)


@inner
def _flows(film: _Film, thicker: FloatArray | None, warmer: ComplexArray, pressure: ComplexArray) -> ComplexArray:
    """Change of the mass flows through the faces, (2, nodes) [kg/s/m]."""
    grid, work, oil, p = film.grid, film.work, film.running.oil, pressure.reshape(-1)
    denser = -oil[2] * oil[3] * warmer
    lighter = work.density / work.viscosity * (denser / work.density + oil[1] * warmer)
    flows = flow_changes(grid, work, film.running.speed, thicker, lighter, denser)
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(p) - step):
            flows[side, n] -= film.conductance[side, n] * (p[n + step] - p[n])
    return flows


@inner
def _gain(film: _Film, thicker: FloatArray, warmer: ComplexArray, pressure: ComplexArray) -> ComplexArray:
    """Change of the heat that the oil gains between stations at its old temperature, (1, nt, nz + 1) [W/m]."""
    grid, work, t, heat = film.grid, film.work, film.work.temperature, film.running.heat
    nt, lines = t.shape[0] - 1, t.shape[1]
    gained = np.empty((1, nt, lines), dtype=np.complex128)
    sides = np.zeros((2, lines), dtype=np.complex128)
    dissipation = _dissipation_change(film, thicker, pressure)
    flows = _flows(film, thicker, warmer, pressure)
    for i in range(nt):
        side_exchange(grid, film.running, i, (flows, thicker), work.flow, sides)
        total = t[i] + t[i + 1]
        for j in range(lines):
            value = 0.5 * (dissipation[i, j] + dissipation[i + 1, j])
            value -= heat[0] * flows[0, i * lines + j] * (t[i + 1, j] - t[i, j])
            if j > 0:
                value -= sides[0, j] * (total[j - 1] - total[j])
            if j < lines - 1:
                value -= sides[1, j] * (total[j + 1] - total[j])
            gained[0, i, j] = value
    return gained


@inner
def _dissipation_change(film: _Film, thicker: FloatArray, pressure: ComplexArray) -> ComplexArray:
    """Change of the heat made at every station, at the old temperature, (nt + 1, nz + 1) [W/m]."""
    grid, p, h, mu = film.grid, film.work.pressure, film.work.thickness, film.work.viscosity
    change = np.empty(p.shape, dtype=np.complex128)
    for i in range(p.shape[0]):
        for j in range(p.shape[1]):
            along, across = slope_products(grid, p, pressure, i, j)
            turned = h[i, j] ** 3 / (6.0 * mu[i, j]) * (along + across) * grid.dx * grid.height[j]
            change[i, j] = turned + thicker[i, j] * film.closer[i, j]
    return change
