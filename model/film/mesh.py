"""Mesh and arrays of one film: uniform along the arc, finer towards the edges across, half as wide where symmetric."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from model.errors import OptionError
from rigdata.arrays import BoolArray, FloatArray, IntArray

#: Cp, a and b [m].
Wedge = tuple[float, float, float]
#: mu_40, kappa, rho_40, alpha_v.
OilConstants = tuple[float, float, float, float]


class FilmGrid(NamedTuple):
    """Mesh of one film; `nt` intervals along the arc, `nz` across (half width if symmetric).

    Nodes are counted line by line across. Every node n has two faces: to node n + `steps[0]` ahead along the arc, and
    to n + `steps[1]` beside it; at the last of a line the latter conducts nothing, and there is none. Arrays of faces
    are (2, nodes).
    """

    angle: FloatArray  #: (nt + 1,): alpha, from the pivot, positive with rotation [rad].
    z: FloatArray  #: (nz + 1,): Axial coordinate from mid-length [m].
    cos: FloatArray  #: (nt + 1,): At the nodes.
    sin: FloatArray
    cos_face: FloatArray  #: At the faces, beside as at the node.
    sin_face: FloatArray
    conducts: FloatArray  #: Length of the faces over the distance of their nodes.
    drags: FloatArray  #: Axial size of the faces along, through which the journal drags; 0 beside [m].
    node: IntArray  #: (unknowns,): Nodes with an unknown pressure: all but those at the edges.
    dx: Any  #: Spacing along [m].
    dz: FloatArray  #: (nz,): Spacing across [m]; finer towards the edges, where the pressure bends most.
    height: FloatArray  #: (nz + 1,): Axial size of each control volume [m].
    area: FloatArray  #: (nt + 1, nz + 1): Quadrature weights [m^2]; the mirrored half is counted.
    steps: IntArray  #: (2,)
    first: int  #: The first line across with an unknown pressure: 0 in half a film, at the line of symmetry.


class FilmWork(NamedTuple):
    """Arrays that one film solution fills (mesh shape (nt + 1, nz + 1) unless said otherwise)."""

    pressure: FloatArray  #: [Pa]
    ruptured: BoolArray  #: True where the film is ruptured.
    temperature: FloatArray  #: [degC]
    viscosity: FloatArray  #: [Pa s], [kg/m^3], frozen for the pressure solution.
    density: FloatArray
    #: What the journal drags along over half the gap's flow U h / 2: 1, unless the viscosity changes
    #: across the film, see `model.film.cross_film`.
    drag: FloatArray
    #: What a kelvin of film temperature loses to pad and journal, per station of length dx and
    #: control-volume height [W/K]; zero in the adiabatic baseline.
    exchange: FloatArray
    gained: FloatArray  #: What the film gains from them besides [W].
    thickness: FloatArray  #: h [m].
    extra: FloatArray  #: What is added to h: pad deformation, misalignment [m].
    flow: FloatArray  #: (2, nodes): Mass flow through the faces ahead and beside [kg/s].
    band: FloatArray  #: ((nt - 1) * unknowns, unknowns + 1): Factor of the matrix.
    unknown: FloatArray  #: ((nt - 1) * unknowns,): Pressure at the unknowns.
    slopes: FloatArray  #: ((nt - 1) * unknowns, 4): Its derivatives by a, b, da/dt, db/dt.

    @property
    def flow_x(self) -> FloatArray:
        """Along the arc, (nt, nz + 1)."""
        return self.flow[0].reshape(self.pressure.shape)[:-1]

    @property
    def flow_z(self) -> FloatArray:
        """Across, (nt + 1, nz)."""
        return self.flow[1].reshape(self.pressure.shape)[:, :-1]


@lru_cache(maxsize=64)
def film_grid(
    start: float, end: float, radius: float, length: float, shape: tuple[int, int], symmetric: bool
) -> FilmGrid:
    """Lay a mesh over a film."""
    nt, nz = shape
    if nt < 4 or nz < 2 or nt % 2 or nz % 2:
        raise OptionError(f"mesh must have even numbers of intervals, at least 4 x 2, got {nt} x {nz}")
    angle = np.linspace(start, end, nt + 1)
    z = 0.5 * length * _graded(nz, symmetric)
    first = 0 if symmetric else 1
    dx, dz = radius * (end - start) / nt, z[1:] - z[:-1]
    height = np.zeros(nz + 1)
    height[:-1] += 0.5 * dz
    height[1:] += 0.5 * dz
    across = _parabolic_weights(z)
    # Trapezoids along: the rupture line leaves the profile only once differentiable.
    along = np.full(nt + 1, dx)
    along[[0, -1]] = 0.5 * dx
    area = along[:, None] * across * (2.0 if symmetric else 1.0)
    faces = np.array([angle, angle])
    faces[0, :-1] = 0.5 * (angle[1:] + angle[:-1])
    cos_face, sin_face = (values.repeat(nz + 1, axis=1) for values in (np.cos(faces), np.sin(faces)))
    conducts, drags = np.zeros((2, nt + 1, nz + 1)), np.zeros((2, nt + 1, nz + 1))
    conducts[0, :-1], drags[0, :-1] = height / dx, height
    conducts[1, :, :-1] = dx / dz
    node = np.arange(area.size).reshape(area.shape)[1:-1, first:-1].ravel()
    return FilmGrid(
        angle, z, np.cos(angle), np.sin(angle), cos_face, sin_face, conducts.reshape(2, -1),
        drags.reshape(2, -1), node, dx, dz, height, area, np.array([nz + 1, 1]), first,
    )  # fmt: skip


#: How much finer the axial mesh is at the edges: the spacing there is 1 - GRADING of the mean.
_GRADING = 0.5


def _graded(nz: int, symmetric: bool) -> FloatArray:
    """Node positions in units of half the width: 0 to 1, or -1 to 1."""
    if not symmetric:
        half = _graded(nz // 2, True)
        return np.concatenate([-half[:0:-1], half])
    share = np.arange(nz + 1) / nz
    return share * (1.0 + _GRADING - _GRADING * share)


def _parabolic_weights(z: FloatArray) -> FloatArray:
    """Simpson's rule for unequal spacing: exact for a parabola through every pair of intervals."""
    weights = np.zeros(len(z))
    for k in range(0, len(z) - 2, 2):
        h0, h1 = z[k + 1] - z[k], z[k + 2] - z[k + 1]
        total = (h0 + h1) / 6.0
        weights[k] += total * (2.0 - h1 / h0)
        weights[k + 1] += total * (h0 + h1) ** 2 / (h0 * h1)
        weights[k + 2] += total * (2.0 - h0 / h1)
    return weights


