"""What the finite elements of a pad boil down to: small matrices on the nodes of its film face, made once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from model.pad.block_cholesky import BlockRow, factor_rows, forward_rows, solve_rows
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, SectorMesh, sector_mesh
from model.pad.store import load_arrays, save_arrays, storage_key
from rigdata.arrays import BoolArray, FloatArray

#: Eight nodes: expansion to 2e-6, heat into the pad to 3e-4 (`tests/model/test_convection.py`).
_NODES = 8
_DENSITY = MeshDensity()
#: Largest convection between the nodes [W/m^2/K]; above it a pad is solved for its own.
LARGEST = 1e4


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

    In cylindrical components (u_r, u_theta, u_z) the strains are

        e_rr = u_r,r                       g_rt = u_r,theta / r + u_theta,r - u_theta / r
        e_tt = u_r / r + u_theta,theta / r    g_tz = u_theta,z + u_z,theta / r
        e_zz = u_z,z                       g_rz = u_r,z + u_z,r

    Every term is a product of a function of r, one of theta and one of z. So is, with material layers in r only,
    every contribution to the stiffness matrix: K = sum over (a, b) of Theta_ab x M_ab, where Theta_ab (one of four)
    integrates values or derivatives along the arc and M_ab is a matrix of the cross-section. The slabs along the
    arc make K a narrow band of dense blocks.
    """

    mesh: SectorMesh
    fixed: BoolArray  #: (n_theta, 3, n_r, n_z) of bool: Degrees of freedom whose displacement is zero.

    @classmethod
    def held_at(cls, mesh: SectorMesh, nodes: BoolArray, even: bool = True) -> ElasticSector:
        """Hold some nodes, and make the mid-plane one of symmetry: `nodes` (n_theta, n_r, n_z)."""
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
        section = np.stack(list(sections.values()))
        arcs = np.stack([theta.matrix(*key) for key in sections])
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
        out = {orders: np.zeros((3, n_r * n_z, 3, n_r * n_z)) for orders in product((0, 1), (0, 1))}
        pairs = []
        for strain_i, strain_j in product(_NORMAL, _NORMAL):
            modulus = lame + 2.0 * shear if strain_i is strain_j else lame
            pairs += [(a, b, modulus) for a, b in product(strain_i, strain_j)]
        for strain in _SHEAR:
            pairs += [(a, b, shear) for a, b in product(strain, strain)]
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
        """Forces of hindered thermal expansion, the right-hand side of Eq. (7) in weak form, slab by slab.

        `temperature` (n_theta, n_r, n_z, n_columns) [K].
        """
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

        `temperature` (n_theta, n_r, n_z, n_columns) [K]; gives compliance (n_surface, n_surface) [m/N], expansion
        (n_surface, n_columns) [m].
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


def conduct(mesh: SectorMesh, convection: float, face: FloatArray, even: bool = True) -> tuple[FloatArray, FloatArray]:
    """Solve the conduction problem for many temperature fields of the film face at once.

    The film face takes the film's temperature (the film is adiabatic towards it in the baseline, so it has one); every
    other face loses heat to oil at the supply temperature through the film coefficient `back_convection`. All
    temperatures are rises above supply.

    `face` (n_surface, n_columns) [K]; gives the temperature rise at the nodes (n_theta, n_r, n_z, n_columns) [K], and
    the heat that enters at the nodes of the film face, weighted by their basis functions, (n_surface, n_columns) [W].
    """
    theta, n_r, n_z = mesh.theta, mesh.r.n_nodes, mesh.z.n_nodes
    at_face = np.arange(n_r * n_z) < n_z
    prescribed = face.reshape(theta.n_nodes, n_z, -1).copy()
    if not even:
        at_face[::n_z] = True
        prescribed[:, 0] = 0.0
    face_field = np.zeros((theta.n_nodes, n_r * n_z, prescribed.shape[2]))
    face_field[:, :n_z] = prescribed
    load = np.zeros_like(face_field)  # K times the prescribed temperatures
    to_film: list[BlockRow] = []  # rows of K at the film face
    rows: list[BlockRow] = []
    for i, row in enumerate(_conduction_rows(mesh, convection)):
        to_film.append({j: block[:n_z].copy() for j, block in row.items()})
        for j, block in row.items():
            load[i] += block[:, :n_z] @ prescribed[j]
            if j != i:  # blocks are symmetric: (j, i) is (i, j)
                load[j] += block[:, :n_z] @ prescribed[i]
            block[at_face] = block[:, at_face] = 0.0
        row[i][at_face, at_face] = 1.0
        rows.append(row)
    rhs = -load
    rhs[:, at_face] = 0.0
    field = solve_rows(rows, rhs) + face_field
    heat = np.zeros_like(prescribed)
    for i, row in enumerate(to_film):
        for j, block in row.items():
            heat[i] += block @ field[j]
            if j != i:
                heat[j] += block @ field[i]
    if not even:
        heat[:, 0] = 0.0
    return field.reshape(theta.n_nodes, n_r, n_z, -1), heat.reshape(mesh.n_surface, -1)


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


