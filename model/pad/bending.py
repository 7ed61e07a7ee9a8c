"""Pads that bend: the solid's deformation follows the film's pressure and temperature, Eq. (6)-(8) of the paper.

A thin film is softer than its pad: followed one step behind, the deformation overshoots and swings for ever. The few
shapes in which a pad gives way most therefore take part in the Newton step: with h = ... + sum_m c_m phi_m and the
pad's answer c = B p, the film's derivatives by c, (a, b) close the loop pad by pad, and leave an effective force and
stiffness for the journal. What remains, and what heat does, contracts by itself. A pad that tilts along the shaft
(`model.statics.pad_film.axial_shape`) has one shape more, which the film's moment finds.

All deformations are relative to the rigid pad held at its pivot face; tilt and pivot deflection are the equilibrium's
business. Positive is outward: the film grows thicker by it.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from model.bearing import Bearing, Pad
from model.film.mesh import FilmGrid
from model.pad.line import Line, gauss_rule
from model.pad.mesh import PadGeometry
from rigdata.arrays import FloatArray

#: Stations on the dry arc ahead of a film that starts late.
_DRY_STATIONS = 8
#: Shapes that take part in the Newton step: with 8 it takes two iterations more, with 16 none less.
SHAPES = 12


@dataclass(frozen=True, eq=False)
class PadDeformation:
    """How a pad's face moves outward under its film; n = (nt + 1)(nz + 1) film nodes, raveled."""

    compliance: FloatArray  #: (n, n): Deformation by pressure [m/Pa].
    to_coarse: FloatArray  #: (c, n): Temperatures of the pad's coarser nodes by those of the film.
    expansion: FloatArray  #: (n, c): Deformation by them [m/K].
    flux: FloatArray  #: (n, c): Heat flux density into the pad by them [W/m^2/K].
    shapes: FloatArray  #: (nt + 1, nz + 1, m): In which the pad gives way most.
    amplitudes: FloatArray  #: (m, n): Amplitudes of the shapes in a deformation.
    response: FloatArray  #: (m, unknowns): Amplitudes by the pressure at the film's unknown nodes.


def pad_deformation(pad: Pad, bearing: Bearing, grid: FilmGrid, cooled: bool = False) -> PadDeformation:
    """Matrices of a pad for its film's mesh; the same object for pads of the same shape."""
    geometry = PadGeometry.of(pad, bearing)
    return _pad_deformation(geometry, grid.angle.tobytes(), grid.z.tobytes(), grid.area.tobytes(), cooled)


@lru_cache(maxsize=16)
def _pad_deformation(geometry: PadGeometry, angles: bytes, zs: bytes, areas: bytes, cooled: bool) -> PadDeformation:
    # rigid pads need no solid, and need not wait for its algebra
    from model.pad.operators import pad_operators

    angle, z, area = (np.frombuffer(raw, dtype=float) for raw in (angles, zs, areas))
    inner = np.zeros((len(angle), len(z)), dtype=bool)
    inner[1:-1, 0 if z[0] == 0.0 else 1 : -1] = True
    ahead = 0
    if angle[0] - geometry.leading > 1e-9:  # a starved film: the dry arc ahead of it carries nothing
        ahead = _DRY_STATIONS
        angle = np.concatenate([np.linspace(geometry.leading, angle[0], ahead + 1)[:-1], angle])
    wet = slice(ahead * len(z), None)
    compliance = np.zeros((inner.size, inner.size))
    coarser, expansion, flux = [], [], []
    for even in (True,) if z[0] == 0.0 else (True, False):
        solid = pad_operators(geometry, even=even, cooled=cooled)
        film = Line(angle, 1), Line(z, 1)
        gather, project, coarse = film_maps((solid.theta, solid.z), film, None if z[0] == 0.0 else even)
        project = project[wet]
        compliance += geometry.inner_radius * (project @ (solid.compliance @ gather[:, wet]))
        coarser.append(coarse[:, wet])
        expansion.append(project @ solid.expansion)
        flux.append(project @ solid.flux)
    shapes = _softest_shapes(compliance, area)
    amplitudes = (shapes * area[:, None]).T
    return PadDeformation(
        compliance=compliance,
        to_coarse=np.vstack(coarser),
        expansion=np.hstack(expansion),
        flux=np.hstack(flux),
        shapes=shapes.reshape(-1, len(z), SHAPES),
        amplitudes=amplitudes,
        response=np.ascontiguousarray((amplitudes @ compliance)[:, inner.ravel()]),
    )


def film_maps(face: tuple[Line, Line], film: tuple[Line, Line], even: bool | None) -> tuple[Any, Any, Any]:
    """Gather, project and coarse on raveled fields: (face, film), (film, face), (coarse, film).

    The film's pressure is bilinear on its grid, the pad's displacement quadratic on its elements. Loads are integrals
    of one against the basis of the other; the displacement at film nodes is the bilinear function closest to that of
    the elements in the mean square (L2 projection), and the temperature of the elements' corners that closest to the
    film's. Both use the same integrals G = int psi phi, so with M = int phi phi the compliance C on film nodes obeys
    M C = G^T S G: work done by the film is work taken up by the pad, to rounding.

    `even` is None for a film on the half length, else the part of a full one.
    """
    along = _axis_maps(face[0], film[0], None)
    across = _axis_maps(face[1], film[1], even)
    gather, project, coarse = (np.kron(*pair) for pair in zip(along, across, strict=True))
    return gather, project, coarse


def _axis_maps(face: Line, film: Line, even: bool | None) -> tuple[Any, Any, Any]:
    """Maps of two bases on the same interval, or of one on 0 <= z <= L/2 and a film's even or odd part on -L/2..L/2."""
    merged = np.unique(np.concatenate((face.breaks, film.breaks if even is None else np.abs(film.breaks))))
    distinct = np.concatenate(([True], np.diff(merged) > 1e-12 * (merged[-1] - merged[0])))
    # exact for products of piecewise polynomials of both sets of breaks
    points, weights = gauss_rule(np.clip(merged[distinct], *face.breaks[[0, -1]]), face.degree + 1)
    values, halves = film.tabulate(points), 1.0
    if even is not None:
        values = 0.5 * (values + (1.0 if even else -1.0) * film.tabulate(-points))
        halves = 2.0
    weighted, corners = weights[:, None] * values, Line(face.breaks, 1)
    gather = face.tabulate(points).T @ weighted
    project = np.linalg.solve(film.matrix(0, 0), halves * gather.T)
    return gather, project, np.linalg.solve(corners.matrix(0, 0), corners.tabulate(points).T @ weighted)


def _softest_shapes(compliance: FloatArray, area: FloatArray) -> FloatArray:
    """Leading eigenshapes of the compliance, orthonormal by area, (n, SHAPES); by subspace iteration."""
    root = np.sqrt(area)
    start = np.random.default_rng(0).standard_normal((len(area), SHAPES + 4))
    basis = np.linalg.qr(start)[0]
    for _ in range(4):
        basis = np.linalg.qr(root[:, None] * (compliance @ (basis / root[:, None])))[0]
    return np.asarray(basis[:, :SHAPES] / root[:, None])


def force_weights(grid: FilmGrid) -> FloatArray:
    """Radial and tangential force by the pressure at the unknown nodes, (2, unknowns) [m^2]."""
    inner = grid.area[1:-1, grid.first : -1]
    return np.stack([(c[1:-1, None] * inner).ravel() for c in (grid.cos, grid.sin)])
