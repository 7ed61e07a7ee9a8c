"""The pad as an elastic, heat-conducting solid, seen from the oil film: Eq. (6)-(8) of the paper.

``solid_of(geometry, film_theta, film_z)`` costs seconds once per geometry (kept in memory and in the user's cache
folder) and array products afterwards. All deformations are relative to the rigid pad held at its pivot
face; tilt and pivot deflection are the equilibrium's business. Positive is outward: the film grows thicker by it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from model.errors import ModelError
from model.pad.line import Line, gauss_rule
from model.pad.mesh import MeshDensity, PadGeometry
from model.pad.operators import PadOperators, pad_operators
from rigdata.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class AxisMap:
    """One axis of the map."""

    gather: FloatArray  #: (n_face, n_film): G: integrals of face functions times film functions.
    project: FloatArray  #: (n_film, n_face): M^-1 G^T: film values of a face function.


def _axis_map(face: Line, film: Line, even: bool | None = None) -> AxisMap:
    """Map of two bases on the same interval, or of one on 0 <= z <= L/2 and a film's even or odd part on -L/2..L/2."""
    breaks = film.breaks if even is None else np.unique(np.abs(film.breaks))
    points, weights = _points(face.breaks, breaks, face.degree)
    values = film.tabulate(points)
    if even is not None:
        values = 0.5 * (values + (1.0 if even else -1.0) * film.tabulate(-points))
    gather = face.tabulate(points).T @ (weights[:, None] * values)
    return AxisMap(gather, _solve(film, (1.0 if even is None else 2.0) * gather.T))


