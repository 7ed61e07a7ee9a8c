"""Steady heat conduction in a pad, Eq. (6) of the paper: film temperature on the film face, oil on all others.

The film face takes the film's temperature (the film is adiabatic towards it in the baseline, so it has one); every
other face loses heat to oil at the supply temperature through the film coefficient `back_convection`. All
temperatures are rises above supply.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from model.arrays import FloatArray
from model.pad.block_cholesky import BlockCholesky, BlockRow
from model.pad.mesh import SectorMesh


@dataclass(frozen=True, eq=False)
class HeatSolution:
    """What temperatures of the film face do to the half pad."""

    temperature: FloatArray
    heat: FloatArray


def conduct(mesh: SectorMesh, convection: float, face: FloatArray, even: bool = True) -> HeatSolution:
    """Solve the conduction problem for many temperature fields of the film face at once."""
    theta, n_r, n_z = mesh.theta, mesh.r.n_nodes, mesh.z.n_nodes
    given = np.arange(n_r * n_z) < n_z
    prescribed = face.reshape(theta.n_nodes, n_z, -1).copy()
    if not even:
        given[::n_z] = True
        prescribed[:, 0] = 0.0
    known = np.zeros((theta.n_nodes, n_r * n_z, prescribed.shape[2]))
    known[:, :n_z] = prescribed
    load = np.zeros_like(known)  # K times the prescribed temperatures
    to_film: list[BlockRow] = []  # rows of K at the film face
    rows: list[BlockRow] = []
    for i, row in enumerate(_conduction_rows(mesh, convection)):
        to_film.append({j: block[:n_z].copy() for j, block in row.items()})
        for j, block in row.items():
            load[i] += block[:, :n_z] @ prescribed[j]
            if j != i:  # blocks are symmetric: (j, i) is (i, j)
                load[j] += block[:, :n_z] @ prescribed[i]
            block[given] = block[:, given] = 0.0
        row[i][given, given] = 1.0
        rows.append(row)
    rhs = -load
    rhs[:, given] = 0.0
    field = BlockCholesky.factor(rows).solve(rhs) + known
    heat = np.zeros_like(prescribed)
    for i, row in enumerate(to_film):
        for j, block in row.items():
            heat[i] += block @ field[j]
            if j != i:
                heat[j] += block @ field[i]
    if not even:
        heat[:, 0] = 0.0
    return HeatSolution(field.reshape(theta.n_nodes, n_r, n_z, -1), heat.reshape(mesh.n_surface, -1))


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
