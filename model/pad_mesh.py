"""The pad as a sector of an annulus, cut into hexahedra: where the layers, the pivot face and the elements lie."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.bearing import Bearing, Material, Pad
from model.pad_line import Line, graded

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PivotFace:
    """The part of the pad's back that is held (paper, Sec. 2: "null displacement ... corresponding to the pivot part").

    A rectangle centred on the pivot. Its size is a choice that the paper does not print; see `pivot_face`.

    Attributes
    ----------
    width : float
        Circumferential extent on the back [m].
    length : float
        Axial extent, both sides of the mid-plane together [m].
    """

    width: float
    length: float

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.length > 0):
            raise ValueError(f"A pivot face needs a positive width and length, got {self.width} m x {self.length} m.")


def pivot_face(pad: Pad, bearing: Bearing) -> PivotFace:
    """Choose the face on which a pivot holds its pad.

    A contact without width would let the FE solution dent without bound (a point or line load on a solid), and
    that dent is in the pivot's own load-deflection law already (Hertz, Kirk and Reedy, or the dry test). So the
    face is as wide as the region whose squeeze belongs to the pivot law.

    - rocker, rigid: a strip `contact_length` long (the whole pad if the file gives none), half the bending
      thickness wide;
    - sphere: a square of the area of a disc whose diameter is the bending thickness.

    Returns
    -------
    PivotFace
    """
    thickness = pad.elastic_thickness
    if bearing.pivot.kind == "spherical":
        side = 0.5 * math.sqrt(math.pi) * thickness
        return PivotFace(width=side, length=side)
    contact = bearing.pivot.contact_length
    length = bearing.length if math.isnan(contact) else min(contact, bearing.length)
    return PivotFace(width=0.5 * thickness, length=length)


@dataclass(frozen=True)
class PadGeometry:
    """All that the finite elements of a pad depend on; equal geometries share one solution.

    Attributes
    ----------
    inner_radius, backing_thickness, babbitt_thickness : float
        [m]; the babbitt may be zero.
    leading, trailing : float
        Edge angles from the pivot [rad].
    length : float
        Axial length [m].
    face : PivotFace
    back_convection : float
        [W/m^2/K]
    backing, babbitt : Material
    """

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
        if not (self.leading <= -half and half <= self.trailing):
            raise ValueError(
                f"The pivot face ({math.degrees(2 * half):.1f} deg wide) overhangs the pad, which spans "
                f"{math.degrees(self.leading):.1f} to {math.degrees(self.trailing):.1f} deg about its pivot. "
                "Give a narrower face, a thinner elastic_thickness or a pivot_offset nearer 0.5."
            )
        if self.face.length > self.length * (1 + 1e-12):
            raise ValueError(f"The pivot face ({self.face.length} m) is longer than the pad ({self.length} m).")

    @classmethod
    def of(cls, pad: Pad, bearing: Bearing, face: PivotFace | None = None) -> PadGeometry:
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
            face=pivot_face(pad, bearing) if face is None else face,
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
    """Tensor-product hexahedra of half a pad, 0 <= z <= length / 2.

    Attributes
    ----------
    r, theta, z : Line
        Elements across the thickness [m], along the arc [rad, from the pivot] and along the half length [m].
    layers : tuple of Material
        Material of every element of `r`, from the film outwards.
    """

    r: Line
    theta: Line
    z: Line
    layers: tuple[Material, ...]

    def __post_init__(self) -> None:
        if len(self.layers) != self.r.n_elements:
            raise ValueError(
                f"layers: {len(self.layers)} materials for {self.r.n_elements} elements across the thickness."
            )

    def per_gauss_point(self, values: list[float]) -> Array:
        """Spread one value per radial element over the Gauss points of `r`; shape of ``r.gauss[0]``."""
        return np.repeat(np.asarray(values, dtype=float), self.r.degree + 2)

    @property
    def n_surface(self) -> int:
        """Nodes on the film face of the half pad."""
        return self.theta.n_nodes * self.z.n_nodes

    def held(self, face: PivotFace) -> NDArray[np.bool_]:
        """Nodes on the pivot face, shape (n_theta, n_r, n_z)."""
        slack = 1e-9
        angle = 0.5 * face.width / self.r.breaks[-1]
        in_arc = np.abs(self.theta.nodes) <= angle * (1 + slack)
        in_length = self.z.nodes <= 0.5 * face.length * (1 + slack)
        on_back = np.arange(self.r.n_nodes) == self.r.n_nodes - 1
        return in_arc[:, None, None] & on_back[None, :, None] & in_length[None, None, :]


@dataclass(frozen=True)
class MeshDensity:
    """How many elements; the default keeps the deformation within 1 % of the converged one (see the tests).

    Attributes
    ----------
    wing : int
        Along the arc, on each side of the pivot face.
    face : int
        Along the arc, over the pivot face.
    inner, outer : int
        Along the half length, beside and beyond the pivot face.
    backing, babbitt : int
        Across the layers.
    degree : int
        Polynomial degree.
    """

    wing: int = 6
    face: int = 2
    inner: int = 3
    outer: int = 3
    backing: int = 3
    babbitt: int = 1
    degree: int = 2

    def refined(self, factor: int) -> MeshDensity:
        """Return a density of `factor` times as many elements in every direction."""
        counts = (self.wing, self.face, self.inner, self.outer, self.backing, self.babbitt)
        return MeshDensity(*(factor * count for count in counts), degree=self.degree)


def sector_mesh(geometry: PadGeometry, density: MeshDensity) -> SectorMesh:
    """Mesh half a pad.

    The stress is singular along the rim of the held face, so elements grow from there.
    """
    half = 0.5 * geometry.face.width / geometry.outer_radius
    theta = _join(
        _toward(geometry.leading, -half, density.wing),
        graded(-half, half, density.face),
        _toward(geometry.trailing, half, density.wing)[::-1],
    )
    rim, end = 0.5 * geometry.face.length, 0.5 * geometry.length
    if end - rim < 1e-6 * end:  # the strip is as long as the pad: no rim
        z = graded(0.0, end, density.inner + density.outer)
    else:
        z = _join(_toward(0.0, rim, density.inner), _toward(end, rim, density.outer)[::-1])
    r = _toward(geometry.interface_radius, geometry.outer_radius, density.backing)
    layers = (geometry.backing,) * density.backing
    if geometry.babbitt_thickness > 0:
        r = _join(graded(geometry.inner_radius, geometry.interface_radius, density.babbitt), r)
        layers = (geometry.babbitt,) * density.babbitt + layers
    lines = (Line(breaks, density.degree) for breaks in (r, theta, z))
    return SectorMesh(*lines, layers=layers)


def _toward(start: float, rim: float, count: int) -> Array:
    """Elements from `start` to `rim`, the last about a third as long as the first."""
    return graded(start, rim, count, 3.0 ** (-1.0 / max(count - 1, 1)))


def _join(*pieces: Array) -> Array:
    return np.concatenate([piece[: -1 if i < len(pieces) - 1 else None] for i, piece in enumerate(pieces)])
