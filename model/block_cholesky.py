"""Cholesky factors of a symmetric matrix of dense blocks in a narrow band: slabs of a solid, one after another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]
Blocks = Mapping[tuple[int, int], Array]


@dataclass(frozen=True, eq=False)
class BlockCholesky:
    """Lower triangular L with L L^T = K, block by block.

    Everything is dense matrix algebra on blocks, hence at the speed of BLAS 3; a general sparse solver needs
    several times as long for the hundreds of right-hand sides that a compliance has.

    Attributes
    ----------
    diagonal : tuple of (m, m) ndarray
        Lower triangular diagonal blocks.
    below : tuple of dict
        ``below[i][j]`` is block (i, j) of L, j < i.
    """

    diagonal: tuple[Array, ...]
    below: tuple[dict[int, Array], ...]

    @classmethod
    def factor(cls, n_blocks: int, lower: Blocks) -> BlockCholesky:
        """Factor a positive definite matrix.

        Parameters
        ----------
        n_blocks : int
            Number of block rows.
        lower : mapping (i, j) -> (m, m) ndarray
            Blocks of the lower triangle, i >= j; absent ones are zero.

        Raises
        ------
        numpy.linalg.LinAlgError
            The matrix is not positive definite: the body is not held.
        """
        work: list[dict[int, Array]] = [{} for _ in range(n_blocks)]
        for (i, j), block in lower.items():
            work[i][j] = np.array(block, order="F")
        diagonal = []
        for j in range(n_blocks):
            diagonal.append(cholesky(work[j].pop(j), lower=True, overwrite_a=True, check_finite=False))
            rows = [i for i in range(j + 1, n_blocks) if j in work[i]]
            for i in rows:
                work[i][j] = solve_triangular(diagonal[j], work[i][j].T, lower=True, check_finite=False).T
            for i in rows:
                for k in rows:
                    if k <= i:
                        update = work[i][j] @ work[k][j].T
                        work[i][k] = work[i][k] - update if k in work[i] else -update
        return cls(tuple(diagonal), tuple(work))

    def forward(self, rhs: Array, active: Sequence[int] | None = None) -> Array:
        """Solve L Y = B.

        Parameters
        ----------
        rhs : (n_blocks, m, n_columns) ndarray
        active : sequence of int, optional
            ``active[i]``: so many leading columns are not zero in block rows 0 to i. Loads numbered slab by slab
            are such, and half of the work falls away.

        Returns
        -------
        ndarray, shape (n_blocks, m, n_columns)
        """
        out = np.zeros_like(rhs)
        for i, diagonal in enumerate(self.diagonal):
            width = rhs.shape[2] if active is None else active[i]
            block = rhs[i, :, :width].copy()
            for j, factor in self.below[i].items():
                known = width if active is None else active[j]
                block[:, :known] -= factor @ out[j, :, :known]
            out[i, :, :width] = solve_triangular(diagonal, block, lower=True, check_finite=False)
        return out

    def solve(self, rhs: Array) -> Array:
        """Solve K X = B; shapes as in `forward`."""
        out = self.forward(rhs)
        for i in reversed(range(len(self.diagonal))):
            out[i] = solve_triangular(self.diagonal[i], out[i], lower=True, trans="T", check_finite=False)
            for j, factor in self.below[i].items():
                out[j] -= factor.T @ out[i]
        return out
