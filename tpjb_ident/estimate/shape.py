"""How H of the points hangs on numbers that groups of points share: each its own H, or a model over frequency.

K-C, h = K + i omega C, and K-C-M, h = K - omega^2 M + i omega C, hold for all lines of a load together; a part of a
band shares one departure from such a model. Sines, lines of a multi-sine and of a transform take part alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.term import Fitted

#: Matrices of a model over frequency, four numbers each.
MODELS = {"K-C": 2, "K-C-M": 3}


@dataclass(frozen=True)
class Shape:
    """H = start + columns x for P points in G groups, x the k numbers of a group."""

    group: IntArray  #: (P,): group of every point
    columns: FloatArray | None = None  #: (P, 8, k); None: x is h itself
    count: int = 0  #: groups at least: the last may have no point
    scatter: Scatter | None = None  #: to begin with; None: none, and blocks are judged
    held: Mapping[str, Fitted] = field(default_factory=dict)  #: terms by name, as another solve left them

    @property
    def groups(self) -> int:
        """Number of groups."""
        return max(self.count, int(self.group.max(initial=-1)) + 1)

    @property
    def numbers(self) -> int:
        """Unknowns of a group."""
        return NUMBERS if self.columns is None else self.columns.shape[2]

    def mapped(self, J_h: FloatArray, point: IntArray) -> FloatArray:
        """Columns of the group's numbers (n, rows, k) from those of h (n, rows, 8); `point` (n,)."""
        return J_h if self.columns is None else J_h @ self.columns[point]

    def change(self, x: FloatArray) -> ComplexArray:
        """Change of h (P, 2, 2) by the groups' numbers (G, k)."""
        parts = x[self.group]
        numbers = parts if self.columns is None else np.einsum("pak,pk->pa", self.columns, parts)
        return complex_matrix(numbers)


def complex_matrix(numbers: FloatArray) -> ComplexArray:
    """H (.., 2, 2) of its eight numbers (.., 8)."""
    h = numbers[..., :4] + 1j * numbers[..., 4:]
    return np.asarray(h.reshape(*numbers.shape[:-1], 2, 2), complex)


def real_numbers(h: ComplexArray) -> FloatArray:
    """The eight numbers (.., 8) of H (.., 2, 2)."""
    flat = h.reshape(*h.shape[:-2], 4)
    return np.concatenate([flat.real, flat.imag], axis=-1)


def power_columns(w: FloatArray, count: int) -> FloatArray:
    """Change of the eight numbers of h = K + i w C + (i w)^2 M + .. by the entries of each matrix, (n, 8, 4 count)."""
    powers = (1j * w)[:, None] ** np.arange(count)
    parts = np.stack([powers.real, powers.imag], axis=1)
    return np.einsum("npk,ab->npakb", parts, np.eye(4)).reshape(len(w), NUMBERS, 4 * count)


def remainder(columns: FloatArray, values: FloatArray, root: FloatArray, used: BoolArray | slice) -> FloatArray:
    """What a model, fitted to some of n points, leaves of c sets of numbers of all of them, (n, 8, c).

    `columns` (n, 8, k), `values` (n, 8, c), both weighed by `root` (n, 8, 8), `used` (n,).
    """
    design, rows = root @ columns, root @ values
    return rows - design @ least_squares(design[used], rows[used])


def least_squares(columns: FloatArray, rows: FloatArray) -> FloatArray:
    """Numbers (k, ..) by which columns (n, 8, k) come nearest to rows (n, 8, ..)."""
    k, several = columns.shape[2], rows.shape[2:]
    return np.asarray(np.linalg.lstsq(columns.reshape(-1, k), rows.reshape(-1, *several), rcond=None)[0])


def free_force(D: ComplexArray, F: ComplexArray) -> tuple[Shape, ComplexArray]:
    """A force (4 numbers) of the film for every point by itself, and H to start from: the rig is told of no film.

    `D`, `F` (P, 2): what the points' only runs show [m], [N]; NaN where they show nothing.
    """
    usable = np.isfinite(np.concatenate([D, F], axis=1)).all(axis=1)
    shown = np.where(usable[:, None], D, 1.0)
    size = np.maximum(np.linalg.norm(shown, axis=1), 1e-300)[:, None]
    across = shown.conj() / size
    start = np.where(usable[:, None, None], F[:, :, None] * (across / size)[:, None, :], np.nan)
    columns = np.zeros((len(D), NUMBERS, 4))
    for k in range(NUMBERS // 2):
        i, part = k // 2, across[:, k % 2]
        columns[:, k, i], columns[:, k, 2 + i] = part.real, -part.imag
        columns[:, 4 + k, i], columns[:, 4 + k, 2 + i] = part.imag, part.real
    return Shape(np.arange(len(D)), columns), start
