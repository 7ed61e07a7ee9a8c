"""What is done at every node of a film between two solutions: oil properties, and how far a step may go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray


class Running(NamedTuple):
    """What a film runs with."""

    speed: float
    oil: tuple[float, float, float, float]
    heat: tuple[float, float]


@compiled
def set_viscosity(work: FilmWork, oil: tuple[float, float, float, float]) -> None:
    """Eq. (4) and (5) at every node."""
    t = work.temperature
    for i in range(t.shape[0]):
        for j in range(t.shape[1]):
            work.viscosity[i, j] = oil[0] * np.exp(oil[1] * (40.0 - t[i, j]))
            work.density[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - t[i, j]))


@inner
def face_height(grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], i: int, j: int) -> float:
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
