"""The pad's finite elements against closed solutions, their own limit, and another finite-element program.

Closed: curved beam, bimetal, thick cylinder. The program: scikit-fem 12.0.2 (2026) on the same mesh, isoparametric
27-node hexahedra (MeshHex2, ElementHex2) in Cartesian coordinates, Cartesian displacement components, its own
quadrature, loads and solver; element corners, layers, held nodes and symmetry plane as here. The two discretisations
differ in the shape of their functions on curved elements only. Its values were computed once for this test; nothing of
this package went into them but the breaks of the mesh.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from model.bearing import BABBITT, STEEL, Bearing, Material
from model.bearing_file import load_bearing
from model.pad.block_cholesky import solve
from model.pad.line import Line
from model.pad.mesh import MeshDensity, PadGeometry, SectorMesh, sector_mesh
from model.pad.operators import ElasticSector
from tests.pad_responses import PadResponse, pad_solid

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
U_R, U_THETA, U_Z = range(3)


@pytest.fixture(autouse=True)
def _no_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TPJB_CACHE", "off")


def strip(
    radii: tuple[float, ...], arc: float, half_width: float, layers: tuple[Material, ...], n_theta: int = 16
) -> SectorMesh:
    """A curved strip from theta = 0 to `arc`, one element per layer and half width."""
    theta = Line(np.linspace(0.0, arc, n_theta + 1))
    return SectorMesh(Line(np.array(radii)), theta, Line(np.array([0.0, half_width])), layers)


def unfixed(mesh: SectorMesh) -> np.ndarray:
    fixed = np.zeros((mesh.theta.n_nodes, 3, mesh.r.n_nodes, mesh.z.n_nodes), dtype=bool)
    fixed[:, U_Z, :, 0] = True  # mid-plane
    return fixed


def pressure_response(body: ElasticSector, pressure: float) -> np.ndarray:
    """Radial displacement of the film face, (n_theta, n_z), under uniform pressure, by the production path."""
    mesh = body.mesh
    none = np.zeros((mesh.theta.n_nodes, mesh.r.n_nodes, mesh.z.n_nodes, 0))
    compliance, _ = body.surface_response(none)
    force = np.outer(mesh.theta.matrix(0, 0).sum(axis=1), mesh.z.matrix(0, 0).sum(axis=1))
    return (compliance @ (pressure * mesh.r.breaks[0] * force).ravel()).reshape(force.shape)


def thermal_field(body: ElasticSector, rise: float) -> np.ndarray:
    """Displacement of all nodes, (n_theta, 3, n_r, n_z), under a uniform temperature rise."""
    shape = body.fixed.shape
    stiffness, rises = body.stiffness(), np.full((shape[0], shape[2], shape[3], 1), rise)
    load = np.concatenate(list(body.thermal_loads(rises, stiffness.elements)))
    return solve(stiffness, load.reshape(*stiffness.held.shape, 1)).reshape(shape)


class TestCurvedCantilever:
    """Strip held at theta = 0, uniform pressure p on its inner face (Timoshenko, Strength of Materials II, art. 78).

    Castigliano with bending, stretching and shear about the centroid line, radius R, width b, thickness t, load per
    radian q = p b R_i:  M = q R (1 - cos s), N = q (1 - cos s), V = q sin s at angle s from the free end; the unit
    radial force there gives m = R sin s, n = sin s, v = cos s.
    """

    @staticmethod
    def by_beam_theory(radius: float, t: float, b: float, arc: float, pressure: float) -> float:
        e, g = STEEL.youngs_modulus, STEEL.youngs_modulus / 2.6
        q = pressure * b * (radius - 0.5 * t)
        area, inertia = b * t, b * t**3 / 12.0

        def work(s: float) -> float:
            bending = q * radius * (1 - math.cos(s)) * radius * math.sin(s) / (e * inertia)
            stretching = q * (1 - math.cos(s)) * math.sin(s) / (e * area)
            shearing = 1.2 * q * math.sin(s) * math.cos(s) / (g * area)
            return radius * (bending + stretching + shearing)

        return quad(work, 0.0, arc)[0]

    @pytest.mark.parametrize(("slenderness", "tolerance"), [(20, 0.01), (60, 0.005)])
    def test_tip_displacement(self, slenderness: int, tolerance: float) -> None:
        radius, arc, pressure = 0.1, math.radians(50.0), 1e5
        t = radius / slenderness
        b = 0.5 * t
        mesh = strip((radius - 0.5 * t, radius + 0.5 * t), arc, 0.5 * b, (STEEL,), 24)
        body = ElasticSector(mesh, unfixed(mesh))
        body.fixed[0, U_THETA] = True  # a beam's clamp: no warping hindered, no rotation
        body.fixed[0, U_R, mesh.r.n_nodes // 2, :] = True
        tip = pressure_response(body, pressure)[-1, 0]
        assert tip == pytest.approx(self.by_beam_theory(radius, t, b, arc, pressure), rel=tolerance)


class TestThickCylinder:
    """Sector of a long cylinder under inner pressure, u(r) by Lame in plane strain."""

    INNER, OUTER, PRESSURE = 0.05, 0.066, 1e7

    def error(self, n_r: int) -> float:
        mesh = SectorMesh(
            Line(np.linspace(self.INNER, self.OUTER, n_r + 1)),
            Line(np.linspace(0.0, 0.5, 2)),
            Line(np.array([0.0, 0.01])),
            (STEEL,) * n_r,
        )
        fixed = unfixed(mesh)
        fixed[[0, -1], U_THETA] = True
        fixed[:, U_Z, :, -1] = True
        got = pressure_response(ElasticSector(mesh, fixed), self.PRESSURE)
        assert np.ptp(got) < 1e-9 * got.max()
        return abs(got[0, 0] / self.lame() - 1.0)

    def lame(self) -> float:
        a2, b2, nu = self.INNER**2, self.OUTER**2, STEEL.poissons_ratio
        factor = (1.0 + nu) / STEEL.youngs_modulus * self.PRESSURE * a2 / (b2 - a2)
        return factor * ((1.0 - 2.0 * nu) * self.INNER + b2 / self.INNER)

    def test_one_element_is_close_and_the_order_is_four(self) -> None:
        """Displacement under its own load is an energy: order 2p = 4 for quadratic elements."""
        errors = [self.error(n) for n in (1, 2, 4)]
        assert errors[0] < 1e-3
        assert min(math.log2(errors[i] / errors[i + 1]) for i in range(2)) > 3.5, errors

    def test_hot_plain_cylinder_grows_like_a_free_one(self) -> None:
        """Free to slide along z: u_r = alpha T r exactly, whatever the mesh."""
        mesh = strip((self.INNER, 0.058, self.OUTER), 0.5, 0.01, (STEEL, STEEL), 2)
        fixed = unfixed(mesh)
        fixed[[0, -1], U_THETA] = True
        field = thermal_field(ElasticSector(mesh, fixed), 30.0)
        np.testing.assert_allclose(field[0, U_R, :, 0], STEEL.thermal_expansion * 30.0 * mesh.r.nodes, rtol=1e-9)
        np.testing.assert_allclose(field[:, U_Z, :, -1], STEEL.thermal_expansion * 30.0 * 0.01, rtol=1e-9)


class TestBimetal:
    """Free thermal bending of a two-layer strip (Timoshenko, J. Opt. Soc. Am. 11, 1925, 233-255, Eq. 4).

    1/rho = 6 (alpha_2 - alpha_1) T (1 + m)^2 / { h [3 (1 + m)^2 + (1 + m n)(m^2 + 1 / (m n))] },
    m = a_1 / a_2 (thicknesses), n = E_1 / E_2, h = a_1 + a_2.
    """

    @staticmethod
    def curvature(a1: float, one: Material, a2: float, two: Material, rise: float) -> float:
        m, n, h = a1 / a2, one.youngs_modulus / two.youngs_modulus, a1 + a2
        mismatch = (two.thermal_expansion - one.thermal_expansion) * rise
        return 6 * mismatch * (1 + m) ** 2 / (h * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))

    @pytest.mark.slow
    @pytest.mark.parametrize(("lining", "backing"), [(3e-3, 13e-3), (1e-3, 1e-3), (4e-3, 2e-3)])
    def test_curvature(self, lining: float, backing: float) -> None:
        """A nearly straight strip (R = 1e4 h); curvature from the middle half, free of end effects."""
        h, rise = lining + backing, 25.0
        radius = 1e4 * h
        arc = 20.0 * h / radius
        mesh = strip((radius, radius + lining, radius + h), arc, 0.1 * h, (BABBITT, STEEL), 40)
        fixed = unfixed(mesh)
        fixed[0, U_THETA] = True  # symmetry plane
        fixed[0, U_R, -1, :] = True
        u = thermal_field(ElasticSector(mesh, fixed), rise)[:, U_R, -1, 0]
        middle = (mesh.theta.nodes < 0.5 * arc) & (mesh.theta.nodes > 0.05 * arc)
        along = radius * mesh.theta.nodes[middle]
        got = 2.0 * np.polyfit(along, u[middle], 2)[0]
        # the babbitt, inside, expands more: the strip opens, its ends move outward
        assert got == pytest.approx(-self.curvature(lining, BABBITT, backing, STEEL, rise), rel=0.005)


def paper_pad(name: str, n_theta: int = 49, n_z: int = 9, **keywords: object) -> tuple[PadResponse, Bearing]:
    bearing = load_bearing(BEARINGS / f"{name}.toml")
    pad = bearing.pads[0]
    theta = pad.leading_edge + pad.arc * np.linspace(0.0, 1.0, n_theta)
    z = 0.5 * bearing.length * np.linspace(0.0, 1.0, n_z)
    return pad_solid(pad, bearing, theta, z, **keywords), bearing  # type: ignore[arg-type]


def loaded(solid: PadResponse, force: float) -> np.ndarray:
    """Pressure: half a sine along the arc, a parabola along z, of this resultant towards the pivot."""
    s = (solid.film_theta - solid.film_theta[0]) / np.ptp(solid.film_theta)
    z = solid.film_z / solid.film_z[-1]
    shape = np.sin(np.pi * s)[:, None] * (1.0 - z**2)
    arm = np.cos(solid.film_theta)[:, None] * np.ones(z.size)
    return force / (2.0 * arm.ravel() @ solid.film_mass @ shape.ravel()) * shape


# Radial displacement [um] at three angles (leading edge, a quarter of the arc, pivot) x four places along the half
# length (0, 1/2, 7/8, 1), on meshes that resolve the rim of the pivot face and the lining's free edges: for the
# spherical bearing 41 x 25 x 40 nodes (123,000 unknowns, cubic across and along z), for the rocker 55 x 16 x 22 nodes
# (cubic; too coarse at the lining's corners to serve for heat). They pin this code against its own limit.
FINEST = {
    ("rocker", "4.5 kN"): [
        [2.1803, 2.1023, 2.0044, 1.9827],
        [1.2603, 1.2390, 1.1857, 1.1514],
        [0.5347, 0.5850, 0.6964, 0.6754],
    ],
    ("spherical", "4.5 kN"): [
        [0.8901, 0.9967, 1.1695, 1.2376],
        [0.7597, 0.9662, 1.1719, 1.2306],
        [0.5819, 0.8927, 1.1499, 1.2103],
    ],
    ("spherical", "10 K"): [
        [-0.387, -0.137, 0.364, 0.883],
        [-2.525, -2.100, -1.414, -0.759],
        [-3.311, -2.689, -1.916, -1.241],
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_default_mesh_is_within_one_percent(name: str) -> None:
    solid, _ = paper_pad(name, 97, 33)
    got = {"4.5 kN": solid.bend(loaded(solid, 4500.0)), "10 K": solid.expand(np.full((97, 33), 10.0))}
    for case, field in got.items():
        if (name, case) in FINEST:
            finest = np.array(FINEST[name, case])
            difference = 1e6 * field[np.ix_([0, 24, 48], [0, 16, 28, 32])] - finest
            assert np.abs(difference).max() < 0.01 * np.abs(finest).max(), (case, difference)


DENSITY = MeshDensity(arc=8, face=1, half_length=4, backing=2, rim=0.1, edge=0.2)

# theta / half arc, z / half length, radial displacement [um] under 1 MPa sin(pi s) (1 - (2 z / L)^2), and under 10 K
PEER = np.array(
    [
        [-1.0, 0.0, 0.749729, 0.469009],
        [-1.0, 1.0, 0.674472, 2.452656],
        [0.0, 0.0, 0.184033, -2.924780],
        [0.0, 1.0, 0.215456, 0.215962],
        [1.0, 0.0, 0.749729, 0.469009],
        [1.0, 1.0, 0.674472, 2.452656],
    ]
)


def test_pressure_and_heat_on_the_rocker_pad() -> None:
    bearing = load_bearing(BEARINGS / "rocker.toml")
    geometry = PadGeometry.of(bearing.pads[0], bearing)
    mesh = sector_mesh(geometry, DENSITY)
    body = ElasticSector.held_at(mesh, mesh.held(geometry.face))
    shape = (mesh.theta.n_nodes, mesh.r.n_nodes, mesh.z.n_nodes)
    compliance, expansion = body.surface_response(np.full((*shape, 1), 10.0))
    (theta, along), (z, across) = mesh.theta.gauss, mesh.z.gauss
    arc = geometry.trailing - geometry.leading
    sine = mesh.theta.tabulate(theta).T @ (along * np.sin(math.pi * (theta - geometry.leading) / arc))
    parabola = mesh.z.tabulate(z).T @ (across * (1.0 - (2.0 * z / geometry.length) ** 2))
    bend = compliance @ (1e6 * geometry.inner_radius * np.outer(sine, parabola)).ravel()
    for theta_part, z_part, peer_bend, peer_grow in PEER:
        i = int(np.argmin(np.abs(mesh.theta.nodes - 0.5 * arc * theta_part)))
        node = i * mesh.z.n_nodes + (mesh.z.n_nodes - 1 if z_part else 0)
        assert 1e6 * bend[node] == pytest.approx(peer_bend, rel=0.002)
        assert 1e6 * expansion[node, 0] == pytest.approx(peer_grow, abs=0.01)  # of a range of 5.4 um
