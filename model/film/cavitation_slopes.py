"""Perturbed film with mass-conserving cavitation: derivatives by approach, wedge and their rates."""

from __future__ import annotations

import numpy as np

from model.arrays import FloatArray
from model.compilation import inner
from model.film.cavitation_matrix import FaceFlows, assemble_columns, factorise_columns, substitute_columns
from model.film.mesh import FilmGrid, FilmWork
from model.film.slopes import net_inflow


@inner
def jfo_slopes(
    grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, sharp: bool
) -> tuple[FloatArray, FloatArray]:
    """Solve for the derivatives by a, b, da/dt, db/dt; then the mass flows."""
    nz = work.pressure.shape[1] - 1
    width = nz - grid.first
    band = np.empty((x.shape[0], 2 * width + 1))
    assemble_columns(band, faces, work.ruptured, grid.first)
    weight = grid.area
    if sharp:
        weight = _rupture_line(grid, work, faces, x, band)
    factorise_columns(band)
    static = np.zeros((x.shape[0], 2))
    _displaced(grid, work, faces, x, static)
    substitute_columns(band, static)
    rate = np.zeros((x.shape[0], 2))
    _stored(grid, work, faces, x, static, rate)
    substitute_columns(band, rate)
    slopes = np.empty((x.shape[0], 4))
    for k in range(x.shape[0]):
        for m in range(2):
            slopes[k, m] = static[k, m]
            slopes[k, m + 2] = rate[k, m]
    _flows(work, faces)
    return weight, slopes


@inner
def _rupture_line(grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, band: FloatArray) -> FloatArray:
    """Where between two nodes the film ruptures: as in `model.film.reynolds`; here what flows is kept in balance."""
    nt, nz = faces.along.shape[0], faces.across.shape[1]
    width = nz - grid.first
    weight = grid.area.copy()
    for i in range(2, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * width + j - grid.first
            if work.ruptured[i - 1, j] and not work.ruptured[i, j]:
                weight[i, j] *= 0.5 + _behind_front(faces, work, x, k, width)
                continue
            excess = faces.couette[i, j] - faces.couette[i - 1, j]
            if not work.ruptured[i, j] or work.ruptured[i - 1, j] or excess <= 0.0:
                continue
            # what the gap widens by is filled by pressure to the share `wet`; a filling that the rest explains
            wet = min(1.0, max(0.0, 1.0 + faces.couette[i, j] * x[k, 0] / excess))
            leak = faces.along[i - 1, j] * (wet - 0.5) / (wet + 0.5)
            band[k - width, width] -= leak
            band[k, 0] += leak
            weight[i - 1, j] *= 1.0 + 0.5 * (wet - 0.5)
    return weight


@inner
def _behind_front(faces: FaceFlows, work: FilmWork, x: FloatArray, k: int, width: int) -> float:
    """How many steps behind the front where a film forms again its first wet node lies: the pressure jumps in slope."""
    i, j = k // width + 1, k % width + faces.across.shape[1] - width
    backward = faces.along[i - 1, j] * work.pressure[i, j]
    return backward / (backward - faces.couette[i - 1, j] * x[k - width, 0])


@inner
def _displaced(grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, rhs: FloatArray) -> None:
    """What more flows into a control volume when a or b grows and pressure and filling stay."""
    p, h = work.pressure, work.thickness
    nt, nz = faces.along.shape[0], faces.across.shape[1]
    width = nz - grid.first
    along, across = np.zeros((nt, nz + 1, 2)), np.empty((nt + 1, nz, 2))
    for i in range(nt):
        for j in range(grid.first, nz):
            if i == 0 and work.ruptured[0, j]:  # the supply follows the gap at the edge itself
                slope, cos, sin = faces.supply[j] / h[0, j], grid.cos[0], grid.sin[0]
            else:
                upstream = (i - 1) * width + j - grid.first
                filling = 1.0 + (x[upstream, 0] if i > 0 and work.ruptured[i, j] else 0.0)
                poiseuille = faces.along[i, j] * (p[i + 1, j] - p[i, j])
                slope = (faces.couette[i, j] * filling - 3.0 * poiseuille) / faces.height[i, j]
                cos, sin = grid.cos_face[i], grid.sin_face[i]
            along[i, j, 0], along[i, j, 1] = -slope * cos, -slope * sin  # dh/da = -cos, dh/db = -sin
    for i in range(nt + 1):
        for j in range(nz):
            slope = -3.0 * faces.across[i, j] * (p[i, j + 1] - p[i, j]) / (0.5 * (h[i, j] + h[i, j + 1]))
            across[i, j, 0], across[i, j, 1] = -slope * grid.cos[i], -slope * grid.sin[i]
    net_inflow(along, across, grid.first, rhs)


@inner
def _stored(
    grid: FilmGrid, work: FilmWork, faces: FaceFlows, x: FloatArray, static: FloatArray, rhs: FloatArray
) -> None:
    """Minus the mass rho h theta that a control volume takes up when a or b grows, slowly.

    The filling of a ruptured node is that of the face downstream, where it is carried on; so is its mass.
    """
    nt, nz = work.pressure.shape[0] - 1, work.pressure.shape[1] - 1
    for i in range(1, nt):
        for j in range(grid.first, nz):
            k = (i - 1) * (nz - grid.first) + j - grid.first
            size = grid.dx * grid.height[j]
            if work.ruptured[i, j]:
                mass = 0.5 * size * (work.density[i, j] + work.density[i + 1, j])
                filling, refill = 1.0 + x[k, 0], faces.height[i, j]
                rhs[k, 0] = mass * (filling * grid.cos_face[i] - refill * static[k, 0])
                rhs[k, 1] = mass * (filling * grid.sin_face[i] - refill * static[k, 1])
            else:
                rhs[k, 0] = size * work.density[i, j] * grid.cos[i]
                rhs[k, 1] = size * work.density[i, j] * grid.sin[i]
            if i == 1 and work.ruptured[0, j]:  # and the half volume at the edge
                filling = faces.supply[j] / faces.couette[0, j] * faces.height[0, j] / work.thickness[0, j]
                mass = 0.25 * size * filling * (work.density[0, j] + work.density[1, j])
                rhs[k, 0] += mass * grid.cos[0]
                rhs[k, 1] += mass * grid.sin[0]


@inner
def _flows(work: FilmWork, faces: FaceFlows) -> None:
    p = work.pressure
    for i in range(faces.along.shape[0]):
        for j in range(p.shape[1]):
            work.flow_x[i, j] = faces.couette[i, j] - faces.along[i, j] * (p[i + 1, j] - p[i, j])
    for i in range(p.shape[0]):
        for j in range(faces.across.shape[1]):
            work.flow_z[i, j] = -faces.across[i, j] * (p[i, j + 1] - p[i, j])
