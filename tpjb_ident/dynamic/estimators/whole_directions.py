"""Directions that the joint fit has rejected as a whole, looked at once more.

Runs differ a little from one another (their static load does), by more than the noise inside a run.
A robust joint fit over few runs can then take two or three of them for the truth and reject a
sound run with all its windows. A run whose windows agree with one another is taken back unless it
lies further from what the other runs predict than their own disagreement explains. With fewer than
four others nobody can say which run is wrong: then all count, and the interval shows the discord.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtri

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.dynamic.estimators.errors_in_variables import Repeats, eiv_fit, repeats
from tpjb_ident.dynamic.estimators.r_matrix import PhasorTable
from tpjb_ident.dynamic.estimators.robust_constants import trimming_limits
from tpjb_ident.dynamic.records.line_means import complex_median

#: A direction with less than this share of its windows accepted counts as rejected.
REJECTED = 0.2
#: Share of its windows that must agree with one another for it to be a candidate.
AGREEING = 0.6
#: How improbable its distance must be for the rejection to stand.
SIGNIFICANCE = 1e-4
MIN_OTHERS = 4


def readmitted(table: PhasorTable, weights: FloatArray) -> FloatArray:
    """Window weights with consistent directions taken back.

    Parameters
    ----------
    table : PhasorTable
    weights : (n,) ndarray
        Of the robust joint fit.
    """
    size = np.bincount(table.direction, minlength=table.n_directions)
    share = np.bincount(table.direction, weights=weights > 0.2, minlength=table.n_directions) / size
    doubtful = np.flatnonzero((share < REJECTED) & (size >= 3))
    if not len(doubtful):
        return weights
    others = repeats(table, np.where(np.isin(table.direction, doubtful), 0.0, weights))
    if others is None:
        return weights
    few = len(others.means) < MIN_OTHERS
    result = weights.copy()
    for direction in doubtful:
        core = _agreeing(table, int(direction), others)
        if core.sum() >= AGREEING * size[direction] and (few or _explained(table, core, others)):
            result[core] = 1.0
    return result


def _agreeing(table: PhasorTable, direction: int, others: Repeats) -> BoolArray:
    """Windows of a direction that lie together within the noise of the other directions."""
    mine = table.direction == direction
    z = np.concatenate([table.D, table.F], axis=1)
    deviation = z - complex_median(z[mine])
    u2 = 2.0 * np.einsum("na,an->n", deviation.conj(), np.linalg.solve(others.noise, deviation.T)).real
    return np.asarray(mine & (u2 <= 2.0 * trimming_limits(8)[1]))


def _explained(table: PhasorTable, core: BoolArray, others: Repeats) -> bool:
    """Whether the others' own disagreement explains how far this direction is off."""
    fit = eiv_fit(others)
    residual = table.F[core].mean(axis=0) - fit.h @ table.D[core].mean(axis=0)
    A = np.concatenate([-fit.h, np.eye(2)], axis=1)
    noise = A @ others.noise @ A.conj().T
    count = min(float(core.sum()), float(np.mean(others.means.count)))
    # The others' chi-square scales the noise to what runs really differ by; 2 for predicting afresh.
    spread = 2.0 * max(fit.chi_square, 1.0) * noise / count
    distance = float((residual.conj() @ np.linalg.solve(spread, residual)).real) / 2.0
    spare = 4.0 * (len(others.means) - 2)
    return distance <= float(fdtri(4, spare, 1.0 - SIGNIFICANCE))