def film_works(grids: list[FilmGrid], inlet_temperature: float) -> tuple[FilmWork, list[FilmWork]]:
    """Allocate the arrays of films of one mesh side by side, and as parts, at rest at the inlet temperature."""
    nt, nz = len(grids[0].angle) - 1, len(grids[0].z) - 1
    unknowns = nz - grids[0].first
    count, n = len(grids), (nt - 1) * unknowns
    shape = (count, nt + 1, nz + 1)
    arrays: dict[str, Any] = {
        "ruptured": np.zeros(shape, dtype=np.bool_),
        "temperature": np.full(shape, inlet_temperature),
        "drag": np.ones(shape),
        "flow": np.zeros((count, 2, (nt + 1) * (nz + 1))),
        "band": np.zeros((count, n, unknowns + 1)),
        "unknown": np.zeros((count, n)),
        "slopes": np.zeros((count, n, 4)),
    }
    for name in FilmWork._fields:
        if name not in arrays:
            arrays[name] = np.zeros(shape)
    stack = FilmWork(**arrays)
    return stack, [FilmWork(*parts) for parts in zip(*stack)]


def film_work(grid: FilmGrid, inlet_temperature: float) -> FilmWork:
    """Allocate the arrays of one film."""
    return film_works([grid], inlet_temperature)[1][0]
