"""Between two solutions of a film: oil properties, how far a step may go, what passes the edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork, OilConstants, Wedge
from rigdata.arrays import FloatArray


class Running(NamedTuple):
    """What a film runs with."""

    speed: float
    oil: OilConstants
    heat: tuple[float, float]


@compiled
def set_viscosity(work: FilmWork, oil: OilConstants) -> None:
    """Eq. (4) and (5) at every node."""
    t = work.temperature
    for i in range(t.shape[0]):
        for j in range(t.shape[1]):
            work.viscosity[i, j] = oil[0] * np.exp(oil[1] * (40.0 - t[i, j]))
            work.density[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - t[i, j]))


@inner
def face_height(grid: FilmGrid, work: FilmWork, wedge: Wedge, i: int, j: int) -> float:
    """Film thickness at the face between stations i and i + 1 [m]; `wedge` is (Cp, a, b)."""
    base = wedge[0] - wedge[1] * grid.cos_face[i] - wedge[2] * grid.sin_face[i]
    return base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])


@compiled
def least_share(grid: FilmGrid, work: FilmWork, da: float, db: float, extra: FloatArray) -> float:
    """Most negative relative change of the film thickness for a change of (a, b) and of its shape (may be empty).

    `extra` (nt + 1, nz + 1) [m].
    """
    worst = 0.0
    for i in range(work.thickness.shape[0]):
        change = -(da * grid.cos[i] + db * grid.sin[i])
        for j in range(work.thickness.shape[1]):
            more = extra[i, j] if extra.size > 0 else 0.0
            worst = min(worst, (change + more) / work.thickness[i, j])
    return worst


@compiled
def edge_flows(grid: FilmGrid, work: FilmWork, supplied: float) -> tuple[float, float]:
    """What enters at the leading edge, no more than is supplied there [kg/s/m], and what leaves over both sides [kg/s].

    The difference leaves at the trailing edge, in streaks where the film is ruptured: by balance, because the rupture
    line of a mesh moves by whole nodes and what is found behind it jumps.
    """
    rows, last = work.flow_x.shape[0], work.flow_z.shape[1]
    entering, corners, leaving_corners, inside, leaving = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(last + 1):
        flow = min(work.flow_x[0, j], supplied * grid.height[j])
        entering += flow
        if j == last or j < grid.first:
            corners += flow
            leaving_corners += work.flow_x[rows - 1, j]
        else:
            inside += flow
            leaving += work.flow_x[rows - 1, j]
    over = 0.0
    for i in range(rows + 1):
        over += work.flow_z[i, last - 1]
        if grid.first == 1:
            over -= work.flow_z[i, 0]
    # the half cells at the edges have no pressure: they run as full at the trailing edge as the lines beside them
    filled = min(1.0, max(0.0, (inside - over) / leaving)) if leaving > 0.0 else 1.0
    # the mesh holds one half of a symmetric film
    both = 2.0 if grid.first == 0 else 1.0
    return both * entering, both * (over + corners - filled * leaving_corners)
