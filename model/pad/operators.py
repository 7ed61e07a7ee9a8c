"""What the finite elements of a pad boil down to: small matrices on the nodes of its film face, made once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from model.arrays import FloatArray
from model.pad.elasticity import ElasticSector
from model.pad.heat import conduct
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, SectorMesh, sector_mesh
from model.pad.store import load_arrays, save_arrays, storage_key


@dataclass(frozen=True, eq=False)
class PadOperators:
    """Response of half a pad, for loads and temperatures even (or odd) in z.

    Two sets of basis functions live on the film face: the elements' own (`theta` x `z`, quadratic), for forces and
    displacements, and the bilinear ones on the same breaks, for temperatures, which are smoother.
    """

    theta: Line
    z: Line
    compliance: FloatArray
    expansion: FloatArray
    flux: FloatArray

    @property
    def coarse(self) -> tuple[Line, Line]:
        """Bilinear elements for temperatures, along the arc and along the half length."""
        return Line(self.theta.breaks, 1), Line(self.z.breaks, 1)


@lru_cache(maxsize=12)  # 4 MB each
def pad_operators(geometry: PadGeometry, density: MeshDensity, even: bool) -> PadOperators:
    """Operators of one pad geometry: from memory, from the cache folder, or by solving (a few seconds)."""
    return operators_at(geometry, density, even, (geometry.back_convection,))[0]


def operators_at(
    geometry: PadGeometry, density: MeshDensity, even: bool, convections: tuple[float, ...]
) -> tuple[PadOperators, ...]:
    """Operators of one pad geometry at several convections of its free faces, with one solution of its elasticity."""
    mesh = sector_mesh(geometry, density)
    shapes = _shapes(mesh.theta, mesh.z, len(convections))
    key = storage_key((replace(geometry, back_convection=0.0), density, even, convections))
    arrays = load_arrays(key, shapes)
    if arrays is None:
        arrays = _solve(geometry, density, even, convections)
        save_arrays(key, arrays)
    for array in arrays.values():
        array.setflags(write=False)
    compliance = arrays.pop("compliance")
    return tuple(
        PadOperators(mesh.theta, mesh.z, compliance, **{name: array[k] for name, array in arrays.items()})
        for k in range(len(convections))
    )


def _shapes(theta: Line, z: Line, count: int) -> dict[str, tuple[int, ...]]:
    n_surface = theta.n_nodes * z.n_nodes
    n_temperatures = theta.breaks.size * z.breaks.size
    each = (count, n_surface, n_temperatures)
    return {"compliance": (n_surface, n_surface), "expansion": each, "flux": each}


def _solve(
    geometry: PadGeometry, density: MeshDensity, even: bool, convections: tuple[float, ...]
) -> dict[str, FloatArray]:
    """Solve conduction, then thermoelasticity; see `PadOperators` for the results."""
    mesh = sector_mesh(geometry, density)
    theta, z = mesh.theta, mesh.z
    spread = np.asarray(np.kron(Line(theta.breaks, 1).tabulate(theta.nodes), Line(z.breaks, 1).tabulate(z.nodes)))
    n_temperatures = spread.shape[1]
    shape = (theta.n_nodes, mesh.r.n_nodes, z.n_nodes, len(convections), n_temperatures)
    field, flux = np.empty(shape), np.empty((len(convections), mesh.n_surface, n_temperatures))
    for k, convection in enumerate(convections):
        solution = conduct(mesh, convection, spread, even)
        field[:, :, :, k] = solution.temperature
        flux[k] = _flux(mesh, solution.heat) / geometry.inner_radius
    body = ElasticSector.held_at(mesh, mesh.held(geometry.face), even)
    compliance, expansion = body.surface_response(field.reshape(*shape[:3], -1))
    return {
        "compliance": compliance,
        "expansion": np.stack(np.split(expansion, len(convections), axis=1)),
        "flux": flux,
    }


def _flux(mesh: SectorMesh, heat: FloatArray) -> FloatArray:
    """Heat flux density at the nodes of the film face, per radian of the arc, of heat that enters there."""
    theta, z = mesh.theta, mesh.z
    by_arc = heat.reshape(theta.n_nodes, z.n_nodes, -1)
    flux = np.linalg.solve(theta.matrix(0, 0), by_arc.reshape(theta.n_nodes, -1)).reshape(by_arc.shape)
    return np.asarray(np.linalg.solve(z.matrix(0, 0), flux).reshape(mesh.n_surface, -1))
