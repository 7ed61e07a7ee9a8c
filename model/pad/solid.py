"""The pad as an elastic, heat-conducting solid, seen from the oil film: Eq. (6)-(8) of the paper.

``solid = pad_solid(pad, bearing, film_theta, film_z)`` costs seconds once per geometry (kept in memory and in the
user's cache folder) and array products afterwards. All deformations are relative to the rigid pad held at its pivot
face; tilt and pivot deflection are the equilibrium's business. Positive is outward: the film grows thicker by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from model.arrays import FloatArray
from model.bearing import Bearing, Pad
from model.errors import ModelError
from model.pad.film_map import FilmMap
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, PivotFace
from model.pad.operators import PadOperators, pad_operators


@dataclass(frozen=True, eq=False, repr=False)
class PadSolid:
    """Linear response of a pad to the pressure and temperature of its film.

    Fields on the film grid have shape (n_theta, n_z); matrices act on their ``ravel()``. Temperatures are rises above
    the oil supply temperature [K].

    Attributes
    ----------
    geometry : PadGeometry
    density : MeshDensity
    film_theta : (n_theta,) ndarray
        Film nodes along the arc [rad from the pivot].
    film_z : (n_z,) ndarray
        Film nodes along the axis [m from the mid-plane]: 0 to L/2 for a symmetric film, whose mirror image is
        included in every result, or -L/2 to L/2.
    """

    geometry: PadGeometry
    density: MeshDensity
    film_theta: FloatArray
    film_z: FloatArray
    _parts: tuple[tuple[PadOperators, FilmMap], ...] = field(repr=False)

    @property
    def symmetric(self) -> bool:
        """Whether the film grid is one half of a symmetric film."""
        return len(self._parts) == 1

    def bend(self, pressure: ArrayLike) -> FloatArray:
        """Deformation by film pressure, bilinear between film nodes.

        Parameters
        ----------
        pressure : (n_theta, n_z) array_like
            [Pa]

        Returns
        -------
        ndarray, shape (n_theta, n_z)
            Outward deformation of the film surface [m].
        """
        given = self._on_grid(pressure, "pressure")
        out = np.zeros(given.shape)
        for solid, to in self._parts:
            force = self.geometry.inner_radius * (to.theta.gather @ given @ to.z.gather.T)
            moved = (solid.compliance @ force.ravel()).reshape(force.shape)
            out += to.theta.project @ moved @ to.z.project.T
        return out

    def expand(self, rise: ArrayLike) -> FloatArray:
        """Thermal deformation for a film temperature rise, conduction through the pad included.

        Parameters
        ----------
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].

        Returns
        -------
        ndarray, shape (n_theta, n_z)
            Outward deformation of the film surface [m].
        """
        return self._thermal(self._on_grid(rise, "rise"), "expansion")

    def deform(self, pressure: ArrayLike, rise: ArrayLike, factor: float = 1.0) -> FloatArray:
        """Sum of `bend` and `expand`, times `factor` (the `compliance_factor` of docs/theory.md) [m].

        Parameters
        ----------
        pressure : (n_theta, n_z) array_like
            [Pa]
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].
        factor : float

        Returns
        -------
        (n_theta, n_z) ndarray
            [m]
        """
        return factor * (self.bend(pressure) + self.expand(rise))

    def heat_flow(self, rise: ArrayLike) -> FloatArray:
        """Heat flux density from film into pad [W/m^2], shape (n_theta, n_z), for a film temperature rise [K].

        Parameters
        ----------
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].

        Returns
        -------
        (n_theta, n_z) ndarray
            [W/m^2]
        """
        return self._thermal(self._on_grid(rise, "rise"), "flux")

    @cached_property
    def compliance(self) -> FloatArray:
        """Deformation per film pressure, ``compliance @ p.ravel()`` as `bend` [m/Pa], (n_film, n_film)."""
        out = np.zeros((self._n_film, self._n_film))
        for solid, to in self._parts:
            gather, project, _ = to.dense
            out += project @ (solid.compliance @ gather)
        return _frozen(self.geometry.inner_radius * out)

    @cached_property
    def thermal(self) -> FloatArray:
        """Deformation per film temperature rise, ``thermal @ rise.ravel()`` as `expand` [m/K], (n_film, n_film)."""
        return self._thermal_matrix("expansion")

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

    @cached_property
    def heat_flux(self) -> FloatArray:
        """Heat flux density into the pad per film temperature rise, as `heat_flow` [W/m^2/K], (n_film, n_film)."""
        return self._thermal_matrix("flux")

    @cached_property
    def film_mass(self) -> FloatArray:
        """Area weights of the film grid [m^2], (n_film, n_film): integrals of products of its bilinear functions.

        ``film_mass @ compliance`` is symmetric and positive semidefinite.
        """
        theta, z = (Line(nodes, 1).matrix(0, 0) for nodes in (self.film_theta, self.film_z))
        return _frozen(np.asarray(self.geometry.inner_radius * np.kron(theta, z)))

    def pad_temperature(self, rise: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Temperature of the pad's mid-plane.

        Parameters
        ----------
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].

        Returns
        -------
        theta : (n_arc,) ndarray
            Angles from the pivot [rad].
        radius : (n_radii,) ndarray
            [m], from the film surface to the back.
        rise : (n_arc, n_radii) ndarray
            Pad temperature less supply temperature [K].
        """
        even, to = self._parts[0]
        coarse = to.coarse_theta @ self._on_grid(rise, "rise") @ to.coarse_z.T
        field_ = (even.section @ coarse.ravel()).reshape(even.theta.n_nodes, even.radius.size)
        return even.theta.nodes, even.radius, field_

    def back_temperature(self, rise: ArrayLike) -> FloatArray:
        """Temperature rise on the pad's back over the film nodes [K], shape (n_theta, n_z).

        Parameters
        ----------
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].

        Returns
        -------
        (n_theta, n_z) ndarray
            [K]
        """
        return self._thermal(self._on_grid(rise, "rise"), "back")

    def peak_rise(self, rise: ArrayLike) -> float:
        """Largest temperature rise in the pad [K].

        The pad has no heat source, so it is hottest on a face; the film face has the film's temperature and the
        others lose heat. Hence it is the film's largest rise.

        Parameters
        ----------
        rise : (n_theta, n_z) array_like
            Film temperature less supply temperature [K].

        Returns
        -------
        float
            [K]
        """
        return max(0.0, float(np.max(self._on_grid(rise, "rise"))))

    def describe(self) -> str:
        """One line of text for reports: what was solved, how finely, how stiff."""
        g, solid = self.geometry, self._parts[0][0]
        n_r, n_arc, n_z = (solid.radius.size - 1, solid.theta.n_nodes - 1, solid.z.n_nodes - 1)
        degree = self.density.degree
        uniform = np.ones((self.film_theta.size, self.film_z.size))
        bend, grow = self.bend(1e6 * uniform), self.expand(uniform)
        return (
            f"Pad {1e3 * (g.outer_radius - g.inner_radius):.2f} mm thick ({1e3 * g.babbitt_thickness:.2f} mm lining), "
            f"{math.degrees(g.trailing - g.leading):.1f} deg, {1e3 * g.length:.1f} mm long, held on "
            f"{1e3 * g.face.width:.1f} x {1e3 * g.face.length:.1f} mm; "
            f"{n_r // degree} x {n_arc // degree} x {n_z // degree} hexahedra of degree {degree} on half the length; "
            f"edges open {1e6 * np.max(bend):.2f} um under 1 MPa all over; "
            f"film surface moves {1e6 * np.min(grow):.3f} to {1e6 * np.max(grow):.3f} um per K of film temperature"
        )

    def __repr__(self) -> str:
        grid = f"{self.film_theta.size} x {self.film_z.size} film nodes, {'half' if self.symmetric else 'full'} length"
        return f"PadSolid({grid}: {self.describe()})"

    @property
    def _n_film(self) -> int:
        return self.film_theta.size * self.film_z.size

    def _on_grid(self, values: ArrayLike, name: str) -> FloatArray:
        array = np.asarray(values, dtype=float)
        shape = (self.film_theta.size, self.film_z.size)
        if array.shape not in (shape, (self._n_film,)):
            raise ModelError(f"{name} must have the film grid's shape {shape}, got {array.shape}.")
        return array.reshape(shape)

    def _thermal(self, rise: FloatArray, name: str) -> FloatArray:
        out = np.zeros(rise.shape)
        for solid, to in self._parts:
            coarse = to.coarse_theta @ rise @ to.coarse_z.T
            answer = (getattr(solid, name) @ coarse.ravel()).reshape(solid.theta.n_nodes, solid.z.n_nodes)
            out += to.theta.project @ answer @ to.z.project.T
        return out

    def _thermal_matrix(self, name: str) -> FloatArray:
        out = np.zeros((self._n_film, self._n_film))
        for solid, to in self._parts:
            _, project, coarse = to.dense
            out += project @ (getattr(solid, name) @ coarse)
        return _frozen(out)


