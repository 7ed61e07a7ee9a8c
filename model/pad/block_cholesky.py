"""Cholesky factors of a symmetric matrix of dense blocks in a narrow band: slabs of a solid, one after another.

Rows of blocks come and go one at a time, so that a consumer who needs only products of L^-1 B never holds the whole
factor. Everything is dense matrix algebra on blocks, at the speed of BLAS 3; a general sparse solver needs several
times as long for the hundreds of right-hand sides that a compliance has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.linalg import cholesky
from scipy.linalg.blas import dgemm, dsyrk, dtrsm

from rigdata.arrays import FloatArray

BlockRow = dict[int, FloatArray]  # block row i of a lower triangle: column j <= i -> block (i, j); absent ones are zero


def factor_rows(rows: Iterable[BlockRow]) -> Iterator[BlockRow]:
    """Factor a positive definite matrix K = L L^T, row by row of blocks."""
    previous: dict[int, BlockRow] = {}
    for i, row in enumerate(rows):
        first = min(row)
        previous = {j: previous[j] for j in range(first, i)}  # the band: nothing before `first` is needed again
        row = {j: np.asfortranarray(block) for j, block in row.items()}
        for j in range(first, i):
            for k in range(first, j):
                if k in row and k in previous[j]:
                    sum_so_far = row[j] if j in row else np.zeros_like(row[k])
                    row[j] = dgemm(-1.0, row[k], previous[j][k], 1.0, sum_so_far, trans_b=1, overwrite_c=1)
            if j in row:
                row[j] = dtrsm(1.0, previous[j][j], row[j], side=1, lower=1, trans_a=1, overwrite_b=1)
        for k in range(first, i):
            if k in row:
                row[i] = dsyrk(-1.0, row[k], 1.0, row[i], lower=1, overwrite_c=1)
        row[i] = cholesky(row[i], lower=True, overwrite_a=True, check_finite=False)
        previous[i] = row
        yield row


def forward_rows(factor: Iterable[BlockRow], rhs: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Solve L Y = B, row by row of blocks: `rhs` (m, n_columns)."""
    previous: dict[int, FloatArray] = {}
    for i, (row, rhs_block) in enumerate(zip(factor, rhs)):
        previous = {j: previous[j] for j in range(min(row), i)}
        block = np.array(rhs_block, dtype=float, order="F")
        for j, solution in previous.items():
            if j in row:
                width = solution.shape[1]
                block[:, :width] = dgemm(-1.0, row[j], solution, 1.0, block[:, :width], overwrite_c=1)
        previous[i] = dtrsm(1.0, row[i], block, lower=1, overwrite_b=1)
        yield previous[i]


def solve_rows(rows: Iterable[BlockRow], rhs: FloatArray) -> FloatArray:
    """Solve K X = B: `rhs` (n_blocks, m, n_columns); here the whole factor is held."""
    factor = list(factor_rows(rows))
    out = np.stack(list(forward_rows(factor, rhs)))
    for i, row in reversed(list(enumerate(factor))):
        out[i] = dtrsm(1.0, row[i], out[i], lower=1, trans_a=1)
        for j in row:
            if j < i:
                out[j] -= row[j].T @ out[i]
    return out
