"""Perturbed film pressure: derivatives by approach, wedge and their rates, and by the pad's shape.

One factorisation serves all right-hand sides.
"""

from __future__ import annotations

import numpy as np

from model.arrays import FloatArray
from model.compilation import compiled
from model.film.matrix import substitute, substitute_four, substitute_many
from model.film.mesh import FilmGrid, FilmWork


@compiled
def rupture_line(
    grid: FilmGrid, work: FilmWork, gx: FloatArray, gz: FloatArray, source: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where between two nodes the film ruptures, as changes of the wet nodes' diagonal and area.

    A dry node is reached by the share `wet` of the flow that would wet it; the pressure rises as the square of
    the distance from the rupture line, so that the line lies (0.5 + wet) steps from the last wet node. A linear
    profile that vanishes there has (wet - 0.5) / (wet + 0.5) of the wet node's value at the dry node.
    """
    nt, nz = gx.shape[0], gz.shape[1]
    p, ruptured = work.pressure, work.ruptured
    diagonal = np.zeros((nt + 1, nz + 1))
    area = np.empty((nt + 1, nz + 1))
    for i in range(nt + 1):
        for j in range(nz + 1):
            area[i, j] = grid.area[i, j]
    for i in range(1, nt):
        for j in range(grid.first, nz):
            if not ruptured[i, j] or source[i, j] >= 0.0:
                continue
            inflow = gx[i - 1, j] * p[i - 1, j] + gx[i, j] * p[i + 1, j] + gz[i, j] * p[i, j + 1]
            if j > 0:
                inflow += gz[i, j - 1] * p[i, j - 1]
            wet = min(1.0, inflow / -source[i, j])
            ghost = (wet - 0.5) / (wet + 0.5)
            for side in range(-1, 2, 2):
                m = i + side
                if 0 < m < nt and not ruptured[m, j]:
                    diagonal[m, j] -= (gx[i - 1, j] if side < 0 else gx[i, j]) * ghost
                    area[m, j] *= 1.0 + 0.5 * (wet - 0.5)
    return diagonal, area


@compiled
def derivatives(
    grid: FilmGrid,
    work: FilmWork,
    wedge: tuple[float, float, float],
    conductance: tuple[FloatArray, FloatArray],
) -> None:
    """Right-hand sides of the perturbed equation, solved with the factor at hand; then the mass flows."""
    p, rhs, h = work.pressure, work.slopes, work.thickness
    gx, gz = conductance
    nt, nz = gx.shape[0], gz.shape[1]
    first = grid.first
    width = nz - first
    for k in range(rhs.shape[0]):
        for m in range(4):
            rhs[k, m] = 0.0
    for i in range(nt):
        base = wedge[0] - wedge[1] * grid.cos_face[i] - wedge[2] * grid.sin_face[i]
        for j in range(nz + 1):
            poiseuille = gx[i, j] * (p[i + 1, j] - p[i, j])
            hf = base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])
            # d(outflow through the face)/dh, times dh/da = -cos, dh/db = -sin
            slope = (work.flow_x[i, j] - 3.0 * poiseuille) / hf
            work.flow_x[i, j] -= poiseuille
            if first <= j < nz:
                k = i * width + j - first
                if i + 1 < nt:
                    rhs[k, 0] -= slope * grid.cos_face[i]
                    rhs[k, 1] -= slope * grid.sin_face[i]
                if i > 0:
                    rhs[k - width, 0] += slope * grid.cos_face[i]
                    rhs[k - width, 1] += slope * grid.sin_face[i]
    for i in range(nt + 1):
        for j in range(nz):
            poiseuille = gz[i, j] * (p[i, j + 1] - p[i, j])
            work.flow_z[i, j] = -poiseuille
            if 0 < i < nt:
                slope = -3.0 * poiseuille / (0.5 * (h[i, j] + h[i, j + 1]))
                k = (i - 1) * width + j - first
                if j >= first:
                    rhs[k, 0] += slope * grid.cos[i]
                    rhs[k, 1] += slope * grid.sin[i]
                if j + 1 < nz:
                    rhs[k + 1, 0] -= slope * grid.cos[i]
                    rhs[k + 1, 1] -= slope * grid.sin[i]
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * width + j - first
            squeeze = work.density[i, j] * grid.dx * grid.height[j]
            rhs[k, 2] = squeeze * grid.cos[i]
            rhs[k, 3] = squeeze * grid.sin[i]
            if work.ruptured[i, j]:
                for m in range(4):
                    rhs[k, m] = 0.0
    substitute_four(work.band, rhs)


@compiled
def shape_slopes(
    grid: FilmGrid, work: FilmWork, conductance: tuple[FloatArray, FloatArray], shapes: FloatArray
) -> FloatArray:
    """Derivatives of the pressure by the amplitudes of shapes that are added to the film thickness.

    Parameters
    ----------
    grid, work
        As `model.film.reynolds.solve_film` left them: the factor of the matrix is read.
    conductance : tuple of ndarray
        Of the faces along and across, at the present thickness.
    shapes : (nt + 1, nz + 1, m) ndarray
        What a unit amplitude adds to h [m].

    Returns
    -------
    (unknowns, m) ndarray
        [Pa per unit]; zero where the film is ruptured.
    """
    p, h = work.pressure, work.thickness
    gx, gz = conductance
    nt, nz = gx.shape[0], gz.shape[1]
    first, count = grid.first, shapes.shape[2]
    width = nz - first
    rhs = np.zeros((work.unknown.shape[0], count))
    for i in range(nt):
        for j in range(first, nz):
            # flow = couette - poiseuille; a thicker film takes more of both
            poiseuille = gx[i, j] * (p[i + 1, j] - p[i, j])
            couette = work.flow_x[i, j] + poiseuille
            slope = (couette - 3.0 * poiseuille) / (h[i, j] + h[i + 1, j])
            k = i * width + j - first
            for m in range(count):
                more = slope * (shapes[i, j, m] + shapes[i + 1, j, m])
                if i + 1 < nt:
                    rhs[k, m] += more
                if i > 0:
                    rhs[k - width, m] -= more
    for i in range(1, nt):
        for j in range(nz):
            slope = -3.0 * gz[i, j] * (p[i, j + 1] - p[i, j]) / (h[i, j] + h[i, j + 1])
            k = (i - 1) * width + j - first
            for m in range(count):
                more = slope * (shapes[i, j, m] + shapes[i, j + 1, m])
                if j >= first:
                    rhs[k, m] -= more
                if j + 1 < nz:
                    rhs[k + 1, m] += more
    for i in range(1, nt):
        for j in range(first, nz):
            if work.ruptured[i, j]:
                for m in range(count):
                    rhs[(i - 1) * width + j - first, m] = 0.0
    substitute_many(work.band, rhs)
    return rhs


@compiled
def warmer_pressure(
    grid: FilmGrid, work: FilmWork, speed: float, oil: tuple[float, float, float, float], change: FloatArray
) -> FloatArray:
    """Change of the pressure that the film's new temperature will make, to first order.

    Parameters
    ----------
    grid, work
        As `model.film.reynolds.solve_film` left them, with the new `work.temperature`; viscosity and density are
        those that the pressure was solved with.
    speed : float
        Surface speed of the journal [m/s].
    oil : tuple of float
        See `model.statics.pad_film.oil_constants`.
    change : (unknowns,) ndarray
        Overwritten with the change [Pa].

    Returns
    -------
    (2,) ndarray
        Change of the radial and tangential force [N].
    """
    h = work.thickness
    nt, nz = work.flow_x.shape[0], work.flow_z.shape[1]
    first = grid.first
    width = nz - first
    old = np.empty((nt + 1, nz + 1))
    new = np.empty((nt + 1, nz + 1))
    dense = np.empty((nt + 1, nz + 1))
    for i in range(nt + 1):
        for j in range(nz + 1):
            t = work.temperature[i, j]
            dense[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - t)) - work.density[i, j]
            old[i, j] = work.density[i, j] / work.viscosity[i, j]
            new[i, j] = (work.density[i, j] + dense[i, j]) / (oil[0] * np.exp(oil[1] * (40.0 - t)))
    for k in range(change.shape[0]):
        change[k] = 0.0
    for i in range(nt):
        for j in range(first, nz):
            couette = 0.25 * speed * 0.5 * (h[i, j] + h[i + 1, j]) * grid.height[j]
            poiseuille = couette * (work.density[i, j] + work.density[i + 1, j]) - work.flow_x[i, j]
            ratio = (new[i, j] + new[i + 1, j]) / (old[i, j] + old[i + 1, j]) - 1.0
            more = couette * (dense[i, j] + dense[i + 1, j]) - poiseuille * ratio
            k = i * width + j - first
            if i + 1 < nt:
                change[k] += more
            if i > 0:
                change[k - width] -= more
    for i in range(1, nt):
        for j in range(nz):
            ratio = (new[i, j] + new[i, j + 1]) / (old[i, j] + old[i, j + 1]) - 1.0
            more = work.flow_z[i, j] * ratio
            k = (i - 1) * width + j - first
            if j >= first:
                change[k] -= more
            if j + 1 < nz:
                change[k + 1] += more
    for i in range(1, nt):
        for j in range(first, nz):
            if work.ruptured[i, j]:
                change[(i - 1) * width + j - first] = 0.0
    substitute(work.band, change)
    force = np.zeros(2)
    for i in range(1, nt):
        total = 0.0
        for j in range(first, nz):
            total += grid.area[i, j] * change[(i - 1) * width + j - first]
        force[0] += grid.cos[i] * total
        force[1] += grid.sin[i] * total
    return force