def pad_solid(
    pad: Pad,
    bearing: Bearing,
    film_theta: ArrayLike,
    film_z: ArrayLike,
    face: PivotFace | None = None,
    density: MeshDensity | None = None,
) -> PadSolid:
    """Solid of a pad for a film grid.

    Parameters
    ----------
    pad : Pad
    bearing : Bearing
        For journal radius, length and pivot.
    film_theta : (n_theta,) array_like
        Film nodes along the arc [rad from the pivot], from the leading to the trailing edge.
    film_z : (n_z,) array_like
        Film nodes along the axis [m from the mid-plane]: 0 to L/2 (symmetric film), or -L/2 to L/2.
    face : PivotFace, optional
        Held part of the back; default as `model.pad.mesh.pivot_face` says.
    density : MeshDensity, optional

    Returns
    -------
    PadSolid
        The same object for the same arguments; pads of one geometry share their finite elements.

    Raises
    ------
    ModelError
        The film grid does not span the pad, or the pivot face does not fit on it.
    """
    return solid_of(PadGeometry.of(pad, bearing, face), film_theta, film_z, density)


def solid_of(
    geometry: PadGeometry, film_theta: ArrayLike, film_z: ArrayLike, density: MeshDensity | None = None
) -> PadSolid:
    """`pad_solid` for a geometry at hand.

    Parameters
    ----------
    geometry : PadGeometry
    film_theta : (n_theta,) array_like
        [rad from the pivot]
    film_z : (n_z,) array_like
        [m from the mid-plane]
    density : MeshDensity, optional

    Returns
    -------
    PadSolid

    Raises
    ------
    ModelError
        The film grid does not span the pad.
    """
    theta, z = np.asarray(film_theta, dtype=float), np.asarray(film_z, dtype=float)
    _check_span(theta, (geometry.leading, geometry.trailing), "film_theta", "rad")
    if z.ndim == 1 and z.size and abs(z[0]) < 1e-6 * geometry.length:
        _check_span(z, (0.0, 0.5 * geometry.length), "film_z", "m")
    else:
        _check_span(z, (-0.5 * geometry.length, 0.5 * geometry.length), "film_z", "m")
    return _solid(geometry, density or MeshDensity(), theta.tobytes(), z.tobytes())


@lru_cache(maxsize=8)  # a dense matrix of a usual film grid has 3 MB, and there are four
def _solid(geometry: PadGeometry, density: MeshDensity, theta_bytes: bytes, z_bytes: bytes) -> PadSolid:
    theta, z = (np.frombuffer(raw, dtype=float) for raw in (theta_bytes, z_bytes))
    half = 0.5 * geometry.length
    full = bool(z[0] < -1e-6 * geometry.length)
    along = Line(_snap(theta, geometry.leading, geometry.trailing), 1)
    across = Line(_snap(z, -half if full else 0.0, half), 1)
    parts = []
    for even in (True, False) if full else (True,):
        solid = pad_operators(geometry, density, even)
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
