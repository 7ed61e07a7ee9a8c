"""Perturbed film pressure: derivatives by approach, wedge and their rates, by the film's shape and temperature.

All of them have one form. A perturbation changes what flows through every face at the present pressure; what then
flows into each control volume too much is the right-hand side, and one factorisation serves all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from model.compilation import compiled, inner
from model.film.matrix import substitute, substitute_four, substitute_many
from model.film.mesh import Faces, FilmGrid, FilmWork, OilConstants, Wedge
from model.film.oil_state import face_height
from rigdata.arrays import FloatArray


@inner
def net_inflow(along: Any, across: Any, first: int, inflow: Any) -> None:
    """What flows into every control volume less what flows out: `along` (nt, nz + 1, m), `across` (nt + 1, nz, m)."""
    nt, nz = along.shape[0], across.shape[1]
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * (nz - first) + j - first
            for m in range(along.shape[2]):
                value = along[i - 1, j, m] - along[i, j, m] - across[i, j, m]
                if j > 0:
                    value += across[i, j - 1, m]
                inflow[k, m] = value


@inner
def keep_ruptured(work: FilmWork, first: int, inflow: FloatArray) -> None:
    """Ruptured nodes keep their pressure: their rows have no right-hand side; `inflow` (unknowns, m)."""
    nt, nz = work.pressure.shape[0] - 1, work.pressure.shape[1] - 1
    for i in range(1, nt):
        for j in range(first, nz):
            if work.ruptured[i, j]:
                k = (i - 1) * (nz - first) + j - first
                for m in range(inflow.shape[1]):
                    inflow[k, m] = 0.0


@inner
def poiseuille_inflow(p: FloatArray, conductance: Faces, i: int, j: int) -> float:
    """What the pressure of its neighbours drives into the control volume of a node without pressure."""
    gx, gz = conductance
    inflow = gx[i - 1, j] * p[i - 1, j] + gx[i, j] * p[i + 1, j] + gz[i, j] * p[i, j + 1]
    if j > 0:
        inflow += gz[i, j - 1] * p[i, j - 1]
    return inflow


@inner
def rupture_line(grid: FilmGrid, work: FilmWork, conductance: Faces, source: FloatArray) -> FloatArray:
    """Where between two nodes the film ruptures, as changes of the wet nodes' diagonal in the matrix and of their area.

    A dry node is reached by the share `wet` of the flow that would wet it; the pressure rises as the square of
    the distance from the rupture line, so that the line lies (0.5 + wet) steps from the last wet node. A linear
    profile that vanishes there has (wet - 0.5) / (wet + 0.5) of the wet node's value at the dry node.

    `source` (nt + 1, nz + 1) [kg/s]; gives area (nt + 1, nz + 1) [m^2].
    """
    gx = conductance[0]
    ruptured = work.ruptured
    area = grid.area.copy()
    nt, nz = gx.shape[0], gx.shape[1] - 1
    for i in range(1, nt):
        for j in range(grid.first, nz):
            if not ruptured[i, j] or source[i, j] >= 0.0:
                continue
            wet = min(1.0, poiseuille_inflow(work.pressure, conductance, i, j) / -source[i, j])
            ghost = (wet - 0.5) / (wet + 0.5)
            for side in range(-1, 2, 2):
                m = i + side
                if 0 < m < nt and not ruptured[m, j]:
                    leak = (gx[i - 1, j] if side < 0 else gx[i, j]) * ghost
                    work.band[(m - 1) * (nz - grid.first) + j - grid.first, 0] -= leak
                    area[m, j] *= 1.0 + 0.5 * (wet - 0.5)
    return area


@inner
def face_slopes(
    grid: FilmGrid, work: FilmWork, wedge: Wedge, conductance: Faces, powers: Faces | None
) -> tuple[FloatArray, FloatArray]:
    """Change of the flows through the faces by a and b at the present pressure, (nt, nz + 1, 2), (nt + 1, nz, 2).

    From what the journal drags along, in `work.flow_x`, it also makes the mass flows. Conductances grow with these
    powers of the film thickness along and across; without them, laminar, with the third.
    """
    p, h = work.pressure, work.thickness
    gx, gz = conductance
    nt, nz = gx.shape[0], gz.shape[1]
    along, across = np.empty((nt, nz + 1, 2)), np.empty((nt + 1, nz, 2))
    for i in range(nt):
        for j in range(nz + 1):
            poiseuille = gx[i, j] * (p[i + 1, j] - p[i, j])
            # couette flow is as h; dh/da = -cos, dh/db = -sin
            slope = work.flow_x[i, j] - _power(powers, 0, i, j) * poiseuille
            slope /= face_height(grid, work, wedge, i, j)
            work.flow_x[i, j] -= poiseuille
            along[i, j, 0] = -slope * grid.cos_face[i]
            along[i, j, 1] = -slope * grid.sin_face[i]
    for i in range(nt + 1):
        for j in range(nz):
            poiseuille = gz[i, j] * (p[i, j + 1] - p[i, j])
            work.flow_z[i, j] = -poiseuille
            slope = -_power(powers, 1, i, j) * poiseuille / (0.5 * (h[i, j] + h[i, j + 1]))
            across[i, j, 0] = -slope * grid.cos[i]
            across[i, j, 1] = -slope * grid.sin[i]
    return along, across


@inner
def derivatives(grid: FilmGrid, work: FilmWork, wedge: Wedge, conductance: Faces, powers: Faces | None) -> None:
    """Derivatives of the pressure by a, b, da/dt, db/dt, into `work.slopes`; and the mass flows, see `face_slopes`."""
    rhs, nt, nz = work.slopes, work.flow_x.shape[0], work.flow_z.shape[1]
    along, across = face_slopes(grid, work, wedge, conductance, powers)
    net_inflow(along, across, grid.first, rhs)
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            squeeze = work.density[i, j] * grid.dx * grid.height[j]
            rhs[k, 2] = squeeze * grid.cos[i]
            rhs[k, 3] = squeeze * grid.sin[i]
    keep_ruptured(work, grid.first, rhs)
    substitute_four(work.band, rhs)


@inner
def _power(powers: Faces | None, side: int, i: int, j: int) -> float:
    if powers is None:
        return 3.0
    return powers[side][i, j]


@compiled
def shape_slopes(grid: FilmGrid, work: FilmWork, conductance: Faces, shapes: Any) -> Any:
    """Derivatives of the pressure by the amplitudes of shapes that are added to the film thickness.

    `shapes` (nt + 1, nz + 1, m) [m], real or complex; gives (unknowns, m) [Pa per unit].
    """
    p, h = work.pressure, work.thickness
    gx, gz = conductance
    nt, nz, count = gx.shape[0], gz.shape[1], shapes.shape[2]
    along = np.empty((nt, nz + 1, count), dtype=shapes.dtype)
    across = np.empty((nt + 1, nz, count), dtype=shapes.dtype)
    for i in range(nt):
        for j in range(nz + 1):
            poiseuille = gx[i, j] * (p[i + 1, j] - p[i, j])
            couette = work.flow_x[i, j] + poiseuille
            slope = (couette - 3.0 * poiseuille) / (h[i, j] + h[i + 1, j])
            for m in range(count):
                along[i, j, m] = slope * (shapes[i, j, m] + shapes[i + 1, j, m])
    for i in range(nt + 1):
        for j in range(nz):
            slope = -3.0 * gz[i, j] * (p[i, j + 1] - p[i, j]) / (h[i, j] + h[i, j + 1])
            for m in range(count):
                across[i, j, m] = slope * (shapes[i, j, m] + shapes[i, j + 1, m])
    rhs = np.empty((work.unknown.shape[0], count), dtype=shapes.dtype)
    net_inflow(along, across, grid.first, rhs)
    keep_ruptured(work, grid.first, rhs)
    substitute_many(work.band, rhs)
    return rhs


@compiled
def squeeze_slopes(grid: FilmGrid, work: FilmWork, shapes: Any) -> Any:
    """Derivatives of the pressure by the rates of shapes that are added to the film thickness; as `shape_slopes`.

    Gives (unknowns, m) [Pa s per unit].
    """
    nt, nz, count = work.flow_x.shape[0], work.flow_z.shape[1], shapes.shape[2]
    rhs = np.empty((work.unknown.shape[0], count), dtype=shapes.dtype)
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            squeeze = work.density[i, j] * grid.dx * grid.height[j]
            for m in range(count):
                rhs[k, m] = -squeeze * shapes[i, j, m]
    keep_ruptured(work, grid.first, rhs)
    substitute_many(work.band, rhs)
    return rhs


@inner
def pressure_change(grid: FilmGrid, work: FilmWork, speed: float, oil: OilConstants, change: FloatArray) -> FloatArray:
    """Change of the pressure that the film's new temperature will make, to first order.

    `change` (unknowns,) [Pa]; gives (2,) [N].
    """
    rows, columns = work.temperature.shape
    lighter = np.empty((rows, columns))
    denser = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            t, density = work.temperature[i, j], work.density[i, j]
            denser[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - t)) - density
            lighter[i, j] = (density + denser[i, j]) / (oil[0] * np.exp(oil[1] * (40.0 - t)))
            lighter[i, j] -= density / work.viscosity[i, j]
    return change_by_oil(grid, work, speed, (lighter, denser), change)


@inner
def change_by_oil(
    grid: FilmGrid, work: FilmWork, speed: float, oil: tuple[FloatArray, FloatArray], change: FloatArray
) -> FloatArray:
    """`pressure_change` for given changes of the oil, see `flow_changes`; gives (2,) [N]."""
    along, across = flow_changes(grid, work, speed, None, oil[0], oil[1])
    rhs = change.reshape((change.shape[0], 1))
    net_inflow(along, across, grid.first, rhs)
    keep_ruptured(work, grid.first, rhs)
    substitute(work.band, change)
    return force_of(grid, change, work.thickness.shape)


@inner
def flow_changes(
    grid: FilmGrid, work: FilmWork, speed: float, thicker: FloatArray | None, lighter: Any, denser: Any
) -> tuple[Any, Any]:
    """Change of the flows through the faces at the present pressure, (nt, nz + 1, 1) and (nt + 1, nz, 1) [kg/s].

    By changes of the thickness along the arc (nt + 1,), of density over viscosity, and of what the journal drags
    along, density times drag, (nt + 1, nz + 1); real or complex.
    """
    h, light = work.thickness, work.density / work.viscosity
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    along = np.empty((nt, nz + 1, 1), dtype=lighter.dtype)
    across = np.empty((nt + 1, nz, 1), dtype=lighter.dtype)
    for i in range(nt):
        for j in range(nz + 1):
            thick = h[i, j] + h[i + 1, j]
            half = 0.125 * speed * thick * grid.height[j]
            couette = half * (work.density[i, j] * work.drag[i, j] + work.density[i + 1, j] * work.drag[i + 1, j])
            ratio = (lighter[i, j] + lighter[i + 1, j]) / (light[i, j] + light[i + 1, j])
            flow = half * (denser[i, j] + denser[i + 1, j])
            if thicker is not None:
                share = (thicker[i] + thicker[i + 1]) / thick
                ratio += 3.0 * share
                flow += couette * share
            along[i, j, 0] = flow - (couette - work.flow_x[i, j]) * ratio
    for i in range(nt + 1):
        for j in range(nz):
            ratio = (lighter[i, j] + lighter[i, j + 1]) / (light[i, j] + light[i, j + 1])
            if thicker is not None:
                ratio += 6.0 * thicker[i] / (h[i, j] + h[i, j + 1])
            across[i, j, 0] = work.flow_z[i, j] * ratio
    return along, across


@inner
def force_of(grid: FilmGrid, pressure: Any, shape: tuple[int, int]) -> Any:
    """Radial and tangential force of the pressure at the unknown nodes of a mesh; real or complex."""
    nt, nz = shape[0] - 1, shape[1] - 1
    force = np.zeros(2, dtype=pressure.dtype)
    for i in range(1, nt):
        total = 0.0 * pressure[0]
        for j in range(grid.first, nz):
            total += grid.area[i, j] * pressure[(i - 1) * (nz - grid.first) + j - grid.first]
        force[0] += grid.cos[i] * total
        force[1] += grid.sin[i] * total
    return force
