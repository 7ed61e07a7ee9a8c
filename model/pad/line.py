"""Piecewise polynomials on one axis: the building brick of the tensor-product finite elements of a pad."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from model.errors import ModelError
from rigdata.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Line:
    """Continuous Lagrange elements on an interval."""

    breaks: FloatArray  #: (n_elements + 1,): Element ends, strictly increasing [m or rad].
    degree: int = 2

    def __post_init__(self) -> None:
        if not np.all(np.diff(self.breaks) > 0.0):  # of a bearing that was made in code
            raise ModelError(f"a pad has no elements that end at {self.breaks}. Check its arc and its thicknesses.")

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return (self.breaks.size - 1) * self.degree + 1

    @property
    def _places(self) -> FloatArray:
        """Nodes of an element from 0 to 1; a degree above 2 would ask for others."""
        return np.linspace(0.0, 1.0, self.degree + 1)

    @cached_property
    def nodes(self) -> FloatArray:
        """Node coordinates, shape (n_nodes,), increasing."""
        inside = self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * self._places[:-1]
        return np.append(inside.ravel(), self.breaks[-1])

    def tabulate(self, x: ArrayLike, derivative: int = 0) -> FloatArray:
        """Basis functions at points."""
        points = np.asarray(x, dtype=float)
        element = np.clip(np.searchsorted(self.breaks, points, side="right") - 1, 0, self.breaks.size - 2)
        size = np.diff(self.breaks)[element]
        local = (points - self.breaks[element]) / size
        powers = np.arange(self.degree + 1)
        if derivative == 0:
            monomials = local[:, None] ** powers
        else:
            monomials = powers * local[:, None] ** np.maximum(powers - 1, 0) / size[:, None]
        shape = monomials @ np.linalg.inv(self._places[:, None] ** powers)
        out = np.zeros((points.size, self.n_nodes))
        np.put_along_axis(out, element[:, None] * self.degree + powers, shape, axis=1)
        return out

    @cached_property
    def gauss(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points and weights, each of shape (n_elements * (degree + 2),).

        Two points more than a polynomial needs: the weights 1/r of cylindrical coordinates are none.
        """
        return gauss_rule(self.breaks, self.degree + 2)

    def matrix(self, rows: int, columns: int, weight: FloatArray | float = 1.0) -> FloatArray:
        """Weighted product of basis functions or their derivatives."""
        points, factor = self.gauss
        row_values, column_values = self.tabulate(points, rows), self.tabulate(points, columns)
        return row_values.T @ ((factor * weight)[:, None] * column_values)


def graded(start: float, stop: float, count: int, first: float, last: float) -> FloatArray:
    """Break an interval into elements that grow geometrically from both ends, by one factor."""
    length, steps = stop - start, np.arange(count)

    def sizes(growth: float) -> FloatArray:
        return np.minimum(first * growth**steps, last * growth ** steps[::-1])

    low, high = 1.0, 1024.0
    for _ in range(70):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sizes(middle).sum() < length else (low, middle)
    size = sizes(high) if sizes(1.0).sum() < length else np.ones(count)
    breaks = start + length * np.concatenate(([0.0], np.cumsum(size))) / size.sum()
    breaks[-1] = stop
    return breaks


def gauss_rule(breaks: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre points and weights, `count` in every interval of `breaks`.

    `breaks` (n + 1,); gives points, weights (n, count).
    """
    points, weights = np.polynomial.legendre.leggauss(count)
    size = np.diff(breaks)
    x = breaks[:-1, None] + 0.5 * size[:, None] * (points + 1.0)
    return x.ravel(), (0.5 * size[:, None] * weights).ravel()
