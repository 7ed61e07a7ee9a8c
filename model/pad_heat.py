"""Steady heat conduction in a pad, Eq. (6) of the paper: film temperature on the film face, oil on all others.

The film face takes the film's temperature (the film is adiabatic towards it in the baseline, so it has one); every
other face loses heat to oil at the supply temperature through the film coefficient `back_convection`. All
temperatures are rises above supply.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.block_cholesky import BlockCholesky, BlockRow
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
    on_face = np.arange(n_r * n_z) < n_z
    given = on_face.copy()
    if not even:
        given[::n_z] = True
    coupling = np.zeros((theta.n_nodes, n_r * n_z, theta.n_nodes, n_z))
    rows: list[BlockRow] = []
    for i, row in enumerate(_conduction_rows(mesh, convection)):
        for j, block in row.items():
            coupling[i, :, j] = block[:, on_face]
            coupling[j, :, i] = block[on_face].T
            block[given] = block[:, given] = 0.0
        row[i][given, given] = 1.0
        rows.append(row)
    n_surface = theta.n_nodes * n_z
    to_face: Array = coupling.reshape(theta.n_nodes, n_r * n_z, n_surface)
    rhs = -to_face
    rhs[:, given] = 0.0
    field = BlockCholesky.factor(rows).solve(rhs)
    field[:, :n_z] = np.eye(n_surface).reshape(theta.n_nodes, n_z, n_surface)
    field = field.reshape(theta.n_nodes, n_r, n_z, n_surface)
    if not even:  # an odd temperature vanishes on the mid-plane: those columns answer to nothing
        field[:, :, 0] = 0.0
        field[..., ::n_z] = 0.0
        to_face[..., ::n_z] = 0.0
    heat: Array = np.tensordot(to_face, field.reshape(to_face.shape), ((0, 1), (0, 1)))
    return HeatSolution(field, heat)


def _conduction_rows(mesh: SectorMesh, convection: float) -> Iterator[BlockRow]:
    """Block rows of the lower triangle of conduction plus convection [W/K], slab by slab."""
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
    for i in range(theta.n_nodes):
        row = {
            j: values[i, j] * section + slopes[i, j] * along
            for j in range(max(0, i - theta.degree), i + 1)
            if values[i, j] or slopes[i, j]
        }
        if i in (0, theta.n_nodes - 1):
            row[i] += edge
        yield row
