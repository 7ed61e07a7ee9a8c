"""All estimates of one line (periods, instruments, H1, H2, Hv), and which of them counts.

S_FD is the sum of F D^H over the rows. H1 = S_FD S_DD^-1 holds where only the force is noisy, H2 = S_FF S_DF^-1 where
only the displacement is, Hv (total least squares, every channel in units of its own size) where both are alike. Bendat
and Piersol, Random Data, 4th ed. 2010, chapter 9; Rocklin, Crowley and Vold 1985 for Hv.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.line_fit import LineFit, by_runs, inconsistent_runs, no_fit
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.local_regression import H_ORDER, local_fit, without_slopes

#: F ratio from which an excitation tells the displacements from their noise.
STRONG = 10.0
#: Coherence of the force with the displacements that a line needs where nothing else tells signal from noise.
_LEAST_COHERENCE = 0.5
#: Share of a channel's power that is taken for noise at least, so that exact data can be solved.
_ROUNDING = 1e-24


@dataclass(frozen=True)
class LineEstimates:
    """What the methods say at one line."""

    omega: float
    method: str
    fits: dict[str, LineFit] = field(repr=False)
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int

    @property
    def fit(self) -> LineFit:
        """By the method that counts."""
        return self.fits[self.method]

    @property
    def usable(self) -> bool:
        """Whether the line was excited enough for its interval to hold."""
        fit = self.fit
        if not fit.found:
            return False
        if self.method == "hv":
            return bool(np.nanmin(self.coherence) > _LEAST_COHERENCE)
        return fit.strength > STRONG

    @property
    def bracket(self) -> FloatArray:
        """How far H1 or H2 is from the estimate that counts, (8,) [N/m]: truth lies between them."""
        away = [np.abs(_vector(self.fits[name]) - _vector(self.fit)) for name in ("h1", "h2")]
        return np.asarray(np.max(away, axis=0))


def _vector(fit: LineFit) -> FloatArray:
    return np.concatenate([fit.h.real.ravel(), fit.h.imag.ravel()])


def estimate_line(rows: LineRows, classic: bool = True) -> LineEstimates:
    """Estimate h at one line by every method that applies."""
    order = 0 if rows.repeated else H_ORDER
    fits = {}
    if rows.repeated and rows.n_runs > 1:
        fits["periods"] = periods_fit(rows)
    if rows.command is not None:
        fits["iv"] = local_fit(rows, rows.command, order)
    if classic or not fits:
        fits["h1"], fits["h2"] = h1_fit(rows), h2_fit(rows)
        fits["hv"] = hv_fit(rows, fits["h1"])
    method = next(name for name in ("periods", "iv", "hv") if name in fits)
    explained = coherence(rows, fits["h1"]) if "h1" in fits else np.full(2, np.nan)
    return LineEstimates(rows.omega, method, fits, explained, len(rows.D))


def _period_means(rows: LineRows) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Means (n_runs, 4) of X, Y, Fx, Fy, covariance (n_runs, 4, 4) of one period about them, periods (n_runs,)."""
    z = np.concatenate([rows.D, rows.F], axis=1)
    means, spreads, counts = [], [], []
    for r in range(rows.n_runs):
        mine = z[rows.run == r]
        mean = mine.mean(axis=0)
        remaining = mine - mean
        means.append(mean)
        spreads.append(np.einsum("ni,nk->ik", remaining, remaining.conj()) / max(len(mine) - 1, 1))
        counts.append(len(mine))
    return np.array(means), np.array(spreads), np.array(counts, dtype=float)


