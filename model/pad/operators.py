"""What the finite elements of a pad boil down to: small matrices on the nodes of its film face, made once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from model.interpolation import lagrange
from model.pad.block_cholesky import SlabMatrix, factor, forward, solve
from model.pad.line import Line
from model.pad.mesh import COARSE, FINE, MeshDensity, PadGeometry, SectorMesh, sector_mesh
from model.pad.store import load_arrays, save_arrays, storage_key
from rigdata.arrays import BoolArray, FloatArray

#: Eight nodes: expansion to 2e-6, heat into the pad to 3e-4 (`tests/model/test_pad_solid.py`).
_NODES = 8
#: Largest convection between the nodes [W/m^2/K]; above it a pad is solved for its own.
LARGEST = 1e4


class _Term(NamedTuple):
    """sign * r^-inverse_r * d^r/dr d^theta/dtheta d^z/dz of one displacement component."""

    component: int
    inverse_r: int = 0
    r: int = 0
    theta: int = 0
    z: int = 0
    sign: float = 1.0


_U, _V, _W = range(3)
_NORMAL: tuple[tuple[_Term, ...], ...] = (
    (_Term(_U, r=1),),
    (_Term(_U, inverse_r=1), _Term(_V, inverse_r=1, theta=1)),
    (_Term(_W, z=1),),
)
_VOLUME = _NORMAL[0] + _NORMAL[1] + _NORMAL[2]
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
    integrates values or derivatives along the arc and M_ab is a matrix of the cross-section.
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

    def stiffness(self) -> SlabMatrix:
        """K: of derivative orders (a, b) along the arc the matrices Theta_ab and M_ab."""
        mesh, radius = self.mesh, self.mesh.r.gauss[0]
        size = mesh.r.n_nodes * mesh.z.n_nodes
        sections = np.zeros((2, 2, 3, size, 3, size))
        lame, shear = self._lame()
        strains = (_VOLUME, *_NORMAL, *_SHEAR)
        for strain, modulus in zip(strains, (lame, *[2.0 * shear] * 3, *[shear] * 3), strict=True):
            for a, b in product(strain, strain):
                weight = a.sign * b.sign * modulus * radius ** (1 - a.inverse_r - b.inverse_r)
                across = np.kron(mesh.r.matrix(a.r, b.r, weight), mesh.z.matrix(a.z, b.z))
                sections[a.theta, b.theta, a.component, :, b.component] += across
        arcs = np.array([mesh.theta.matrix(*orders) for orders in product((0, 1), (0, 1))])
        fixed = self.fixed.reshape(len(self.fixed), -1)
        return SlabMatrix(arcs, sections.reshape(4, 3 * size, -1), fixed, mesh.theta.degree)

    def _lame(self) -> tuple[FloatArray, FloatArray]:
        """Lame's lambda and mu at the Gauss points across the thickness [Pa]."""
        modulus, ratio = self.mesh.at_gauss_points("youngs_modulus"), self.mesh.at_gauss_points("poissons_ratio")
        shear = modulus / (2.0 * (1.0 + ratio))
        return 2.0 * shear * ratio / (1.0 - 2.0 * ratio), shear

    def thermal_loads(self, temperature: FloatArray, elements: Iterable[slice]) -> Iterator[FloatArray]:
        """Forces of hindered thermal expansion, the right-hand side of Eq. (7) in weak form, element by element.

        `temperature` (n_theta, n_r, n_z, n_columns) [K].
        """
        mesh = self.mesh
        lame, shear = self._lame()
        stress = (3.0 * lame + 2.0 * shear) * mesh.at_gauss_points("thermal_expansion")
        axes = []
        for t in _VOLUME:
            across = mesh.r.matrix(t.r, 0, stress * mesh.r.gauss[0] ** (1 - t.inverse_r))
            axes.append((mesh.theta.matrix(t.theta, 0), across, mesh.z.matrix(t.z, 0)))
        for slabs in elements:
            near = slice(max(0, slabs.start - 1), slabs.stop + mesh.theta.degree)
            out = np.zeros((*self.fixed[slabs].shape, temperature.shape[-1]))
            for term, (along, across, end) in zip(_VOLUME, axes, strict=True):
                load = np.tensordot(along[slabs, near], temperature[near], 1)
                out[:, term.component] += np.einsum("ar,bz,trzc->tabc", across, end, load, optimize=True)
            out[self.fixed[slabs]] = 0.0
            yield out.reshape(self.fixed[slabs].size, -1)

    def surface_response(self, temperature: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial displacement of the film face under nodal forces and temperatures.

        With K = L L^T, E the unit radial forces on the film face and F the thermal loads, both results are products
        of L^-1 E and L^-1 F, summed element by element: the compliance is symmetric and positive semidefinite by
        build.

        `temperature` (n_theta, n_r, n_z, n_columns) [K]; gives compliance (n_surface, n_surface) [m/N], expansion
        (n_surface, n_columns) [m].
        """
        n_fields, n_surface = temperature.shape[3], self.mesh.n_surface
        compliance = np.zeros((n_surface, n_surface))
        expansion = np.zeros((n_surface, n_fields))
        stiffness = self.stiffness()
        thermal = self.thermal_loads(temperature, stiffness.elements)
        for block in forward(factor(stiffness), self._surface_loads(thermal, stiffness.elements)):
            unit = block[:, n_fields:]
            width = unit.shape[1]
            compliance[:width, :width] += unit.T @ unit
            expansion[:width] += unit.T @ block[:, :n_fields]
        return compliance, expansion

    def _surface_loads(self, thermal: Iterable[FloatArray], elements: Iterable[slice]) -> Iterator[FloatArray]:
        """Thermal loads, then unit forces on the film nodes of this element and of those before it."""
        n_z = self.mesh.z.n_nodes
        for slabs, load in zip(elements, thermal, strict=True):
            loads = np.zeros((len(load), load.shape[1] + slabs.stop * n_z), order="F")
            loads[:, : load.shape[1]] = load
            nodes = np.arange(len(load)).reshape(self.fixed[slabs].shape)[:, _U, 0].ravel()
            loads[nodes, np.arange(-len(nodes), 0)] = ~self.fixed[slabs][:, _U, 0].ravel()
            yield loads


def conduct(mesh: SectorMesh, convection: float, face: FloatArray, even: bool = True) -> tuple[FloatArray, FloatArray]:
    """Solve the conduction problem for many temperature fields of the film face at once.

    The film face takes the film's temperature (the film is adiabatic towards it in the baseline, so it has one); every
    other face loses heat to oil at the supply temperature through the film coefficient `back_convection`. All
    temperatures are rises above supply.

    `face` (n_surface, n_columns) [K]; gives the temperature rise at the nodes (n_theta, n_r, n_z, n_columns) [K], and
    the heat that enters at the nodes of the film face, weighted by their basis functions, (n_surface, n_columns) [W].
    """
    conduction = _conduction(mesh, convection, even)
    n_theta, n_z = mesh.theta.n_nodes, mesh.z.n_nodes
    prescribed = face.reshape(n_theta, n_z, -1).copy()
    if not even:
        prescribed[:, 0] = 0.0
    arcs, sections = conduction.arcs, conduction.sections
    load = np.einsum("kij,kab,jbc->iac", arcs, sections[:, :, :n_z], prescribed, optimize=True)
    load[conduction.held] = 0.0
    field = solve(conduction, -load)
    field[:, :n_z] = prescribed
    heat = np.einsum("kij,kab,jbc->iac", arcs, sections[:, :n_z], field, optimize=True)
    if not even:
        heat[:, 0] = 0.0
    return field.reshape(n_theta, mesh.r.n_nodes, n_z, -1), heat.reshape(mesh.n_surface, -1)


def _conduction(mesh: SectorMesh, convection: float, even: bool) -> SlabMatrix:
    """Conduction and convection [W/K], the film face held, and of odd fields the mid-plane."""
    r, theta, z = mesh.r, mesh.theta, mesh.z
    radius, conductivity = r.gauss[0], mesh.at_gauss_points("conductivity")
    back = np.zeros((r.n_nodes, r.n_nodes))
    back[-1, -1] = convection * r.breaks[-1]
    end = np.zeros((z.n_nodes, z.n_nodes))
    end[-1, -1] = convection
    section = np.kron(r.matrix(1, 1, conductivity * radius) + back, z.matrix(0, 0))
    section += np.kron(r.matrix(0, 0, conductivity * radius), z.matrix(1, 1))
    section += np.kron(r.matrix(0, 0, radius), end)
    along = np.kron(r.matrix(0, 0, conductivity / radius), z.matrix(0, 0))
    edge = convection * np.kron(r.matrix(0, 0), z.matrix(0, 0))
    edges = np.zeros((theta.n_nodes, theta.n_nodes))
    edges[[0, -1], [0, -1]] = 1.0
    held = np.zeros((theta.n_nodes, r.n_nodes, z.n_nodes), dtype=bool)
    held[:, 0] = True
    held[:, :, 0] |= not even
    arcs = np.array([theta.matrix(0, 0), theta.matrix(1, 1), edges])
    return SlabMatrix(arcs, np.array([section, along, edge]), held.reshape(theta.n_nodes, -1), theta.degree)


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
    geometry: PadGeometry, density: MeshDensity = FINE, even: bool = True, cooled: bool = False
) -> PadOperators:
    """Operators of one pad geometry: from memory, from the cache folder, or by solving (a few seconds).

    `cooled`: interpolated between a few convections, so that the first time costs more and every other nothing.
    """
    between = cooled and geometry.back_convection <= LARGEST
    convections, weights = _between(geometry) if between else ((geometry.back_convection,), np.ones(1))
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
    return tuple((through * nodes / (1.0 - nodes)).tolist()), lagrange(nodes, x)


@lru_cache(maxsize=6)  # 13 MB each at most
def operators_at(
    geometry: PadGeometry, density: MeshDensity, even: bool, convections: tuple[float, ...]
) -> PadOperators:
    """Operators at several convections of the free faces, the first axis of `expansion` and `flux`."""
    mesh = sector_mesh(geometry, density)
    # coarse ones are sooner solved, and many
    key = "" if density == COARSE else storage_key((geometry, density, even, convections))
    arrays = load_arrays(key, ("compliance", "expansion", "flux")) if key else None
    if arrays is None:
        arrays = _solve(geometry, mesh, even, convections)
        if key:
            save_arrays(key, arrays)
    arrays["compliance"].setflags(write=False)
    return PadOperators(mesh.theta, mesh.z, **arrays)


def _solve(
    geometry: PadGeometry, mesh: SectorMesh, even: bool, convections: tuple[float, ...]
) -> dict[str, FloatArray]:
    """Solve conduction, then thermoelasticity; see `PadOperators` for the results."""
    theta, z = mesh.theta, mesh.z
    spread = np.asarray(np.kron(Line(theta.breaks, 1).tabulate(theta.nodes), Line(z.breaks, 1).tabulate(z.nodes)))
    area = geometry.inner_radius * np.kron(theta.matrix(0, 0), z.matrix(0, 0))
    shape = (theta.n_nodes, mesh.r.n_nodes, z.n_nodes, len(convections), spread.shape[1])
    field, flux = np.empty(shape), np.empty((len(convections), *spread.shape))
    for k, convection in enumerate(convections):
        field[:, :, :, k], heat = conduct(mesh, convection, spread, even)
        flux[k] = np.linalg.solve(area, heat)
    body = ElasticSector.held_at(mesh, mesh.held(geometry.face), even)
    compliance, expansion = body.surface_response(field.reshape(*shape[:3], -1))
    by_convection = np.stack(np.split(expansion, len(convections), axis=1))
    return {"compliance": compliance, "expansion": by_convection, "flux": flux}
