"""h at one line from the bins around it: the local polynomial method, with or without instruments.

Over a few bins h and what the record's ends leak into its transform are smooth, the excitation is not; so force is
regressed on displacement times powers of frequency, and on powers alone for the ends (Pintelon, Schoukens, Vandersteen
and Barbe 2010, doi:10.1016/j.ymssp.2009.08.003 for one input). With the command as instrument W in place of the noisy
displacements X, theta = (W^H X)^-1 W^H F: at one bin H = S_FC S_DC^-1, which noise on D does not bias.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.line_fit import LineFit, by_runs, inconsistent_runs, no_fit
from tpjb_ident.dynamic.broadband.line_rows import LineRows

#: Highest power of frequency, of h over the bins of a line,
H_ORDER = 2
#: and of what the ends of the record leak into them: for K, C and M it is of the first already.
_ENDS_ORDER = 2


def local_fit(rows: LineRows, instrument: ComplexArray | None = None, order: int = H_ORDER) -> LineFit:
    """Regress force on displacement over the bins of one line; `instrument` (n, 2)."""
    powers = rows.place[:, None] ** np.arange(order + 1)
    ends = ends_columns(rows)
    d_scale, f_scale = _size(rows.D), _size(rows.F)
    W = rows.D if instrument is None else instrument
    w_scale = _size(W)
    if not (d_scale > 0 and f_scale > 0 and w_scale > 0) or len(rows.D) < 2 * (order + 1) + ends.shape[1] + 2:
        return no_fit(rows.n_runs)
    X = np.concatenate([_times(rows.D / d_scale, powers), ends], axis=1)
    Z = X if instrument is None else np.concatenate([_times(W / w_scale, powers), ends], axis=1)
    cross = Z.conj().T @ X
    if not np.linalg.cond(cross) < 1e12:
        return no_fit(rows.n_runs)
    G = np.linalg.solve(cross, Z.conj().T)
    theta = G @ (rows.F / f_scale)
    residual = rows.F - f_scale * (X @ theta)
    noise, dof = _noise(residual, np.eye(len(X)) - X @ G, rows)
    g = G[:2].T / d_scale
    leverage, share = by_runs(rows.D, np.asarray(g, dtype=complex), rows.run, rows.n_runs)
    # the force that the instrument explains: noise of the displacements is not in it, as it is in the residual
    basis = np.linalg.qr(Z)[0]
    explained = basis @ (basis.conj().T @ (rows.F - residual))
    apart = inconsistent_runs(explained, residual, noise, rows.run)
    h = theta[: 2 * (order + 1)].reshape(order + 1, 2, 2).transpose(0, 2, 1) * (f_scale / d_scale)
    condition, strength = _excited(rows, W, ends)
    return LineFit(h[0], leverage, noise, dof, condition, h[1:], strength, share, apart)


def without_slopes(rows: LineRows, fit: LineFit) -> LineRows:
    """The rows as if h were the line's own at every bin, and without what the records' ends leak into them."""
    F = rows.F.copy()
    for s, slope in enumerate(fit.slopes, 1):
        F -= (rows.place**s)[:, None] * (rows.D @ slope.T)
    ends = ends_columns(rows)
    if not ends.shape[1]:
        return rows.with_force(F)
    flat = remainder(ends)
    command = None if rows.command is None else flat @ rows.command
    return replace(rows, D=flat @ rows.D, F=flat @ F, command=command, ends=False)


def _times(values: ComplexArray, powers: FloatArray) -> ComplexArray:
    return np.asarray((powers[:, :, None] * values[:, None, :]).reshape(len(values), -1))


def _size(values: ComplexArray) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2))) if len(values) else 0.0


def ends_columns(rows: LineRows) -> ComplexArray:
    """Columns for the ends of every run's record, (n, n_runs (ENDS_ORDER + 1)); none where they are at rest."""
    if not rows.ends:
        return np.empty((len(rows.D), 0), dtype=complex)
    powers = rows.place[:, None] ** np.arange(_ENDS_ORDER + 1)
    return np.concatenate([np.where((rows.run == r)[:, None], powers, 0.0) for r in range(rows.n_runs)], axis=1) + 0j


def remainder(columns: ComplexArray) -> ComplexArray:
    """Projection on what the columns do not span, (n, n); `columns` (n, k)."""
    q = np.linalg.qr(columns)[0]
    return np.asarray(np.eye(len(q)) - q @ q.conj().T)


def _noise(residual: ComplexArray, maker: ComplexArray, rows: LineRows) -> tuple[ComplexArray, FloatArray]:
    """Covariance of the equation noise in each run, and its complex degrees of freedom."""
    remaining = np.sum(np.abs(maker) ** 2, axis=1)
    noise = np.empty((rows.n_runs, 2, 2), dtype=complex)
    dof = np.empty(rows.n_runs)
    for r in range(rows.n_runs):
        selected = rows.run == r
        dof[r] = remaining[selected].sum()
        noise[r] = np.einsum("ni,nk->ik", residual[selected], residual[selected].conj()) / max(float(dof[r]), 1e-300)
    return noise, dof


def _excited(rows: LineRows, W: ComplexArray, ends: ComplexArray) -> tuple[float, float]:
    """Condition of the displacements that the instrument explains, and how clearly it explains the weaker one."""
    flat = remainder(ends) if ends.shape[1] else np.eye(len(W))
    D, w = flat @ rows.D, flat @ W
    q, triangle = np.linalg.qr(w)
    if not np.abs(np.diag(triangle)).min() > 1e-9 * np.abs(triangle).max():
        return np.inf, 0.0
    explained = q.conj().T @ D
    singular = np.linalg.svd(explained, compute_uv=False)
    remaining = D - q @ explained
    spare = max(len(D) - ends.shape[1] - 2, 1)
    # noise along the weaker direction of motion
    weak = np.linalg.svd(explained)[2][1].conj()
    power = float(np.sum(np.abs(remaining @ weak) ** 2)) / spare
    strength = float(singular[1] ** 2 / (2 * power)) if power > 0 else np.inf
    return float(singular[0] / singular[1]) if singular[1] > 0 else np.inf, strength
