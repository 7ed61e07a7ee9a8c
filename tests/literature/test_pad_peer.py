"""The pad's finite elements against another program's, on the same mesh.

scikit-fem 12.0.2 (2026), isoparametric 27-node hexahedra (MeshHex2, ElementHex2) in Cartesian coordinates, Cartesian
displacement components, its own quadrature, loads and solver; element corners, layers, held nodes and symmetry plane
as here. The two discretisations differ in the shape of their functions on curved elements only. The values below were
computed once for this test; nothing of this package went into them but the breaks of the mesh.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.pad.mesh import MeshDensity, PadGeometry, sector_mesh
from model.pad.operators import ElasticSector

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
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
