"""The pad as a sector of an annulus, cut into hexahedra: where the layers, the pivot face and the elements lie."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from model.bearing import Bearing, BearingError, Material, Pad
from model.pad.line import Line, graded
from rigdata.arrays import BoolArray, FloatArray


class PivotFace(NamedTuple):
    """The part of the pad's back that is held (paper, Sec. 2: "null displacement ... corresponding to the pivot part").

    A rectangle centred on the pivot. Its size is a choice that the paper does not print; see `pivot_face`.
    """

    width: float
    length: float


def pivot_face(pad: Pad, bearing: Bearing) -> PivotFace:
    """Choose the face on which a pivot holds its pad.

    A contact without width would let the FE solution dent without bound (a point or line load on a solid), and
    that dent is in the pivot's own load-deflection law already (Hertz, Kirk and Reedy, or the dry test). So the
    face is as wide as the region whose squeeze belongs to the pivot law:

    - rocker, rigid: a strip `contact_length` long (the whole pad if the file gives none), half the bending
      thickness wide;
    - sphere: a square of the area of a disc whose diameter is the bending thickness.

    Both are cut down where the pad is too short for them.

    What the choice does, for the two bearings of the paper (4.5 kN; a film 5 K to 15 K above supply): a face half as
    wide leaves the shape of the bending as it is (edges less pivot: rocker 1.64 -> 1.78 um, sphere 0.31 -> 0.45 um)
    and adds to its mean (1.02 -> 1.27 um, 0.86 -> 1.21 um), which works like a softer pivot. A face twice as wide:
    1.22 um and 0.71 um, -0.08 um and 0.57 um. The thermal range (edges less pivot, 3.4 um and 2.9 um) goes to
    3.1 um and 2.5 um for half, 4.2 um and 3.6 um for twice the width.
    """
    thickness = pad.elastic_thickness
    back = bearing.journal_radius + pad.pad_clearance + thickness
    shorter_wing = min(-pad.leading_edge, pad.leading_edge + pad.arc)
    room = 1.6 * shorter_wing * back  # leaves a fifth of the shorter wing beside the face
    pivot = bearing.pivot_of(pad)
    if pivot.kind == "spherical":
        side = 0.5 * math.sqrt(math.pi) * thickness
        return PivotFace(width=min(side, room), length=min(side, bearing.length))
    contact = pivot.contact_length
    length = bearing.length if math.isnan(contact) else min(contact, bearing.length)
    return PivotFace(width=min(0.5 * thickness, room), length=length)


@dataclass(frozen=True)
class PadGeometry:
    """All that the finite elements of a pad depend on; equal geometries share one solution."""

    inner_radius: float
    backing_thickness: float
    babbitt_thickness: float
    leading: float
    trailing: float
    length: float
    face: PivotFace
    back_convection: float
    backing: Material
    babbitt: Material

    def __post_init__(self) -> None:
        half = 0.5 * self.face.width / self.outer_radius
        if not (self.leading < -half and half < self.trailing):
            raise BearingError(
                f"The pivot face ({math.degrees(2 * half):.1f} deg wide) does not fit on the pad, which spans "
                f"{math.degrees(self.leading):.1f} to {math.degrees(self.trailing):.1f} deg about its pivot. "
                "Give a narrower face, or a pivot_offset nearer 0.5."
            )

    @classmethod
    def of(cls, pad: Pad, bearing: Bearing) -> PadGeometry:
        """Geometry of one pad of a bearing.

        The inner radius, journal radius + Cp, is rounded to 0.1 mm: a fit that moves Cp by microns would
        otherwise ask for a new FE solution every time, for less than 0.1 % of the deformation.
        """
        return cls(
            inner_radius=round(bearing.journal_radius + pad.pad_clearance, 4),
            backing_thickness=pad.elastic_thickness - pad.babbitt_thickness,
            babbitt_thickness=pad.babbitt_thickness,
            leading=pad.leading_edge,
            trailing=pad.leading_edge + pad.arc,
            length=bearing.length,
            face=pivot_face(pad, bearing),
            back_convection=pad.back_convection,
            backing=pad.backing,
            babbitt=pad.babbitt,
        )

    @property
    def interface_radius(self) -> float:
        """Radius where babbitt ends and backing begins [m]."""
        return self.inner_radius + self.babbitt_thickness

    @property
    def outer_radius(self) -> float:
        """Radius of the back [m]."""
        return self.interface_radius + self.backing_thickness


@dataclass(frozen=True, eq=False)
class SectorMesh:
    """Tensor-product hexahedra of half a pad, 0 <= z <= length / 2."""

    r: Line
    theta: Line
    z: Line
    layers: tuple[Material, ...]  #: Materials of the elements across the thickness.

    def at_gauss_points(self, name: str) -> FloatArray:
        """A number of the layers' materials at the Gauss points of `r`; shape of ``r.gauss[0]``."""
        return np.repeat([getattr(material, name) for material in self.layers], self.r.degree + 2)

    @property
    def n_surface(self) -> int:
        """Nodes on the film face of the half pad."""
        return self.theta.n_nodes * self.z.n_nodes

    def held(self, face: PivotFace) -> BoolArray:
        """Nodes on the pivot face, (n_theta, n_r, n_z)."""
        slack = 1e-9
        angle = 0.5 * face.width / self.r.breaks[-1]
        in_arc = np.abs(self.theta.nodes) <= angle * (1 + slack)
        in_length = self.z.nodes <= 0.5 * face.length * (1 + slack)
        on_back = np.arange(self.r.n_nodes) == self.r.n_nodes - 1
        return in_arc[:, None, None] & on_back[None, :, None] & in_length[None, None, :]