@dataclass(frozen=True, eq=False)
class PadOperators:
    """Response of half a pad, for loads and temperatures even (or odd) in z.

    Two sets of basis functions live on the film face: the elements' own (`theta` x `z`, quadratic), for forces and
    displacements, and the bilinear ones on the same breaks, for temperatures, which are smoother.
    """

    theta: Line
    z: Line
    compliance: FloatArray  #: (n_surface, n_surface): Outward displacement per outward nodal force [m/N].
    #: (n_surface, n_temperatures): Outward displacement per temperature rise of the face's bilinear nodes [m/K].
    expansion: FloatArray
    #: (n_surface, n_temperatures): Heat flux density from film into pad per temperature rise [W/m^2/K].
    flux: FloatArray


def pad_operators(
    geometry: PadGeometry, density: MeshDensity = _DENSITY, even: bool = True, cooled: bool = False
) -> PadOperators:
    """Operators of one pad geometry: from memory, from the cache folder, or by solving (a few seconds).

    `cooled`: interpolated between a few convections, so that the first time costs more and every other nothing.
    """
    convections: tuple[float, ...] = (geometry.back_convection,)
    weights = np.ones(1)
    if cooled and geometry.back_convection <= LARGEST:
        convections, weights = _between(geometry)
    at = operators_at(replace(geometry, back_convection=0.0), density, even, convections)
    return replace(at, expansion=np.tensordot(weights, at.expansion, 1), flux=np.tensordot(weights, at.flux, 1))


def _between(geometry: PadGeometry) -> tuple[tuple[float, ...], FloatArray]:
    """Convections at which a pad is solved, and their shares in its answer at its own (Lagrange).

    Conduction with convection h is (K + h M) T = 0 about a given film face, so that every temperature in the pad is
    a sum of c_i h / (h_i + h). The smallest h_i is about the conductivity over the thickness, h_0: in x = h / (h +
    h_0) the sum is smooth up to x = 1, where the faces are as cold as the oil, and a polynomial through a few x
    follows it.
    """
    through = geometry.backing.conductivity / geometry.backing_thickness
    last = LARGEST / (LARGEST + through)
    nodes = 0.5 * last * (1.0 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1)))
    x = geometry.back_convection / (geometry.back_convection + through)
    weights = np.empty(_NODES)
    for k, node in enumerate(nodes):
        others = np.delete(nodes, k)
        weights[k] = np.prod((x - others) / (node - others))
    return tuple((through * nodes / (1.0 - nodes)).tolist()), weights


@lru_cache(maxsize=6)  # 13 MB each at most
def operators_at(
    geometry: PadGeometry, density: MeshDensity, even: bool, convections: tuple[float, ...]
) -> PadOperators:
    """Operators at several convections of the free faces, the first axis of `expansion` and `flux`."""
    mesh = sector_mesh(geometry, density)
    corners = mesh.theta.breaks.size * mesh.z.breaks.size
    by_convection = (len(convections), mesh.n_surface, corners)
    shapes = {"compliance": (mesh.n_surface,) * 2, "expansion": by_convection, "flux": by_convection}
    key = storage_key((geometry, density, even, convections))
    arrays = load_arrays(key, shapes)
    if arrays is None:
        arrays = _solve(geometry, mesh, even, convections)
        save_arrays(key, arrays)
    arrays["compliance"].setflags(write=False)
    return PadOperators(mesh.theta, mesh.z, **arrays)


def _solve(
    geometry: PadGeometry, mesh: SectorMesh, even: bool, convections: tuple[float, ...]
) -> dict[str, FloatArray]:
    """Solve conduction, then thermoelasticity; see `PadOperators` for the results."""
    theta, z = mesh.theta, mesh.z
    spread = np.asarray(np.kron(Line(theta.breaks, 1).tabulate(theta.nodes), Line(z.breaks, 1).tabulate(z.nodes)))
    n_temperatures = spread.shape[1]
    shape = (theta.n_nodes, mesh.r.n_nodes, z.n_nodes, len(convections), n_temperatures)
    field = np.empty(shape)
    flux = np.empty((len(convections), mesh.n_surface, n_temperatures))
    for k, convection in enumerate(convections):
        field[:, :, :, k], heat = conduct(mesh, convection, spread, even)
        flux[k] = _flux(mesh, heat) / geometry.inner_radius
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
