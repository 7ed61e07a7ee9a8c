"""Cholesky factors of matrices on slabs of nodes along an arc, one element of the arc after another.

A consumer who needs only products of L^-1 B never holds the whole factor. Everything is dense matrix algebra at the
speed of BLAS 3; a general sparse solver needs several times as long for the hundreds of right-hand sides that a
compliance has.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, FloatArray

#: Of an element: its own block of L, and that beside it on the last slab of the element before.
ElementFactor = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SlabMatrix:
    """Sum of Kronecker products arcs[k] x sections[k]; of what is held, rows and columns of the unit matrix."""

    arcs: FloatArray  #: (terms, n, n): Along the arc, of elements of `degree`.
    sections: FloatArray  #: (terms, m, m): Within a slab.
    held: BoolArray  #: (n, m)
    degree: int

    @property
    def elements(self) -> list[slice]:
        """Slabs of every element but those of the one before; the first slab stands alone."""
        return [slice(max(0, end - self.degree), end) for end in range(1, len(self.held) + 1, self.degree)]

    def block(self, rows: slice, columns: slice) -> FloatArray:
        """What stands between some slabs and others."""
        block = np.tensordot(self.arcs[:, rows, columns], self.sections, (0, 0)).swapaxes(1, 2)
        block[self.held[rows]] = 0.0
        block[:, :, self.held[columns]] = 0.0
        return block.reshape(self.held[rows].size, -1)


def factor(matrix: SlabMatrix) -> Iterator[ElementFactor]:
    """Factor a positive definite matrix K = L L^T."""
    from scipy.linalg import blas, cholesky  # 27 MB that a process with stored solutions does without

    width, corner = matrix.held.shape[1], np.zeros((0, 0))
    for slabs in matrix.elements:
        block = matrix.block(slabs, slabs).T
        block[np.diag_indices_from(block)] += matrix.held[slabs].ravel()
        across = np.zeros((len(block), 0))
        if slabs.start:
            coupling = matrix.block(slabs, slice(slabs.start - 1, slabs.start))
            across = blas.dtrsm(1.0, corner, coupling, side=1, lower=1, trans_a=1)
            block = blas.dsyrk(-1.0, across, 1.0, block, lower=1, overwrite_c=1)
        lower = cholesky(block, lower=True, overwrite_a=True, check_finite=False)
        corner = lower[-width:, -width:]
        yield lower, across


def forward(factors: Iterable[ElementFactor], rhs: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Solve L Y = B, element by element; later blocks of B, in columns and taken over, may be wider."""
    from scipy.linalg import blas

    solution = np.zeros((0, 0))
    for (lower, across), block in zip(factors, rhs, strict=True):
        width = solution.shape[1]
        if width:
            last = solution[-across.shape[1] :]
            block[:, :width] = blas.dgemm(-1.0, across, last, 1.0, block[:, :width], overwrite_c=1)
        solution = blas.dtrsm(1.0, lower, block, lower=1, overwrite_b=1)
        yield solution


def solve(matrix: SlabMatrix, rhs: FloatArray) -> FloatArray:
    """Solve K X = B: `rhs` (n, m, n_columns); here the whole factor is held."""
    from scipy.linalg import blas

    factors = list(factor(matrix))
    width, n_columns = rhs.shape[1:]
    columns = (np.array(rhs[slabs].reshape(-1, n_columns), order="F") for slabs in matrix.elements)
    blocks = list(forward(factors, columns))
    for i in reversed(range(len(factors))):
        lower, across = factors[i]
        blocks[i] = blas.dtrsm(1.0, lower, blocks[i], lower=1, trans_a=1)
        if i:
            blocks[i - 1][-width:] -= across.T @ blocks[i]
    return np.concatenate(blocks).reshape(rhs.shape)
