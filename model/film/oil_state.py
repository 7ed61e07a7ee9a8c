"""What is done at every node of a film between two solutions: oil properties, and how far a step may go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.arrays import FloatArray
from model.compilation import compiled
from model.film.mesh import FilmGrid, FilmWork


class Running(NamedTuple):
    """What a film runs with.

    Attributes
    ----------
    speed : float
        Surface speed of the journal [m/s].
    oil : tuple of float
        See `model.statics.pad_film.oil_constants`.
    heat : tuple of float
        Specific heat [J/kg/K] and conductivity [W/m/K] of the oil, both over the share of the heat that stays in it.
    """

    speed: float
    oil: tuple[float, float, float, float]
    heat: tuple[float, float]


@compiled
def set_viscosity(work: FilmWork, oil: tuple[float, float, float, float]) -> None:
    """Eq. (4) and (5) at every node.

    Parameters
    ----------
    work : FilmWork
        Its viscosity [Pa s] and density [kg/m^3] are set.
    oil : tuple of float
        See `model.statics.pad_film.oil_constants`.
    """
    t = work.temperature
    for i in range(t.shape[0]):
        for j in range(t.shape[1]):
            work.viscosity[i, j] = oil[0] * np.exp(oil[1] * (40.0 - t[i, j]))
            work.density[i, j] = oil[2] * (1.0 + oil[3] * (40.0 - t[i, j]))


@compiled
def least_share(grid: FilmGrid, work: FilmWork, da: float, db: float, extra: FloatArray) -> float:
    """Most negative relative change of the film thickness for a change of (a, b) and of its shape (may be empty).

    Parameters
    ----------
    grid : FilmGrid
    work : FilmWork
    da : float
        Change of a [m].
    db : float
        Change of b [m].
    extra : (nt + 1, nz + 1) ndarray
        Change of the shape [m]; may be empty.

    Returns
    -------
    float
    """
    worst = 0.0
    for i in range(work.thickness.shape[0]):
        change = -(da * grid.cos[i] + db * grid.sin[i])
        for j in range(work.thickness.shape[1]):
            more = extra[i, j] if extra.size > 0 else 0.0
            worst = min(worst, (change + more) / work.thickness[i, j])
    return worst
