"""A pad's response to single films, field by field: what tests ask of `model.pad`."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from model.bearing import Bearing, Pad
from model.pad.bending import axis_maps
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, PivotFace, SectorMesh, sector_mesh
from model.pad.operators import PadOperators, conduct, pad_operators
from rigdata.arrays import FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class PadResponse:
    """Fields on the film grid have shape (n_theta, n_z); temperatures are rises above the oil supply [K]."""

    geometry: PadGeometry
    density: MeshDensity
    film_theta: FloatArray
    film_z: FloatArray

    @cached_property
    def _parts(self) -> list[tuple[PadOperators, tuple[FloatArray, FloatArray, FloatArray]]]:
        """Operators, and gather, project and coarse, for loads even in z and, of a full film, odd."""
        full = self.film_z[0] < 0.0
        film = Line(self.film_theta, 1), Line(self.film_z, 1)
        parts = []
        for even in (True, False) if full else (True,):
            solid = pad_operators(self.geometry, self.density, even)
            along, across = axis_maps(solid.theta, film[0], None), axis_maps(solid.z, film[1], even if full else None)
            parts.append((solid, tuple(np.kron(*pair) for pair in zip(along, across, strict=True))))
        return parts

    @cached_property
    def compliance(self) -> FloatArray:
        """Deformation per film pressure [m/Pa], (n_film, n_film)."""
        return self.geometry.inner_radius * sum(to[1] @ (solid.compliance @ to[0]) for solid, to in self._parts)

    def bend(self, pressure: ArrayLike) -> FloatArray:
        """Deformation by film pressure, bilinear between film nodes."""
        given = np.asarray(pressure, dtype=float)
        return np.asarray((self.compliance @ given.ravel()).reshape(given.shape))

    def expand(self, rise: ArrayLike) -> FloatArray:
        """Thermal deformation for a film temperature rise, conduction through the pad included."""
        return self._thermal(np.asarray(rise, dtype=float), "expansion")

    def heat_flow(self, rise: ArrayLike) -> FloatArray:
        """Heat flux density from film into pad [W/m^2], shape (n_theta, n_z), for a film temperature rise [K]."""
        return self._thermal(np.asarray(rise, dtype=float), "flux")

    @cached_property
    def film_mass(self) -> FloatArray:
        """Area weights of the film grid [m^2], (n_film, n_film): integrals of products of its bilinear functions.

        ``film_mass @ compliance`` is symmetric and positive semidefinite.
        """
        theta, z = (Line(nodes, 1).matrix(0, 0) for nodes in (self.film_theta, self.film_z))
        return np.asarray(self.geometry.inner_radius * np.kron(theta, z))

    def pad_temperature(self, rise: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Temperature of the pad's mid-plane."""
        mesh, field_ = self._conducted(np.asarray(rise, dtype=float))
        return mesh.theta.nodes, mesh.r.nodes, field_[:, :, 0]

    def back_temperature(self, rise: ArrayLike) -> FloatArray:
        """Temperature rise on the pad's back over the film nodes [K], shape (n_theta, n_z)."""
        given = np.asarray(rise, dtype=float)
        return (self._parts[0][1][1] @ self._conducted(given)[1][:, -1].ravel()).reshape(given.shape)

    def _conducted(self, rise: FloatArray) -> tuple[SectorMesh, FloatArray]:
        """Mesh of the pad, and the temperature rise at its nodes under one that is even in z."""
        coarse = self._parts[0][1][2] @ rise.ravel()
        mesh = sector_mesh(self.geometry, self.density)
        along, across = (Line(line.breaks, 1).tabulate(line.nodes) for line in (mesh.theta, mesh.z))
        return mesh, conduct(mesh, self.geometry.back_convection, (np.kron(along, across) @ coarse)[:, None])[0][..., 0]

    def _thermal(self, rise: FloatArray, name: str) -> FloatArray:
        out = sum(to[1] @ (getattr(solid, name) @ (to[2] @ rise.ravel())) for solid, to in self._parts)
        return np.asarray(out).reshape(rise.shape)


def pad_solid(
    pad: Pad,
    bearing: Bearing,
    film_theta: ArrayLike,
    film_z: ArrayLike,
    face: PivotFace | None = None,
    density: MeshDensity | None = None,
) -> PadResponse:
    """Solid of a pad for a film grid."""
    theta, z = np.asarray(film_theta, dtype=float), np.asarray(film_z, dtype=float)
    geometry = PadGeometry.of(pad, bearing)
    geometry = geometry if face is None else replace(geometry, face=face)
    return PadResponse(geometry, density or MeshDensity(), theta, z)
