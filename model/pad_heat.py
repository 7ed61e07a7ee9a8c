"""Steady heat conduction in a pad, Eq. (6) of the paper: film temperature on the film face, oil on all others.

The film face takes the film's temperature (the film is adiabatic towards it in the baseline, so it has one); every
other face loses heat to oil at the supply temperature through the film coefficient `back_convection`. All
temperatures are rises above supply.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.block_cholesky import BlockCholesky
from model.pad_mesh import SectorMesh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeatSolution:
    """What a unit temperature rise at each node of the film face does to the half pad.

    Attributes
    ----------
    temperature : (n_theta, n_r, n_z, n_surface) ndarray
        Temperature rise at the nodes [K/K].
    heat : (n_surface, n_surface) ndarray
        Heat that enters the pad at the nodes of the film face, weighted by their basis functions [W/K].
    """

    temperature: Array
    heat: Array


def conduct(mesh: SectorMesh, convection: float, even: bool = True) -> HeatSolution:
    """Solve the conduction problem for all nodes of the film face at once.

    Parameters
    ----------
    mesh : SectorMesh
    convection : float
        Film coefficient on the free faces [W/m^2/K]; zero makes them adiabatic.
    even : bool
        Whether the film temperature is even in z, or odd (then it is zero on the mid-plane).

    Returns
    -------
    HeatSolution
    """
    theta, n_r, n_z = mesh.theta, mesh.r.n_nodes, mesh.z.n_nodes
    blocks = _conduction_blocks(mesh, convection)
    face = np.zeros((n_r, n_z), dtype=bool)
    face[0] = True
    given = face.copy()
    if not even:
        given[:, 0] = True
    given, face = given.ravel(), face.ravel()
    coupling = np.zeros((theta.n_nodes, n_r * n_z, theta.n_nodes, n_z))
    at_face = np.zeros((theta.n_nodes, n_z, theta.n_nodes, n_z))
    inner = {}
    for (i, j), block in blocks.items():
        coupling[i, :, j] += block[:, face]
        at_face[i, :, j] += block[np.ix_(face, face)]
        if i != j:  # blocks of K are symmetric in pairs: block (j, i) is the transposed of block (i, j)
            coupling[j, :, i] += block[face].T
            at_face[j, :, i] += block[np.ix_(face, face)].T
        inner[i, j] = np.where(given[:, None] | given[None, :], 0.0, block)
        if i == j:
            inner[i, j] += np.diag(given.astype(float))
    n_surface = theta.n_nodes * n_z
    coupling = coupling.reshape(theta.n_nodes, n_r * n_z, n_surface)
    rhs = -coupling
    rhs[:, given] = 0.0
    field = BlockCholesky.factor(theta.n_nodes, inner).solve(rhs)
    heat = at_face.reshape(n_surface, n_surface) + np.tensordot(coupling, field, ((0, 1), (0, 1)))
    field = field.reshape(theta.n_nodes, n_r, n_z, n_surface)
    slab, along = np.meshgrid(np.arange(theta.n_nodes), np.arange(n_z), indexing="ij")
    field[slab, 0, along, slab * n_z + along] = 1.0
    if not even:
        field[:, :, 0] = 0.0
        odd = np.tile(np.arange(n_z) == 0, theta.n_nodes)
        field[..., odd] = 0.0
        heat[odd] = heat[:, odd] = 0.0
    return HeatSolution(field, heat)


def _conduction_blocks(mesh: SectorMesh, convection: float) -> dict[tuple[int, int], Array]:
    """Lower blocks, slab by slab, of conduction plus convection; each (n_r * n_z, n_r * n_z) [W/K]."""
    r, theta, z = mesh.r, mesh.theta, mesh.z
    radius = r.gauss[0]
    conductivity = mesh.per_gauss_point([m.conductivity for m in mesh.layers])
    back = np.zeros((r.n_nodes, r.n_nodes))
    back[-1, -1] = convection * r.breaks[-1]
    end = np.zeros((z.n_nodes, z.n_nodes))
    end[-1, -1] = convection
    section = np.kron(r.matrix(1, 1, conductivity * radius) + back, z.matrix(0, 0))
    section += np.kron(r.matrix(0, 0, conductivity * radius), z.matrix(1, 1))
    section += np.kron(r.matrix(0, 0, radius), end)
    along = np.kron(r.matrix(0, 0, conductivity / radius), z.matrix(0, 0))
    edge = convection * np.kron(r.matrix(0, 0), z.matrix(0, 0))
    values, slopes = theta.matrix(0, 0), theta.matrix(1, 1)
    blocks = {}
    last = theta.n_nodes - 1
    for i in range(theta.n_nodes):
        for j in range(max(0, i - theta.degree), i + 1):
            if values[i, j] or slopes[i, j]:
                blocks[i, j] = values[i, j] * section + slopes[i, j] * along
                if i == j and i in (0, last):
                    blocks[i, j] += edge
    return blocks
