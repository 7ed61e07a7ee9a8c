"""Pairs: two effects at once, every combination, to first order; the best of them are worth a fit.

Forward selection can begin with a compromise between two effects and never leave it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.search.fit import Fit, Misfit, Start


def best_pairs(
    misfit: Misfit, baseline: Fit, singles: Sequence[Fit], columns: Mapping[Candidate, FloatArray], most: int = 5
) -> list[tuple[tuple[Candidate, ...], Start]]:
    """Rank all pairs by the drop of chi-square that they promise from the baseline; starts for the best.

    Parameters
    ----------
    misfit : Misfit
    baseline : Fit
    singles : sequence of Fit
        Fits of one candidate each: where one is at hand, its secant replaces the derivative at the baseline.
    columns : mapping of Candidate to (n,) ndarray
    most : int
    """
    table = dict(columns)
    for f in singles:
        (c,) = f.candidates
        moved = float(f.amplitudes[0]) - c.neutral
        if abs(moved) > 1e-3 * c.step:
            table[c] = (f.prediction - baseline.prediction) / moved
    pool = list(table)
    white = misfit.whiten(np.column_stack(list(table.values())))
    residual = misfit.whiten(misfit.value - baseline.prediction)
    gram, toward = white.T @ white, white.T @ residual
    rows = []
    for i in range(len(pool)):
        for j in range(i + 1, len(pool)):
            found = _gain(gram, toward, pool, (i, j))
            if found is not None:
                rows.append((*found, i, j))
    rows.sort(key=lambda row: -row[0])
    starts: list[tuple[tuple[Candidate, ...], Start]] = []
    for _, moved_pair, i, j in rows[:most]:
        chosen = (pool[i], pool[j])
        amplitudes = np.array([c.neutral for c in chosen]) + moved_pair
        starts.append((chosen, Start(amplitudes, np.column_stack([table[c] for c in chosen]))))
    return starts


def _gain(
    gram: FloatArray, toward: FloatArray, pool: Sequence[Candidate], pair: tuple[int, int]
) -> tuple[float, FloatArray] | None:
    """Promised drop and amplitudes of a pair; None where its members are alike or leave their bounds."""
    at = np.array(pair)
    normal = gram[np.ix_(at, at)]
    determinant = normal[0, 0] * normal[1, 1] - normal[0, 1] ** 2
    if determinant <= 1e-4 * normal[0, 0] * normal[1, 1]:
        return None
    moved = np.linalg.solve(normal, toward[at])
    for k, shift in zip(pair, moved, strict=True):
        low, high = pool[k].bounds
        if not low <= pool[k].neutral + shift <= high:
            return None
    return float(toward[at] @ moved), moved
