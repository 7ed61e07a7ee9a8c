"""A pad's response to single films, field by field: what tests and pictures ask of `model.pad.solid`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from model.bearing import Bearing, Pad
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, PivotFace, SectorMesh, sector_mesh
from model.pad.operators import conduct
from model.pad.solid import PadSolid, solid_of
from rigdata.arrays import FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class PadResponse(PadSolid):
    """Fields on the film grid have shape (n_theta, n_z); temperatures are rises above the oil supply [K]."""

    def bend(self, pressure: ArrayLike) -> FloatArray:
        """Deformation by film pressure, bilinear between film nodes."""
        given = self._on_grid(pressure)
        out = np.zeros(given.shape)
        for solid, to in self._parts:
            force = self.geometry.inner_radius * (to.theta.gather @ given @ to.z.gather.T)
            moved = (solid.compliance @ force.ravel()).reshape(force.shape)
            out += to.theta.project @ moved @ to.z.project.T
        return out

    def expand(self, rise: ArrayLike) -> FloatArray:
        """Thermal deformation for a film temperature rise, conduction through the pad included."""
        return self._thermal(self._on_grid(rise), "expansion")

    def heat_flow(self, rise: ArrayLike) -> FloatArray:
        """Heat flux density from film into pad [W/m^2], shape (n_theta, n_z), for a film temperature rise [K]."""
        return self._thermal(self._on_grid(rise), "flux")

    @cached_property
    def film_mass(self) -> FloatArray:
        """Area weights of the film grid [m^2], (n_film, n_film): integrals of products of its bilinear functions.

        ``film_mass @ compliance`` is symmetric and positive semidefinite.
        """
        theta, z = (Line(nodes, 1).matrix(0, 0) for nodes in (self.film_theta, self.film_z))
        return np.asarray(self.geometry.inner_radius * np.kron(theta, z))

    def pad_temperature(self, rise: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Temperature of the pad's mid-plane."""
        mesh, field_ = self._conducted(rise)
        return mesh.theta.nodes, mesh.r.nodes, field_[:, :, 0]

    def back_temperature(self, rise: ArrayLike) -> FloatArray:
        """Temperature rise on the pad's back over the film nodes [K], shape (n_theta, n_z)."""
        (_, to), *_ = self._parts
        return np.asarray(to.theta.project @ self._conducted(rise)[1][:, -1] @ to.z.project.T)

    def _conducted(self, rise: ArrayLike) -> tuple[SectorMesh, FloatArray]:
        """Mesh of the pad, and the temperature rise at its nodes under one that is even in z."""
        (_, to), *_ = self._parts
        coarse = to.coarse_theta @ self._on_grid(rise) @ to.coarse_z.T
        mesh = sector_mesh(self.geometry, self.density)
        along, across = (Line(line.breaks, 1).tabulate(line.nodes) for line in (mesh.theta, mesh.z))
        face = np.asarray(along @ coarse @ across.T).reshape(-1, 1)
        return mesh, conduct(mesh, self.geometry.back_convection, face)[0][..., 0]

    def _on_grid(self, values: ArrayLike) -> FloatArray:
        return np.asarray(values, dtype=float).reshape(self.film_theta.size, self.film_z.size)

    def _thermal(self, rise: FloatArray, name: str) -> FloatArray:
        out = np.zeros(rise.shape)
        for solid, to in self._parts:
            coarse = to.coarse_theta @ rise @ to.coarse_z.T
            answer = (getattr(solid, name) @ coarse.ravel()).reshape(solid.theta.n_nodes, solid.z.n_nodes)
            out += to.theta.project @ answer @ to.z.project.T
        return out


def pad_solid(
    pad: Pad,
    bearing: Bearing,
    film_theta: ArrayLike,
    film_z: ArrayLike,
    face: PivotFace | None = None,
    density: MeshDensity | None = None,
) -> PadResponse:
    """Solid of a pad for a film grid."""
    return _response(solid_of(PadGeometry.of(pad, bearing, face), film_theta, film_z, density))


@lru_cache(maxsize=16)
def _response(solid: PadSolid) -> PadResponse:
    return PadResponse(**{f.name: getattr(solid, f.name) for f in fields(PadSolid)})
