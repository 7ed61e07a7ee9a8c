"""The matrix of a film that conserves mass where it is ruptured: one column per node, of pressure or of filling.

Row by row the matrix says what flows out of a control volume less what flows in. The column of a wet node is that of
its pressure; the column of a ruptured node is that of its filling, which the journal drags downstream only. Either
has non-positive entries beside the diagonal and sums to zero or more, so that every mixture is an M-matrix: it is
factorised without pivoting. Not symmetric: banded L U.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.oil_state import face_height
from model.film.reynolds import conductances
from rigdata.arrays import BoolArray, FloatArray


class FaceFlows(NamedTuple):
    """What the faces of the control volumes conduct and carry."""

    #: (nt, nz + 1), (nt + 1, nz): Conductance rho h^3 / (12 mu) times length over distance [kg/s/Pa].
    along: FloatArray
    across: FloatArray
    couette: FloatArray  #: (nt, nz + 1): What the journal drags through a face along the arc that is full [kg/s].
    height: FloatArray  #: (nt, nz + 1): Film thickness at those faces [m].
    #: (nz + 1,): What the journal drags over the leading edge at most [kg/s], be it that a gap that opens there is
    #: not filled, or that the groove gives no more; and how that grows with the gap [kg/s/m].
    supply: FloatArray
    follows: FloatArray


@compiled
def face_flows(grid: FilmGrid, work: FilmWork, wedge: Wedge, speed: float, supplied: tuple[float, float]) -> FaceFlows:
    """Conductances and drag of a film that is full everywhere but for its supply.

    `supplied`: share of the gap there that is filled at most, and what the groove gives at most [kg/s/m].
    """
    along, across = conductances(grid, work, wedge)
    couette, height = np.empty_like(along), np.empty_like(along)
    for i in range(along.shape[0]):
        for j in range(along.shape[1]):
            height[i, j] = face_height(grid, work, wedge, i, j)
            density = 0.5 * (work.density[i, j] + work.density[i + 1, j])
            couette[i, j] = 0.5 * speed * height[i, j] * density * grid.height[j]
    supply, follows = np.empty(along.shape[1]), np.zeros(along.shape[1])
    for j in range(len(supply)):
        dragged = 0.5 * supplied[0] * speed * work.density[0, j] * grid.height[j]
        supply[j] = supplied[1] * grid.height[j]
        # a groove without pressure fills no gap that opens
        if work.pressure[0, j] == 0.0 and dragged * work.thickness[0, j] <= supply[j]:
            supply[j], follows[j] = dragged * work.thickness[0, j], dragged
    return FaceFlows(along, across, couette, height, supply, follows)


@inner
def assemble_columns(band: FloatArray, faces: FaceFlows, ruptured: BoolArray, first: int) -> None:
    """Fill the band: entry (row, column) stands at ``band[row, width + column - row]``.

    `band` (n, 2 width + 1), `ruptured` (nt + 1, nz + 1).
    """
    gx, gz, couette = faces.along, faces.across, faces.couette
    nt, nz = gx.shape[0], gz.shape[1]
    width = nz - first
    band[:, :] = 0.0
    for i in range(1, nt):
        for j in range(first, nz):
            k = (i - 1) * width + j - first
            if ruptured[i, j]:
                band[k, width] = couette[i, j]
                if i + 1 < nt:
                    band[k + width, 0] = -couette[i, j]
                continue
            band[k, width] = gx[i, j] + gz[i, j]
            if i > 1 or not ruptured[0, j]:  # what is supplied to a gap that opens does not ask for the pressure
                band[k, width] += gx[i - 1, j]
            if i > 1:
                band[k - width, 2 * width] = -gx[i - 1, j]
            if i + 1 < nt:
                band[k + width, 0] = -gx[i, j]
            if j + 1 < nz:
                band[k + 1, width - 1] -= gz[i, j]
            if j > 0:
                band[k, width] += gz[i, j - 1]
                if j > first:
                    band[k - 1, width + 1] -= gz[i, j - 1]


@inner
def substitute_columns(band: FloatArray, x: FloatArray) -> None:
    """Solve for the right-hand sides (n, m) in place, with the factor from `factorise_general`."""
    n = band.shape[0]
    width = band.shape[1] // 2
    count = x.shape[1]
    for k in range(n):
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k + r, width - r]
            if factor != 0.0:
                for m in range(count):
                    x[k + r, m] -= factor * x[k, m]
    for k in range(n - 1, -1, -1):
        for s in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, width + s]
            if factor != 0.0:
                for m in range(count):
                    x[k, m] -= factor * x[k + s, m]
        for m in range(count):
            x[k, m] *= band[k, width]
