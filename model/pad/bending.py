"""Pads that bend: the solid's deformation follows the film's pressure and temperature.

A thin film is softer than its pad: followed one step behind, the deformation overshoots and swings for ever. The few
shapes in which a pad gives way most therefore take part in the Newton step: with h = ... + sum_m c_m phi_m and the
pad's answer c = B p, the film's derivatives by c, (a, b) close the loop pad by pad, and leave an effective force and
stiffness for the journal. What remains, and what heat does, contracts by itself. A pad that tilts along the shaft
(`model.statics.axial_tilt`) has one shape more, which the film's moment finds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.bearing import Bearing, Pad
from model.film.mesh import FilmGrid
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
    from model.pad.operators import pad_operators, pad_operators_between
    from model.pad.solid import solid_of

    angle, z, area = (np.frombuffer(raw, dtype=float) for raw in (angles, zs, areas))
    ahead = 0
    if angle[0] - geometry.leading > 1e-9:  # a starved film: the dry arc ahead of it carries nothing
        ahead = _DRY_STATIONS
        angle = np.concatenate([np.linspace(geometry.leading, angle[0], ahead + 1)[:-1], angle])
    solid = solid_of(geometry, angle, z, operators=pad_operators_between if cooled else pad_operators)
    wet = slice(ahead * len(z), None)
    compliance = np.ascontiguousarray(solid.compliance[wet, wet])
    to_coarse, expansion, flux = solid.thermal_factors
    shapes = _softest_shapes(compliance, area)
    amplitudes = (shapes * area[:, None]).T
    angle = angle[ahead:]
    inner = np.zeros((len(angle), len(z)), dtype=bool)
    inner[1:-1, 0 if abs(z[0]) < 1e-9 * z[-1] else 1 : -1] = True
    unknown = inner.ravel()
    return PadDeformation(
        compliance=compliance,
        to_coarse=np.ascontiguousarray(to_coarse[:, wet]),
        expansion=np.ascontiguousarray(expansion[wet]),
        flux=np.ascontiguousarray(flux[wet]),
        shapes=shapes.reshape(-1, len(z), SHAPES),
        amplitudes=amplitudes,
        response=np.ascontiguousarray((amplitudes @ compliance)[:, unknown]),
    )


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
