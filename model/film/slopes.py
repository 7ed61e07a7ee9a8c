"""Perturbed film pressure: derivatives by approach, wedge and their rates, by the film's shape and temperature.

All of them have one form. A perturbation changes what flows through every face at the present pressure; what then
flows into each control volume too much is the right-hand side, and one factorisation serves all of them.
"""

from typing import Any

import numpy as np

from model.compilation import compiled, inner
from model.film.faces import Faces, net_inflow, oil_flows, poiseuille_inflow
from model.film.matrix import substitute, substitute_four, substitute_many
from model.film.mesh import FilmGrid, FilmWork, OilConstants
from rigdata.arrays import FloatArray


@inner
def keep_ruptured(grid: FilmGrid, work: FilmWork, inflow: Any) -> None:
    """Ruptured nodes keep their pressure: their rows have no right-hand side; `inflow` (unknowns, ..)."""
    ruptured = work.ruptured.reshape(-1)
    for k in range(len(inflow)):
        if ruptured[grid.node[k]]:
            inflow[k] = 0.0


@inner
def rupture_line(grid: FilmGrid, work: FilmWork, faces: Faces, source: FloatArray) -> FloatArray:
    """Where between two nodes the film ruptures, as changes of the wet nodes' diagonal in the matrix and of their area.

    A dry node is reached by the share `wet` of the flow that would wet it; the pressure rises as the square of
    the distance from the rupture line, so that the line lies (0.5 + wet) steps from the last wet node. A linear
    profile that vanishes there has (wet - 0.5) / (wet + 0.5) of the wet node's value at the dry node.

    `source` (unknowns,) [kg/s]; gives area (nt + 1, nz + 1) [m^2].
    """
    area, ruptured, width = grid.area.copy(), work.ruptured.reshape(-1), work.band.shape[1] - 1
    p, sizes, line = work.pressure.reshape(-1), area.reshape(-1), grid.steps[0]
    for k in range(len(source)):
        n = grid.node[k]
        if not ruptured[n] or source[k] >= 0.0:
            continue
        wet = min(1.0, poiseuille_inflow(p, faces.conductance, line, n) / -source[k])
        ghost = (wet - 0.5) / (wet + 0.5)
        if k >= width and not ruptured[n - line]:
            work.band[k - width, 0] -= faces.conductance[0, n - line] * ghost
            sizes[n - line] *= 1.0 + 0.5 * (wet - 0.5)
        if k + width < len(source) and not ruptured[n + line]:
            work.band[k + width, 0] -= faces.conductance[0, n] * ghost
            sizes[n + line] *= 1.0 + 0.5 * (wet - 0.5)
    return area


@inner
def pass_on(grid: FilmGrid, work: FilmWork, faces: Faces) -> tuple[FloatArray, FloatArray]:
    """Mass flows through the faces; returns how they change with a and b, (2, nodes) [kg/s/m].

    The film's thickness changes by -cos(alpha) with a, by -sin(alpha) with b.
    """
    p, flow = work.pressure.reshape(-1), work.flow
    by_a, by_b = np.empty(flow.shape), np.empty(flow.shape)
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(p) - step):
            back = faces.conductance[side, n] * (p[n + step] - p[n])
            couette = faces.couette[side, n]
            flow[side, n] = couette - back
            slope = (couette - faces.power[side, n] * back) / faces.height[side, n]
            by_a[side, n], by_b[side, n] = -slope * grid.cos_face[side, n], -slope * grid.sin_face[side, n]
    return by_a, by_b


@inner
def derivatives(grid: FilmGrid, work: FilmWork, faces: Faces) -> None:
    """Derivatives of the pressure by a, b, da/dt, db/dt, into `work.slopes`; and the mass flows."""
    by_a, by_b = pass_on(grid, work, faces)
    rhs, density = work.slopes, work.density.reshape(-1)
    net_inflow(grid, by_a, rhs[:, 0])
    net_inflow(grid, by_b, rhs[:, 1])
    for k in range(len(rhs)):
        n = grid.node[k]
        squeeze = density[n] * grid.dx * grid.drags[0, n]
        rhs[k, 2] = squeeze * grid.cos_face[1, n]
        rhs[k, 3] = squeeze * grid.sin_face[1, n]
    keep_ruptured(grid, work, rhs)
    substitute_four(work.band, rhs, 0)