def periods_fit(rows: LineRows) -> LineFit:
    """Estimate h from the means over periods.

    The mean over a run's periods has the noise of one divided by their number, and its covariance is that of the
    repeats (Pintelon and Schoukens, System Identification, 2nd ed. 2012, chapters 2 and 8). From two runs H = F D^-1;
    from more, generalised total least squares with that covariance.
    """
    if rows.n_runs < 2 or min(np.bincount(rows.run)) < 2:
        return no_fit(rows.n_runs)
    means, spreads, counts = _period_means(rows)
    scale = np.repeat([np.linalg.norm(means[:, :2]), np.linalg.norm(means[:, 2:])], 2)
    if not (scale > 0).all():
        return no_fit(rows.n_runs)
    h, fitted = _through(means / scale, spreads / np.outer(scale, scale), counts)
    condition = np.linalg.cond(fitted[:, :2])
    if not condition < 1e12:
        return no_fit(rows.n_runs)
    h = h * (scale[2] / scale[0])
    g = np.linalg.pinv((fitted[:, :2] * scale[0]).T)
    run_places = np.arange(rows.n_runs)
    leverage, share = by_runs(fitted[:, :2] * scale[0], g, run_places, rows.n_runs)
    leverage = leverage / counts[:, None, None]
    equation = np.concatenate([-h, np.eye(2)], axis=1)
    noise = np.einsum("ia,rab,kb->rik", equation, spreads, equation.conj())
    apart = inconsistent_runs(
        fitted[:, :2] * scale[0] @ h.T, means @ equation.T, noise / counts[:, None, None], run_places
    )
    strength = _strength(fitted[:, :2] * scale[0], spreads[:, :2, :2], counts)
    slopes = np.empty((0, 2, 2), complex)
    return LineFit(h, leverage, noise, counts - 1, float(condition), slopes, strength, share, apart)


def _through(z: ComplexArray, spreads: ComplexArray, counts: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """H with [F, D] nearest to the means in the metric of their noise, and the means on it."""
    if len(z) == 2:
        return np.asarray(np.linalg.solve(z[:, :2], z[:, 2:]).T, dtype=complex), z
    weight = (counts - 1) / (counts - 1).sum()
    pooled = np.einsum("r,rab->ab", weight, spreads) + np.diag(_ROUNDING + 1e-6 * np.mean(np.abs(spreads)) * np.ones(4))
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


def h1_fit(rows: LineRows) -> LineFit:
    """Least squares of force on displacement: noise on the displacement pulls it towards zero."""
    return local_fit(rows, order=_order(rows))


def h2_fit(rows: LineRows) -> LineFit:
    """The force as instrument: noise on the force pushes it away from zero."""
    return local_fit(rows, rows.F, order=_order(rows))


def hv_fit(rows: LineRows, first: LineFit) -> LineFit:
    """Total least squares, with the leverage and noise of H1 behind its interval."""
    if not first.found:
        return first
    flat = without_slopes(rows, first)
    z = np.concatenate([flat.D, flat.F], axis=1)
    scale = np.sqrt(np.mean(np.abs(z) ** 2, axis=0))
    signal = np.linalg.svd(z / scale, full_matrices=False)[2][:2] * scale
    h = np.linalg.solve(signal[:, :2], signal[:, 2:]).T
    return replace(first, h=h)


def coherence(rows: LineRows, fit: LineFit) -> FloatArray:
    """Multiple coherence of the force along X and Y with the displacements, (2,), free of the few rows' bias."""
    flat = without_slopes(rows, fit)
    basis = np.linalg.qr(flat.D)[0]
    remaining = flat.F - basis @ (basis.conj().T @ flat.F)
    n, spent = len(rows.D), 3 * rows.n_runs if rows.ends else 0
    power = np.mean(np.abs(flat.F) ** 2, axis=0) * n / max(n - spent, 1)
    noise = np.sum(np.abs(remaining) ** 2, axis=0) / max(n - spent - 2, 1)
    with np.errstate(invalid="ignore", divide="ignore"):  # no force at all has no coherence
        return np.asarray(np.clip(1 - noise / power, 0.0, 1.0))


def spectra(rows: LineRows) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """S_FF, S_FD and S_DD summed over the rows, (2, 2) each."""
    D, F = rows.D, rows.F
    return (
        np.einsum("ni,nk->ik", F, F.conj()),
        np.einsum("ni,nk->ik", F, D.conj()),
        np.einsum("ni,nk->ik", D, D.conj()),
    )


def _order(rows: LineRows) -> int:
    return 0 if rows.repeated else 2
