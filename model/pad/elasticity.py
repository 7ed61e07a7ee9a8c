"""Linear thermoelasticity of a sector of an annulus, Eq. (7)-(8) of the paper, by tensor-product elements.

In cylindrical components (u_r, u_theta, u_z) the strains are

    e_rr = u_r,r                       g_rt = u_r,theta / r + u_theta,r - u_theta / r
    e_tt = u_r / r + u_theta,theta / r    g_tz = u_theta,z + u_z,theta / r
    e_zz = u_z,z                       g_rz = u_r,z + u_z,r

Every term is a product of a function of r, one of theta and one of z. So is, with material layers in r only, every
contribution to the stiffness matrix: K = sum over (a, b) of Theta_ab x M_ab, where Theta_ab (one of four) integrates
values or derivatives along the arc and M_ab is a matrix of the cross-section. The slabs along the arc make K a narrow
band of dense blocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from model.arrays import BoolArray, FloatArray
from model.pad.block_cholesky import BlockRow, factor_rows, forward_rows
from model.pad.mesh import SectorMesh


@dataclass(frozen=True)
class _Term:
    """sign * r^-inverse_r * d^r/dr d^theta/dtheta d^z/dz of one displacement component."""

    component: int
    inverse_r: int = 0
    r: int = 0
    theta: int = 0
    z: int = 0
    sign: float = 1.0


_U, _V, _W = range(3)
_NORMAL = (
    (_Term(_U, r=1),),
    (_Term(_U, inverse_r=1), _Term(_V, inverse_r=1, theta=1)),
    (_Term(_W, z=1),),
)
_SHEAR = (
    (_Term(_U, inverse_r=1, theta=1), _Term(_V, r=1), _Term(_V, inverse_r=1, sign=-1.0)),
    (_Term(_V, z=1), _Term(_W, inverse_r=1, theta=1)),
    (_Term(_U, z=1), _Term(_W, r=1)),
)


@dataclass(frozen=True, eq=False)
class ElasticSector:
    """Half a pad held at some of its degrees of freedom.

    Degrees of freedom are numbered slab by slab along the arc; inside a slab by component, r, z: an array of them has
    shape (n_theta, 3, n_r, n_z).
    """

    mesh: SectorMesh
    fixed: BoolArray

    @classmethod
    def held_at(cls, mesh: SectorMesh, nodes: BoolArray, even: bool = True) -> ElasticSector:
        """Hold some nodes, and make the mid-plane one of symmetry."""
        fixed = np.repeat(nodes[:, None], 3, axis=1)
        for component in (_W,) if even else (_U, _V):
            fixed[:, component, :, 0] = True
        return cls(mesh, fixed)

    def stiffness_rows(self) -> Iterator[BlockRow]:
        """Block rows of the lower triangle of K, slab by slab, for `model.pad.block_cholesky.factor_rows`.

        Fixed rows and columns are replaced by those of the unit matrix.
        """
        theta = self.mesh.theta
        sections = self._sections()
        section, arcs = np.stack(list(sections.values())), np.stack([theta.matrix(*key) for key in sections])
        free = ~self.fixed.reshape(theta.n_nodes, -1)
        for i in range(theta.n_nodes):
            row = {}
            for j in range(max(0, i - theta.degree), i + 1):
                weights = arcs[:, i, j]
                if weights.any():
                    block = np.tensordot(weights, section, 1)
                    block[~free[i]] = 0.0
                    block[:, ~free[j]] = 0.0
                    row[j] = block
            row[i][np.diag_indices_from(row[i])] += ~free[i]
            yield row

    def _sections(self) -> dict[tuple[int, int], FloatArray]:
        """M_ab: for derivative orders a, b along the arc, the cross-section's matrix, shape (m, m)."""
        mesh = self.mesh
        n_r, n_z = mesh.r.n_nodes, mesh.z.n_nodes
        lame, shear = self._lame()
        out = {(a, b): np.zeros((3, n_r * n_z, 3, n_r * n_z)) for a in (0, 1) for b in (0, 1)}
        pairs = [
            (a, b, lame + (2.0 * shear if i == j else 0.0))
            for i, left in enumerate(_NORMAL)
            for j, right in enumerate(_NORMAL)
            for a in left
            for b in right
        ]
        pairs += [(a, b, shear) for strain in _SHEAR for a in strain for b in strain]
        radius = mesh.r.gauss[0]
        for a, b, modulus in pairs:
            weight = a.sign * b.sign * modulus * radius ** (1 - a.inverse_r - b.inverse_r)
            across = mesh.r.matrix(a.r, b.r, weight)
            out[a.theta, b.theta][a.component, :, b.component, :] += np.kron(across, mesh.z.matrix(a.z, b.z))
        size = 3 * n_r * n_z
        return {key: value.reshape(size, size) for key, value in out.items()}

    def _lame(self) -> tuple[FloatArray, FloatArray]:
        """Lame's lambda and mu at the Gauss points across the thickness [Pa]."""
        layers = self.mesh.layers
        shear = [m.youngs_modulus / (2.0 * (1.0 + m.poissons_ratio)) for m in layers]
        lame = [2.0 * g * m.poissons_ratio / (1.0 - 2.0 * m.poissons_ratio) for g, m in zip(shear, layers)]
        return self.mesh.per_gauss_point(lame), self.mesh.per_gauss_point(shear)

    def thermal_loads(self, temperature: FloatArray) -> Iterator[FloatArray]:
        """Forces of hindered thermal expansion, the right-hand side of Eq. (7) in weak form, slab by slab."""
        mesh = self.mesh
        n_theta, n_r, n_z, n_columns = temperature.shape
        lame, shear = self._lame()
        stress = (3.0 * lame + 2.0 * shear) * mesh.per_gauss_point([m.thermal_expansion for m in mesh.layers])
        terms = [t for strain in _NORMAL for t in strain]
        along = [mesh.theta.matrix(t.theta, 0) for t in terms]
        across = [mesh.r.matrix(t.r, 0, stress * mesh.r.gauss[0] ** (1 - t.inverse_r)) for t in terms]
        for i in range(n_theta):
            near = slice(max(0, i - mesh.theta.degree), i + mesh.theta.degree + 1)
            out = np.zeros((3, n_r, n_z, n_columns))
            for term, by_theta, by_r in zip(terms, along, across, strict=True):
                load = np.tensordot(by_theta[i, near], temperature[near], 1)  # (r, z, columns)
                load = np.tensordot(by_r, load, 1)
                out[term.component] += np.tensordot(load, mesh.z.matrix(term.z, 0), (1, 1)).transpose(0, 2, 1)
            out[self.fixed[i]] = 0.0
            yield out.reshape(3 * n_r * n_z, n_columns)

    def surface_response(self, temperature: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial displacement of the film face under nodal forces and temperatures.

        With K = L L^T, E the unit radial forces on the film face and F the thermal loads, both results are products
        of L^-1 E and L^-1 F, summed slab by slab: the compliance is symmetric and positive semidefinite by build.
        """
        n_fields, n_surface = temperature.shape[3], self.mesh.n_surface
        compliance = np.zeros((n_surface, n_surface))
        expansion = np.zeros((n_surface, n_fields))
        rhs = self._surface_loads(self.thermal_loads(temperature), n_fields)
        for block in forward_rows(factor_rows(self.stiffness_rows()), rhs):
            unit = block[:, n_fields:]
            width = unit.shape[1]
            compliance[:width, :width] += unit.T @ unit
            expansion[:width] += unit.T @ block[:, :n_fields]
        return compliance, expansion

    def _surface_loads(self, thermal: Iterable[FloatArray], n_fields: int) -> Iterator[FloatArray]:
        """Thermal loads, then unit forces on the film nodes of this slab and of those before it."""
        n_r, n_z = self.mesh.r.n_nodes, self.mesh.z.n_nodes
        for i, load in enumerate(thermal):
            rhs = np.zeros((3, n_r, n_z, n_fields + (i + 1) * n_z))
            rhs[_U, 0, :, -n_z:] = np.eye(n_z)
            rhs[self.fixed[i]] = 0.0
            flat = rhs.reshape(3 * n_r * n_z, -1)
            flat[:, :n_fields] = load
            yield flat