@dataclass(frozen=True, eq=False)
class FilmMap:
    """Both axes, for the elements and for the bilinear temperatures.

    The film's pressure is bilinear on its grid, the pad's displacement quadratic on its elements. Loads are
    integrals of one against the basis of the other; the displacement at film nodes is the bilinear function closest
    to that of the elements in the mean square (L2 projection). Both use the same integrals G = int psi phi, so with
    M = int phi phi the compliance C on film nodes obeys M C = G^T S G: work done by the film is work taken up by
    the pad, to rounding.
    """

    theta: AxisMap
    z: AxisMap
    coarse_theta: FloatArray  #: (n_coarse, n_film): Bilinear face values closest in the mean square to film values.
    coarse_z: FloatArray

    @classmethod
    def between(cls, face: tuple[Line, Line], film: tuple[Line, Line], even: bool | None) -> FilmMap:
        """Build the maps; `even` is None for a film on the half length, else the part of a full one."""
        along, across = (Line(line.breaks, 1) for line in face)
        return cls(
            theta=_axis_map(face[0], film[0]),
            z=_axis_map(face[1], film[1], even),
            coarse_theta=_solve(along, _axis_map(along, film[0]).gather),
            coarse_z=_solve(across, _axis_map(across, film[1], even).gather),
        )

    @cached_property
    def dense(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gather, project and coarse as matrices on raveled fields: (face, film), (film, face), (coarse, film)."""
        return (
            _kron(self.theta.gather, self.z.gather),
            _kron(self.theta.project, self.z.project),
            _kron(self.coarse_theta, self.coarse_z),
        )


def _kron(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.kron(first, second), dtype=float)


def _solve(line: Line, integrals: FloatArray) -> FloatArray:
    """Coefficients of the function of `line` with these integrals against its basis."""
    return np.asarray(np.linalg.solve(line.matrix(0, 0), integrals), dtype=float)


def _points(first: FloatArray, second: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points exact for products of piecewise polynomials of both sets of breaks."""
    merged = np.unique(np.concatenate((first, second)))
    distinct = np.concatenate(([True], np.diff(merged) > 1e-12 * (merged[-1] - merged[0])))
    return gauss_rule(np.clip(merged[distinct], first[0], first[-1]), degree + 1)


Operators = Callable[[PadGeometry, MeshDensity, bool], PadOperators]


@dataclass(frozen=True, eq=False, repr=False)
class PadSolid:
    """Linear response of a pad to the pressure and temperature of its film.

    Fields on the film grid have shape (n_theta, n_z); matrices act on their ``ravel()``. Temperatures are rises above
    the oil supply temperature [K].
    """

    geometry: PadGeometry
    density: MeshDensity
    film_theta: FloatArray  #: (n_theta,): Film nodes along the arc [rad from the pivot].
    #: (n_z,): Film nodes along the axis [m from the mid-plane]: 0 to L/2 for a symmetric film, whose mirror
    #: image is included in every result, or -L/2 to L/2.
    film_z: FloatArray
    _parts: tuple[tuple[PadOperators, FilmMap], ...] = field(repr=False)

    @cached_property
    def compliance(self) -> FloatArray:
        """Deformation per film pressure, ``compliance @ p.ravel()`` as `bend` [m/Pa], (n_film, n_film)."""
        out = np.zeros((self._n_film, self._n_film))
        for solid, to in self._parts:
            gather, project, _ = to.dense
            out += project @ (solid.compliance @ gather)
        return _frozen(self.geometry.inner_radius * out)

    @cached_property
    def thermal_factors(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Film to the pad's coarser nodes, (n_coarse, n_film), and from there `thermal` and `heat_flux`."""
        coarser, expansion, flux = [], [], []
        for solid, to in self._parts:
            _, project, coarse = to.dense
            coarser.append(coarse)
            expansion.append(project @ solid.expansion)
            flux.append(project @ solid.flux)
        return _frozen(np.vstack(coarser)), _frozen(np.hstack(expansion)), _frozen(np.hstack(flux))

    @property
    def _n_film(self) -> int:
        return self.film_theta.size * self.film_z.size


def solid_of(
    geometry: PadGeometry,
    film_theta: ArrayLike,
    film_z: ArrayLike,
    density: MeshDensity | None = None,
    operators: Operators = pad_operators,
) -> PadSolid:
    """Solid of a pad for a film grid."""
    theta, z = np.asarray(film_theta, dtype=float), np.asarray(film_z, dtype=float)
    _check_span(theta, (geometry.leading, geometry.trailing), "film_theta", "rad")
    if z.ndim == 1 and z.size and abs(z[0]) < 1e-6 * geometry.length:
        _check_span(z, (0.0, 0.5 * geometry.length), "film_z", "m")
    else:
        _check_span(z, (-0.5 * geometry.length, 0.5 * geometry.length), "film_z", "m")
    return _solid(geometry, density or MeshDensity(), theta.tobytes(), z.tobytes(), operators)


@lru_cache(maxsize=8)  # a dense matrix of a usual film grid has 3 MB, and there are four
def _solid(
    geometry: PadGeometry, density: MeshDensity, theta_bytes: bytes, z_bytes: bytes, operators: Operators
) -> PadSolid:
    theta, z = (np.frombuffer(raw, dtype=float) for raw in (theta_bytes, z_bytes))
    half = 0.5 * geometry.length
    full = bool(z[0] < -1e-6 * geometry.length)
    along = Line(_snap(theta, geometry.leading, geometry.trailing), 1)
    across = Line(_snap(z, -half if full else 0.0, half), 1)
    parts = []
    for even in (True, False) if full else (True,):
        solid = operators(geometry, density, even)
        parts.append((solid, FilmMap.between((solid.theta, solid.z), (along, across), even if full else None)))
    return PadSolid(geometry, density, along.breaks, across.breaks, tuple(parts))


def _snap(nodes: FloatArray, first: float, last: float) -> FloatArray:
    """Put the end nodes exactly on the pad's edges."""
    out = nodes.copy()
    out[0], out[-1] = first, last
    return out


def _check_span(nodes: FloatArray, ends: tuple[float, float], name: str, unit: str) -> None:
    tolerance = 1e-6 * (ends[1] - ends[0])
    fits = nodes.ndim == 1 and nodes.size >= 2 and bool(np.all(np.diff(nodes) > 0))
    if not fits or abs(nodes[0] - ends[0]) > tolerance or abs(nodes[-1] - ends[1]) > tolerance:
        got = f"{nodes[0]:.6g} to {nodes[-1]:.6g}" if nodes.ndim == 1 and nodes.size else f"shape {nodes.shape}"
        raise ModelError(
            f"{name} must be a 1-D increasing grid from {ends[0]:.6g} to {ends[1]:.6g} {unit} (the pad), got {got}."
        )


def _frozen(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array
