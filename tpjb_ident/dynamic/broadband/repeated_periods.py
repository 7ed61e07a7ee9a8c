"""h at one line from the periods of a periodic excitation: repeats tell the noise, and no window is needed.

The mean over a run's periods has the noise of one divided by their number, and its covariance is that of the repeats
(Pintelon and Schoukens, System Identification, 2nd ed. 2012, chapters 2 and 8). From two runs H = F D^-1; from more,
generalised total least squares with that covariance.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.line_fit import LineFit, by_runs, no_fit, runs_apart
from tpjb_ident.dynamic.broadband.line_rows import LineRows

#: Share of a channel's power that is taken for noise at least, so that exact data can be solved.
ROUNDING = 1e-24


def period_means(rows: LineRows) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Means (n_runs, 4) of X, Y, Fx, Fy, covariance (n_runs, 4, 4) of one period about them, periods (n_runs,).

    Parameters
    ----------
    rows : LineRows
    """
    z = np.concatenate([rows.D, rows.F], axis=1)
    means, spreads, counts = [], [], []
    for r in range(rows.n_runs):
        mine = z[rows.run == r]
        mean = mine.mean(axis=0)
        left = mine - mean
        means.append(mean)
        spreads.append(np.einsum("ni,nk->ik", left, left.conj()) / max(len(mine) - 1, 1))
        counts.append(len(mine))
    return np.array(means), np.array(spreads), np.array(counts, dtype=float)


def periods_fit(rows: LineRows) -> LineFit:
    """Estimate h from the means over periods.

    Parameters
    ----------
    rows : LineRows
        Periods of two runs or more, two periods each at least.
    """
    if rows.n_runs < 2 or min(np.bincount(rows.run)) < 2:
        return no_fit(rows.n_runs)
    means, spreads, counts = period_means(rows)
    scale = np.repeat([np.linalg.norm(means[:, :2]), np.linalg.norm(means[:, 2:])], 2)
    if not (scale > 0).all():
        return no_fit(rows.n_runs)
    h, fitted = _through(means / scale, spreads / np.outer(scale, scale), counts)
    condition = np.linalg.cond(fitted[:, :2])
    if not condition < 1e12:
        return no_fit(rows.n_runs)
    h = h * (scale[2] / scale[0])
    g = np.linalg.pinv((fitted[:, :2] * scale[0]).T)
    every = np.arange(rows.n_runs)
    leverage, share = by_runs(fitted[:, :2] * scale[0], g, every, rows.n_runs)
    leverage = leverage / counts[:, None, None]
    equation = np.concatenate([-h, np.eye(2)], axis=1)
    noise = np.einsum("ia,rab,kb->rik", equation, spreads, equation.conj())
    apart = runs_apart(fitted[:, :2] * scale[0] @ h.T, means @ equation.T, noise / counts[:, None, None], every)
    strength = _strength(fitted[:, :2] * scale[0], spreads[:, :2, :2], counts)
    slopes = np.empty((0, 2, 2), complex)
    return LineFit(h, leverage, noise, counts - 1, float(condition), slopes, strength, share, apart)


def _through(z: ComplexArray, spreads: ComplexArray, counts: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """H with [F, D] nearest to the means in the metric of their noise, and the means on it.

    Parameters
    ----------
    z : (n_runs, 4) complex ndarray
        Scaled means.
    spreads : (n_runs, 4, 4) complex ndarray
    counts : (n_runs,) ndarray
    """
    if len(z) == 2:
        return np.asarray(np.linalg.solve(z[:, :2], z[:, 2:]).T, dtype=complex), z
    weight = (counts - 1) / (counts - 1).sum()
    pooled = np.einsum("r,rab->ab", weight, spreads) + np.diag(ROUNDING + 1e-6 * np.mean(np.abs(spreads)) * np.ones(4))
    root = np.linalg.cholesky(pooled)
    # rows z^T: noise covariance of row vectors is the transpose
    white = np.linalg.solve(root, z.T).T * np.sqrt(counts)[:, None]
    signal = np.linalg.svd(white)[2][:2]
    directions = signal @ root.T
    h = np.linalg.solve(directions[:, :2], directions[:, 2:]).T
    fitted = (white @ signal.conj().T) @ directions / np.sqrt(counts)[:, None]
    return np.asarray(h), np.asarray(fitted)


def _strength(D: ComplexArray, spreads: ComplexArray, counts: FloatArray) -> float:
    """F ratio of the weaker direction of motion over the noise of the means."""
    _, singular, right = np.linalg.svd(D, full_matrices=False)
    noise = np.einsum("r,rab->ab", 1 / counts, spreads)
    weak = right[1]
    power = float((weak @ noise.conj() @ weak.conj()).real) / len(D) * 2
    return float(singular[1] ** 2 / power) if power > 0 else np.inf
