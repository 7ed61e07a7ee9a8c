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
from model.pad.mesh import FINE, MeshDensity, PadGeometry
from rigdata.arrays import FloatArray

#: Stations on the dry arc ahead of a film that starts late.
_DRY_STATIONS = 8
#: Shapes that take part in the Newton step: with 8 it takes two iterations more, with 16 none less.
SHAPES = 12


@dataclass(frozen=True, eq=False)
class PadDeformation:
    """How a pad's face moves outward under its film; n = (nt + 1)(nz + 1) film nodes, raveled.

    The solid has some 37 lines of nodes along the arc where the film has 81: what it answers is kept between its own
    lines and the film's columns across, column by column, a quarter of the matrix on the film's nodes.
    """

    compliance: FloatArray  #: (n, n): Deformation by pressure [m/Pa].
    gather: FloatArray  #: (a, nt - 1): Loads of the solid's lines by the film's unknown pressures along the arc.
    corners: FloatArray  #: (b, nt + 1): Temperatures of the lines between its elements by the film's.
    spread: FloatArray  #: (nt + 1, a): Deformation of the film's nodes by that of the lines.
    #: ((nz + 1) a, nz a + (nz + 1) b): Deformation of the lines by their loads with an unknown pressure [m/Pa], and
    #: by their temperatures [m/K].
    answer: FloatArray
    to_coarse: FloatArray  #: (c, n): Temperatures of the pad's coarser nodes by those of the film.
    flux: FloatArray  #: (n, c): Heat flux density into the pad by them [W/m^2/K].
    shapes: FloatArray  #: (nt + 1, nz + 1, m): In which the pad gives way most.
    amplitudes: FloatArray  #: (m, n): Amplitudes of the shapes in a deformation.
    response: FloatArray  #: (m, unknowns): Amplitudes by the pressure at the film's unknown nodes.


def pad_deformation(
    pad: Pad, bearing: Bearing, grid: FilmGrid, cooled: bool = False, density: MeshDensity = FINE
) -> PadDeformation:
    """Matrices of a pad for its film's mesh; the same object for pads of the same shape."""
    geometry = PadGeometry.of(pad, bearing)
    return _pad_deformation(geometry, grid.angle.tobytes(), grid.z.tobytes(), grid.area.tobytes(), cooled, density)


@lru_cache(maxsize=16)
def _pad_deformation(
    geometry: PadGeometry, angles: bytes, zs: bytes, areas: bytes, cooled: bool, density: MeshDensity
) -> PadDeformation:
    # rigid pads need no solid, and need not wait for its algebra
    from model.pad.operators import pad_operators

    angle, z, area = (np.frombuffer(raw) for raw in (angles, zs, areas))
    ahead = 0
    if angle[0] - geometry.leading > 1e-9:  # a starved film: the dry arc ahead of it carries nothing
        ahead = _DRY_STATIONS
        angle = np.concatenate([np.linspace(geometry.leading, angle[0], ahead + 1)[:-1], angle])
    half = z[0] == 0.0
    first = 0 if half else 1
    compliance, by_load, by_heat, coarser, flux = np.zeros(()), np.zeros(()), np.zeros(()), [], []
    for even in (True,) if half else (True, False):
        solid = pad_operators(geometry, density, even, cooled)
        gather, spread, corners = axis_maps(solid.theta, Line(angle, 1), None)
        gather, spread, corners = gather[:, ahead:], spread[ahead:], corners[:, ahead:]
        across = axis_maps(solid.z, Line(z, 1), None if half else even)
        project, loads = np.kron(spread, across[1]), geometry.inner_radius * solid.compliance
        compliance = compliance + project @ (loads @ np.kron(gather, across[0]))
        by_load = by_load + _between_lines(across[1], loads, across[0])
        by_heat = by_heat + _between_lines(across[1], solid.expansion, across[2])
        coarser.append(np.kron(corners, across[2]))
        flux.append(project @ solid.flux)
    # the leading eigenshapes of the compliance, orthonormal by area, by subspace iteration
    root = np.sqrt(area)[:, None]
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((len(area), SHAPES + 4)))[0]
    for _ in range(4):
        basis = np.linalg.qr(root * (compliance @ (basis / root)))[0]
    shapes = basis[:, :SHAPES] / root
    amplitudes = np.ascontiguousarray((shapes * area[:, None]).T)  # a search is compiled for one order of it
    return PadDeformation(
        compliance=compliance,
        gather=gather[:, 1:-1],
        corners=corners,
        spread=spread,
        answer=np.hstack([by_load[:, first * len(gather) : -len(gather)], by_heat]),
        to_coarse=np.vstack(coarser),
        flux=np.hstack(flux),
        shapes=shapes.reshape(-1, len(z), SHAPES),
        amplitudes=amplitudes,
        response=(amplitudes @ compliance).reshape(SHAPES, -1, len(z))[:, 1:-1, first:-1].reshape(SHAPES, -1),
    )


def _between_lines(out: FloatArray, matrix: FloatArray, gather: FloatArray) -> FloatArray:
    """A matrix on the solid's face as one between its lines along the arc, of the film's columns, column by column."""
    face = matrix.reshape(-1, out.shape[1], matrix.shape[1] // len(gather), len(gather))
    return np.einsum("xs,asbt,ty->xayb", out, face, gather, optimize=True).reshape(len(out) * len(face), -1)


def axis_maps(face: Line, film: Line, even: bool | None) -> tuple[Any, Any, Any]:
    """Gather, project and coarse of one axis: (face, film), (film, face), (corners, film).

    The film's pressure is bilinear on its grid, the pad's displacement quadratic on its elements. Loads are integrals
    of one against the basis of the other; the displacement at film nodes is the bilinear function closest to that of
    the elements in the mean square (L2 projection), and the temperature of the elements' corners that closest to the
    film's. Both use the same integrals G = int psi phi, so with M = int phi phi the compliance C on film nodes obeys
    M C = G^T S G: work done by the film is work taken up by the pad, to rounding. On a face all are products of those
    along and across.

    `even` is None for two bases on the same interval, else the part of a film on -L/2..L/2, the pad on 0 <= z <= L/2.
    """
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


def force_weights(grid: FilmGrid) -> FloatArray:
    """Radial and tangential force by the pressure at the unknown nodes, (2, unknowns) [m^2]."""
    return np.stack([(c[1:-1, None] * grid.area[1:-1, grid.first : -1]).ravel() for c in (grid.cos, grid.sin)])
