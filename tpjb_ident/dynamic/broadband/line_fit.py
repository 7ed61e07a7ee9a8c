"""What an estimate of one line says: h, and the covariance that its equation noise leaves.

Every estimator here is linear in the noise e = n_F - h n_D of its rows, to first order: the error of h is the sum of
e g^T over the rows, with g the row's leverage. Noise of the displacements is in e as well, so that one covariance of e
per run, taken from the fit's own residuals, is all that the intervals need.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class InconsistentRuns:
    """How far every run's force is from what h gives, along that force."""

    left: ComplexArray  #: (n_runs,) complex, N^2
    force: ComplexArray  #: (n_runs, 2, 2) complex, N^2: sum of f f^H over the rows, f the force that h gives
    variance: FloatArray  #: (n_runs,), N^4: of `left`, by the line's noise

    @property
    def power(self) -> FloatArray:
        """Sum of |f|^2, (n_runs,) [N^2]."""
        return np.asarray(np.einsum("rii->r", self.force).real)


def _nothing_apart() -> InconsistentRuns:
    return InconsistentRuns(np.empty(0, complex), np.empty((0, 2, 2), complex), np.empty(0))


@dataclass(frozen=True)
class LineFit:
    """Estimate of h at one line."""

    h: ComplexArray  #: (2, 2) complex
    leverage: ComplexArray = field(repr=False)  #: (n_runs, 2, 2) complex, 1/m^2: sum of g g^H over the rows of each run
    #: (n_runs, 2, 2) complex, N^2: covariance of the equation noise in one row of each run
    noise: ComplexArray = field(repr=False)
    dof: FloatArray = field(repr=False)  #: (n_runs,): complex degrees of freedom behind each
    condition: float
    slopes: ComplexArray = field(repr=False)  #: (k, 2, 2) complex
    strength: float = np.inf
    #: (n_runs, 2, 2) complex
    share: ComplexArray = field(default_factory=lambda: np.empty((0, 2, 2), complex), repr=False)
    apart: InconsistentRuns = field(default_factory=_nothing_apart, repr=False)

    @property
    def found(self) -> bool:
        """Whether there is an answer with an interval."""
        return bool(np.isfinite(self.h).all() and np.isfinite(self.noise).all() and (self.dof > 0).all())

    def covariance(self, noise: ComplexArray | None = None) -> FloatArray:
        """Random covariance (8, 8) of [Re hxx, Re hxy, Re hyx, Re hyy, Im hxx, ...] [N^2/m^2].

        `noise` (n_runs, 2, 2).
        """
        return np.asarray(np.sum(self.by_run(noise), axis=0))

    def by_run(self, noise: ComplexArray | None = None) -> FloatArray:
        """What every run's noise adds to the covariance, (n_runs, 8, 8) [N^2/m^2]; `noise` (n_runs, 2, 2)."""
        sigma = self.noise if noise is None else noise
        return np.array([_real_covariance(outer_matrix(s, a)) for s, a in zip(sigma, self.leverage)])

    @property
    def real_dof(self) -> FloatArray:
        """Degrees of freedom of the variances of the eight entries, (8,): runs put together as Satterthwaite does."""
        parts = np.einsum("rii->ri", self.by_run())
        return satterthwaite(parts, 2.0 * self.dof[:, None])


def by_runs(D: ComplexArray, g: ComplexArray, run: IntArray, n_runs: int) -> tuple[ComplexArray, ComplexArray]:
    """Leverage and share of every run, (n_runs, 2, 2) each, from the rows' displacements and leverages (n, 2)."""
    leverage = np.empty((n_runs, 2, 2), dtype=complex)
    share = np.empty((n_runs, 2, 2), dtype=complex)
    for r in range(n_runs):
        selected = run == r
        leverage[r] = np.einsum("nj,nl->jl", g[selected], g[selected].conj())
        share[r] = np.einsum("ni,nj->ij", D[selected], g[selected])
    return leverage, share


def inconsistent_runs(given: ComplexArray, left: ComplexArray, noise: ComplexArray, run: IntArray) -> InconsistentRuns:
    """How far every run's force is from what h gives.

    `given`, `left` (n, 2) [N], `noise` (n_runs, 2, 2) [N^2], `run` (n,).
    """
    rows = [(given[run == r], left[run == r]) for r in range(len(noise))]
    return InconsistentRuns(
        np.array([np.sum(f.conj() * rest) for f, rest in rows]),
        np.array([np.einsum("ni,nk->ik", f, f.conj()) for f, _ in rows]),
        np.array([np.einsum("ni,ik,nk->", f.conj(), spread, f).real for (f, _), spread in zip(rows, noise)]),
    )


def no_fit(n_runs: int) -> LineFit:
    """Answer where there is none."""
    gap = np.full((n_runs, 2, 2), np.nan + 0j)
    return LineFit(np.full((2, 2), np.nan + 0j), gap, gap, np.zeros(n_runs), np.inf, np.empty((0, 2, 2), complex), 0.0)


def outer_matrix(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Kronecker product of two square matrices, for small ones some times quicker than numpy's.

    `a`, `b` (n, n) and (m, m).
    """
    return (a[:, None, :, None] * b[None, :, None, :]).reshape(len(a) * len(b), -1)


def _real_covariance(gamma: ComplexArray) -> FloatArray:
    """Covariance of real and imaginary parts, (2 m, 2 m), of circular complex errors."""
    half = 0.5 * gamma
    return np.block([[half.real, -half.imag], [half.imag, half.real]])


def satterthwaite(variances: FloatArray, dof: FloatArray) -> FloatArray:
    """Effective degrees of freedom of sums of variances over the first axis (Satterthwaite 1946).

    `variances` (k, ...), `dof` (k, ...).
    """
    total = variances.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):  # no variance at all is known exactly
        found = total**2 / (variances**2 / dof).sum(axis=0)
    return np.asarray(np.where(total > 0, found, np.inf))
