"""Between the nodes of a film grid and those of the pad's film face, by integrals, not by nearest neighbours.

The film's pressure is bilinear on its grid, the pad's displacement quadratic on its elements. Loads are integrals of
one against the basis of the other; the displacement at film nodes is the bilinear function closest to that of the
elements in the mean square (L2 projection). Both use the same integrals G = int psi phi, so with M = int phi phi the
compliance C on film nodes obeys M C = G^T S G: work done by the film is work taken up by the pad, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from model.arrays import FloatArray
from model.pad.line import Line, gauss_rule


@dataclass(frozen=True, eq=False)
class AxisMap:
    """One axis of the map."""

    gather: FloatArray
    project: FloatArray


def plain_map(face: Line, film: Line) -> AxisMap:
    """Map of two bases on the same interval."""
    points, weights = _points(face.breaks, film.breaks, face.degree)
    gather = face.tabulate(points).T @ (weights[:, None] * film.tabulate(points))
    return AxisMap(gather, _solve(film, gather.T))


def mirror_map(face: Line, film: Line, even: bool) -> AxisMap:
    """Map of a basis on 0 <= z <= L/2 and a film on -L/2 <= z <= L/2, for its even or its odd part."""
    points, weights = _points(face.breaks, np.unique(np.abs(film.breaks)), face.degree)
    sign = 1.0 if even else -1.0
    part = 0.5 * (film.tabulate(points) + sign * film.tabulate(-points))
    gather = face.tabulate(points).T @ (weights[:, None] * part)
    return AxisMap(gather, _solve(film, 2.0 * gather.T))


@dataclass(frozen=True, eq=False)
class FilmMap:
    """Both axes, for the elements and for the bilinear temperatures."""

    theta: AxisMap
    z: AxisMap
    coarse_theta: FloatArray
    coarse_z: FloatArray

    @classmethod
    def between(cls, face: tuple[Line, Line], film: tuple[Line, Line], even: bool | None) -> FilmMap:
        """Build the maps; `even` is None for a film on the half length, else the part of a full one."""
        coarse = tuple(Line(line.breaks, 1) for line in face)

        def axial(line: Line) -> AxisMap:
            return plain_map(line, film[1]) if even is None else mirror_map(line, film[1], even)

        return cls(
            theta=plain_map(face[0], film[0]),
            z=axial(face[1]),
            coarse_theta=_solve(coarse[0], plain_map(coarse[0], film[0]).gather),
            coarse_z=_solve(coarse[1], axial(coarse[1]).gather),
        )

    @cached_property
    def dense(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gather, project and coarse as matrices on raveled fields: (face, film), (film, face), (coarse, film)."""
        return (
            _kron(self.theta.gather, self.z.gather),
            _kron(self.theta.project, self.z.project),
            _kron(self.coarse_theta, self.coarse_z),
        )


def _kron(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.kron(first, second), dtype=float)


def _solve(line: Line, integrals: FloatArray) -> FloatArray:
    """Coefficients of the function of `line` with these integrals against its basis."""
    return np.asarray(np.linalg.solve(line.matrix(0, 0), integrals), dtype=float)


def _points(first: FloatArray, second: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points exact for products of piecewise polynomials of both sets of breaks."""
    merged = np.unique(np.concatenate((first, second)))
    keep = np.concatenate(([True], np.diff(merged) > 1e-12 * (merged[-1] - merged[0])))
    return gauss_rule(np.clip(merged[keep], first[0], first[-1]), degree + 1)
