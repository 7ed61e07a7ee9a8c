"""What the finite elements of a pad boil down to: small matrices on the nodes of its film face, made once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.arrays import FloatArray
from model.pad.elasticity import ElasticSector
from model.pad.heat import conduct
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, sector_mesh
from model.pad.store import load_arrays, save_arrays, storage_key


@dataclass(frozen=True, eq=False)
class PadOperators:
    """Response of half a pad, for loads and temperatures even (or odd) in z.

    Two sets of basis functions live on the film face: the elements' own (`theta` x `z`, quadratic), for forces and
    displacements, and the bilinear ones on the same breaks, for temperatures, which are smoother.

    Attributes
    ----------
    theta, z : Line
        Elements of the face along the arc [rad] and along the half length [m].
    radius : (n_r,) ndarray
        Radii of the nodes across the thickness [m].
    compliance : (n_surface, n_surface) ndarray
        Outward displacement per outward nodal force [m/N].
    expansion : (n_surface, n_temperatures) ndarray
        Outward displacement per temperature rise of the face's bilinear nodes [m/K].
    flux : (n_surface, n_temperatures) ndarray
        Heat flux density from film into pad per temperature rise [W/m^2/K].
    section : (n_theta * n_r, n_temperatures) ndarray
        Temperature rise at the nodes of the mid-plane z = 0 per temperature rise [K/K].
    back : (n_theta * n_z, n_temperatures) ndarray
        The same on the back.
    """

    theta: Line
    z: Line
    radius: FloatArray
    compliance: FloatArray
    expansion: FloatArray
    flux: FloatArray
    section: FloatArray
    back: FloatArray

    @property
    def coarse(self) -> tuple[Line, Line]:
        """Bilinear elements for temperatures, along the arc and along the half length."""
        return Line(self.theta.breaks, 1), Line(self.z.breaks, 1)


_RESULTS = ("compliance", "expansion", "flux", "section", "back")


@lru_cache(maxsize=12)  # 4 MB each
def pad_operators(geometry: PadGeometry, density: MeshDensity, even: bool) -> PadOperators:
    """Operators of one pad geometry: from memory, from the cache folder, or by solving (a few seconds).

    Parameters
    ----------
    geometry : PadGeometry
    density : MeshDensity
    even : bool
        Symmetry in z of loads and temperatures.
    """
    mesh = sector_mesh(geometry, density)
    shapes = _shapes(mesh.theta, mesh.z, mesh.r.n_nodes)
    key = storage_key((geometry, density, even))
    arrays = load_arrays(key, shapes)
    if arrays is None:
        arrays = _solve(geometry, density, even)
        save_arrays(key, arrays)
    for array in arrays.values():
        array.setflags(write=False)
    return PadOperators(theta=mesh.theta, z=mesh.z, radius=mesh.r.nodes, **arrays)


def _shapes(theta: Line, z: Line, n_r: int) -> dict[str, tuple[int, int]]:
    n_surface = theta.n_nodes * z.n_nodes
    n_temperatures = theta.breaks.size * z.breaks.size
    rows = (n_surface, n_surface, n_surface, theta.n_nodes * n_r, n_surface)
    return {name: (count, n_surface if name == "compliance" else n_temperatures) for name, count in zip(_RESULTS, rows)}


def _solve(geometry: PadGeometry, density: MeshDensity, even: bool) -> dict[str, FloatArray]:
    """Solve conduction, then thermoelasticity; see `PadOperators` for the results."""
    mesh = sector_mesh(geometry, density)
    theta, z = mesh.theta, mesh.z
    spread = np.asarray(np.kron(Line(theta.breaks, 1).tabulate(theta.nodes), Line(z.breaks, 1).tabulate(z.nodes)))
    solution = conduct(mesh, geometry.back_convection, spread, even)
    field = solution.temperature
    heat = solution.heat.reshape(theta.n_nodes, z.n_nodes, -1)
    flux = np.linalg.solve(theta.matrix(0, 0), heat.reshape(theta.n_nodes, -1)).reshape(heat.shape)
    flux = np.linalg.solve(z.matrix(0, 0), flux) / geometry.inner_radius
    body = ElasticSector.held_at(mesh, mesh.held(geometry.face), even)
    compliance, expansion = body.surface_response(field)
    n_temperatures = field.shape[3]
    return {
        "compliance": compliance,
        "expansion": expansion,
        "flux": flux.reshape(-1, n_temperatures),
        "section": field[:, :, 0].reshape(-1, n_temperatures),
        "back": field[:, -1].reshape(-1, n_temperatures),
    }