@dataclass(frozen=True)
class MeshDensity:
    """How many elements, and how small at the places where the stress is singular.

    The default keeps the deformation within 1 % of the converged one (tests/literature/test_pad_analytic.py).
    """

    arc: int = 14
    face: int = 4
    half_length: int = 7
    backing: int = 5
    babbitt: int = 1
    rim: float = 0.035
    edge: float = 0.16


#: Half as fine takes a twentieth of the time: pads of the paper deform by 1 to 5 % less, K and C change by 0.1 %.
FINE, COARSE = MeshDensity(), MeshDensity(arc=8, face=2, half_length=4, backing=3)


def sector_mesh(geometry: PadGeometry, density: MeshDensity) -> SectorMesh:
    """Mesh half a pad.

    The stress is singular along the rim of the held face, and steep near the free edges, where the babbitt's larger
    expansion ends: elements are small there and grow in between.
    """
    outer, thickness = geometry.outer_radius, geometry.outer_radius - geometry.inner_radius
    rim, edge = density.rim * thickness, density.edge * thickness
    half = 0.5 * geometry.face.width / outer
    wings = -half - geometry.leading, geometry.trailing - half
    before, after = _share(density.arc, *wings)
    theta = _join(
        graded(geometry.leading, -half, before, edge / outer, rim / outer),
        graded(-half, half, density.face, rim / outer, rim / outer),
        graded(half, geometry.trailing, after, rim / outer, edge / outer),
    )
    under, end = 0.5 * geometry.face.length, 0.5 * geometry.length
    if end - under < 1e-6 * end:  # the strip is as long as the pad: no rim
        z = graded(0.0, end, density.half_length, end, edge)
    else:
        inner, overhang = _share(density.half_length - 1, under, end - under)
        z = _join(graded(0.0, under, inner, end, rim), graded(under, end, overhang + 1, rim, edge))
    r = graded(geometry.interface_radius, outer, density.backing, edge, rim)
    layers = (geometry.backing,) * density.backing
    if geometry.babbitt_thickness > 0:
        r = _join(np.linspace(geometry.inner_radius, geometry.interface_radius, density.babbitt + 1), r)
        layers = (geometry.babbitt,) * density.babbitt + layers
    return SectorMesh(Line(r), Line(theta), Line(z), layers)


def _share(count: int, first: float, second: float) -> tuple[int, int]:
    """Deal `count` elements to two lengths in proportion, at least one each."""
    share = min(max(round(count * first / (first + second)), 1), count - 1)
    return share, count - share


def _join(*pieces: FloatArray) -> FloatArray:
    return np.unique(np.concatenate(pieces))
