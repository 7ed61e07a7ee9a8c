"""What passes between the nodes of a film: every face conducts by pressure, and the journal drags through it."""

from typing import Any, NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork, Wedge
from rigdata.arrays import FloatArray


class Faces(NamedTuple):
    """The faces of a film, (2, nodes): those ahead along the arc, those beside."""

    height: FloatArray  #: Film thickness [m].
    conductance: FloatArray  #: Rho h^3 / (12 mu) times length over distance [kg/s/Pa].
    couette: FloatArray  #: What the journal drags through a full face [kg/s].
    power: FloatArray  #: With which power of the thickness the conductance grows: 3 in a laminar film.


@inner
def film_faces(grid: FilmGrid, work: FilmWork, wedge: Wedge, speed: float) -> Faces:
    """Faces of a laminar film that is full everywhere; `wedge` is (Cp, a, b)."""
    shape, extra = grid.conducts.shape, work.extra.reshape(-1)
    light, dragged = oil_flows(work)
    height, conductance, couette = np.empty(shape), np.empty(shape), np.empty(shape)
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(extra) - step):
            even = wedge[0] - wedge[1] * grid.cos_face[side, n] - wedge[2] * grid.sin_face[side, n]
            h = even + 0.5 * (extra[n] + extra[n + step])
            height[side, n] = h
            conductance[side, n] = h * h * h / 24.0 * (light[n] + light[n + step]) * grid.conducts[side, n]
            couette[side, n] = 0.25 * speed * h * (dragged[n] + dragged[n + step]) * grid.drags[side, n]
    return Faces(height, conductance, couette, np.full(shape, 3.0))


@inner
def oil_flows(work: FilmWork) -> tuple[FloatArray, FloatArray]:
    """Density over viscosity [s/m^2], and what the journal drags along, density times drag [kg/m^3], (nodes,)."""
    density = work.density.reshape(-1)
    return density / work.viscosity.reshape(-1), density * work.drag.reshape(-1)


@compiled
def conductances(grid: FilmGrid, work: FilmWork, wedge: Wedge) -> FloatArray:
    """Those of a laminar film's faces, (2, nodes) [kg/s/Pa]."""
    return film_faces(grid, work, wedge, 0.0).conductance


@inner
def net_inflow(grid: FilmGrid, flow: Any, inflow: Any) -> None:
    """What flows through the faces, (2, nodes), into every control volume less what flows out, (unknowns,)."""
    line = grid.steps[0]
    for k in range(len(inflow)):
        n = grid.node[k]
        inflow[k] = flow[0, n - line] - flow[0, n] + flow[1, n - 1] - flow[1, n]


@inner
def poiseuille_inflow(p: FloatArray, conductance: FloatArray, line: int, n: int) -> float:
    """What the pressure of its neighbours drives into the control volume of a node without pressure."""
    along, across = conductance
    inflow = along[n - line] * p[n - line] + along[n] * p[n + line]
    return inflow + across[n] * p[n + 1] + across[n - 1] * p[n - 1]