@compiled
def shape_slopes(grid: FilmGrid, work: FilmWork, conductance: FloatArray, shapes: Any) -> Any:
    """Derivatives of the pressure by the amplitudes of shapes that are added to the film thickness.

    `shapes` (nt + 1, nz + 1, m) [m], real or complex; gives (unknowns, m) [Pa per unit].
    """
    p, h, count = work.pressure.reshape(-1), work.thickness.reshape(-1), shapes.shape[2]
    shape, line = shapes.reshape((len(p), count)), grid.steps[0]
    slopes = np.empty((len(work.unknown), count), dtype=shapes.dtype)
    thicker = np.empty(work.flow.shape)  # what flows through a face per metre that both its nodes grow thicker
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(p) - step):
            driven = conductance[side, n] * (p[n + step] - p[n])
            thicker[side, n] = (work.flow[side, n] - 2.0 * driven) / (h[n] + h[n + step])
    along, across = thicker
    for k in range(len(slopes)):
        n = grid.node[k]
        for m in range(count):  # side by side in memory
            inflow = along[n - line] * (shape[n - line, m] + shape[n, m])
            inflow -= along[n] * (shape[n, m] + shape[n + line, m])
            inflow += across[n - 1] * (shape[n - 1, m] + shape[n, m])
            slopes[k, m] = inflow - across[n] * (shape[n, m] + shape[n + 1, m])
    keep_ruptured(grid, work, slopes)
    substitute_many(work.band, slopes)
    return slopes


@compiled
def squeeze_slopes(grid: FilmGrid, work: FilmWork, shapes: Any) -> Any:
    """Derivatives of the pressure by the rates of shapes that are added to the film thickness; as `shape_slopes`.

    Gives (unknowns, m) [Pa s per unit].
    """
    mass = (grid.dx * grid.height * work.density).reshape((-1, 1))
    slopes = (-mass * shapes.reshape((len(mass), -1)))[grid.node]
    keep_ruptured(grid, work, slopes)
    substitute_many(work.band, slopes)
    return slopes


@inner
def pressure_change(
    grid: FilmGrid, work: FilmWork, speed: float, oil: OilConstants, change: FloatArray
) -> tuple[float, float]:
    """Change of the pressure that the film's new temperature will make, to first order.

    `change` (unknowns,) [Pa]; gives its force [N].
    """
    colder = 40.0 - work.temperature
    density = oil[2] * (1.0 + oil[3] * colder)
    lighter = density / (oil[0] * np.exp(oil[1] * colder)) - work.density / work.viscosity
    return change_by_oil(grid, work, speed, (lighter, density - work.density), change)


@inner
def change_by_oil(
    grid: FilmGrid, work: FilmWork, speed: float, oil: tuple[FloatArray, FloatArray], change: FloatArray
) -> tuple[float, float]:
    """`pressure_change` for given changes of the oil, see `flow_changes`; gives its force [N]."""
    net_inflow(grid, flow_changes(grid, work, speed, None, oil[0], oil[1]), change)
    keep_ruptured(grid, work, change)
    substitute(work.band, change)
    force = force_of(grid, grid.area, change.reshape((-1, 1)))
    return force[0, 0], force[1, 0]


@inner
def flow_changes(
    grid: FilmGrid, work: FilmWork, speed: float, thicker: FloatArray | None, lighter: Any, denser: Any
) -> Any:
    """Change of the flows through the faces at the present pressure, (2, nodes) [kg/s].

    By changes of the thickness, of density over viscosity, and of what the journal drags along, density times drag,
    each (nt + 1, nz + 1); real or complex.
    """
    (light, dragged), h, flow = oil_flows(work), work.thickness.reshape(-1), work.flow
    more, heavier = lighter.reshape(-1), denser.reshape(-1)
    changes = np.empty(flow.shape, dtype=lighter.dtype)
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(h) - step):
            m, thick = n + step, h[n] + h[n + step]
            half = 0.125 * speed * thick * grid.drags[side, n]
            couette = half * (dragged[n] + dragged[m])
            ratio = (more[n] + more[m]) / (light[n] + light[m])
            change = half * (heavier[n] + heavier[m])
            if thicker is not None:
                share = (thicker.reshape(-1)[n] + thicker.reshape(-1)[m]) / thick
                ratio += 3.0 * share
                change += couette * share
            changes[side, n] = change - (couette - flow[side, n]) * ratio
    return changes


@inner
def force_of(grid: FilmGrid, weight: FloatArray, pressure: Any) -> Any:
    """Radial and tangential forces, (2, m), of pressures at the unknown nodes, which stand for these areas.

    `weight` (nt + 1, nz + 1) [m^2], `pressure` (unknowns, m), real or complex.
    """
    force, width = np.zeros((2, pressure.shape[1]), dtype=pressure.dtype), len(grid.dz) - grid.first
    for m in range(pressure.shape[1]):
        for i in range(1, len(grid.cos) - 1):
            total = 0.0 * pressure[0, 0]
            for j in range(width):
                total += weight[i, grid.first + j] * pressure[(i - 1) * width + j, m]
            force[0, m] += grid.cos[i] * total
            force[1, m] += grid.sin[i] * total
    return force
