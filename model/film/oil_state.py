"""Between two solutions of a film: oil properties, how far a step may go, what passes the edges."""

from typing import NamedTuple

import numpy as np

from model.compilation import compiled
from model.film.mesh import FilmGrid, FilmWork, OilConstants
from rigdata.arrays import FloatArray


class Running(NamedTuple):
    """What a film runs with."""

    speed: float
    oil: OilConstants
    heat: tuple[float, float]


@compiled
def set_viscosity(work: FilmWork, oil: OilConstants) -> None:
    """Eq. (4) and (5) at every node."""
    colder = 40.0 - work.temperature
    work.viscosity[:] = oil[0] * np.exp(oil[1] * colder)
    work.density[:] = oil[2] * (1.0 + oil[3] * colder)


@compiled
def least_share(grid: FilmGrid, work: FilmWork, da: float, db: float, extra: FloatArray) -> float:
    """Most negative relative change of the film thickness for a change of (a, b) and of its shape (may be empty).

    `extra` (nt + 1, nz + 1) [m].
    """
    worst = 0.0
    for i in range(work.thickness.shape[0]):
        change = -(da * grid.cos[i] + db * grid.sin[i])
        for j in range(work.thickness.shape[1]):
            addition = extra[i, j] if extra.size > 0 else 0.0
            worst = min(worst, (change + addition) / work.thickness[i, j])
    return worst


@compiled
def edge_flows(grid: FilmGrid, work: FilmWork, supplied: float) -> tuple[float, float]:
    """What enters at the leading edge, no more than is supplied there [kg/s/m], and what leaves over both sides [kg/s].

    The difference leaves at the trailing edge, in streaks where the film is ruptured: by balance, because the rupture
    line of a mesh moves by whole nodes and what is found behind it jumps.
    """
    along, across, lines, nodes = work.flow[0], work.flow[1], grid.steps[0], work.pressure.size
    entering, corners, leaving_corners, inside, leaving = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(lines):
        flow, out = min(along[j], supplied * grid.height[j]), along[nodes - 2 * lines + j]
        entering += flow
        if j == lines - 1 or j < grid.first:
            corners += flow
            leaving_corners += out
        else:
            inside += flow
            leaving += out
    over = 0.0
    for n in range(0, nodes, lines):
        over += across[n + lines - 2]
        if grid.first == 1:
            over -= across[n]
    # the half cells at the edges have no pressure: they run as full at the trailing edge as the lines beside them
    filled = min(1.0, max(0.0, (inside - over) / leaving)) if leaving > 0.0 else 1.0
    # the mesh holds one half of a symmetric film
    halves = 2.0 if grid.first == 0 else 1.0
    return halves * entering, halves * (over + corners - filled * leaving_corners)
