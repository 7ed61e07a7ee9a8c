"""Least squares for H and the angles of a known disturbance: many minima, all of them looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray

_STARTS = 2000
_SWEEPS = 25
_POLISHED = 30
_SEED = 5060


@dataclass(frozen=True)
class Minimum:
    """One local minimum."""

    cost: float
    x: FloatArray  #: (n,): unknowns
    covariance: FloatArray  #: (8, 8), N^2/m^2: of the entries of H
    log_volume: float


@dataclass(frozen=True)
class MainsEquations:
    """F_g = H (D_g - sum_k patterns_k exp(i angle_gk)), for H (8 real numbers) and the angles."""

    D: ComplexArray  #: (g, 2) complex, m
    F: ComplexArray  #: (g, 2) complex, N
    patterns: ComplexArray  #: (m, 2) complex, m
    sigma: FloatArray  #: (g,), N: of a run's force residual

    @property
    def scale(self) -> float:
        """What H is divided by among the unknowns [N/m]."""
        return float(np.linalg.norm(self.F) / np.linalg.norm(self.D))

    def h(self, x: FloatArray) -> ComplexArray:
        """H of the unknowns, (2, 2) [N/m]; `x` (8 + g m,)."""
        return np.asarray((x[:4] + 1j * x[4:8]).reshape(2, 2) * self.scale, dtype=complex)

    def entries(self, x: FloatArray) -> FloatArray:
        """The eight real entries of H [N/m]; `x` (8 + g m,)."""
        return x[:8] * self.scale

    def vectors(self, x: FloatArray) -> ComplexArray:
        """Disturbance of every run in X, Y, (g, 2) [m]; `x` (8 + g m,)."""
        return np.asarray(np.exp(1j * x[8:].reshape(len(self.D), -1)) @ self.patterns)

    def residual(self, x: FloatArray) -> FloatArray:
        """Weighted residuals, (4 g,); `x` (8 + g m,)."""
        r = (self.F - (self.D - self.vectors(x)) @ self.h(x).T) / self.sigma[:, None]
        return np.sqrt(2.0) * np.concatenate([r.real.ravel(), r.imag.ravel()])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """D residual / d x, (4 g, 8 + g m); `x` (8 + g m,)."""
        g, m = len(self.D), len(self.patterns)
        h, clean = self.h(x), self.D - self.vectors(x)
        slope = np.zeros((g, 2, 8 + g * m), dtype=complex)
        for a in range(2):
            for b in range(2):
                column = -self.scale * clean[:, b] / self.sigma
                slope[:, a, 2 * a + b] = column
                slope[:, a, 4 + 2 * a + b] = 1j * column
        turn = 1j * np.exp(1j * x[8:].reshape(g, m))
        push = h @ self.patterns.T
        rows = np.arange(g)
        for k in range(m):
            slope[rows, :, 8 + rows * m + k] = turn[:, k, None] * push[:, k] / self.sigma[:, None]
        flat = slope.reshape(2 * g, -1)
        return np.sqrt(2.0) * np.concatenate([flat.real, flat.imag])

    def start(self, h: ComplexArray) -> FloatArray:
        """Unknowns for a given H: the angles are those of what H leaves of the displacements; `h` (2, 2) [N/m]."""
        scaled = h.ravel() / self.scale
        return np.concatenate([scaled.real, scaled.imag, self._angles(h).ravel()])

    def _angles(self, h: ComplexArray) -> FloatArray:
        """Angles for given H, batched: (..., 2, 2) -> (..., g, m)."""
        remaining = self.D - self.F @ np.swapaxes(np.linalg.inv(h), -1, -2)
        return np.asarray(np.angle(remaining @ np.linalg.pinv(self.patterns)))

    def solve(self) -> list[Minimum]:
        """Distinct minima, best first.

        Many starts about the plain fit are run down by turns (angles for H, H for angles), all at once;
        the best of them are polished.
        """
        from scipy.optimize import least_squares

        minima: list[Minimum] = []
        for h in self._candidates():
            fit = least_squares(self.residual, self.start(h), self.jacobian, method="lm", max_nfev=400)
            if fit.status <= 0 or any(np.abs(fit.x[:8] - m.x[:8]).max() < 1e-5 for m in minima):
                continue
            normal = fit.jac.T @ fit.jac
            log_volume = -0.5 * float(np.linalg.slogdet(normal)[1])
            if not np.isfinite(log_volume):
                continue  # a valley without a floor: these runs leave H open there
            covariance = np.linalg.pinv(normal)[:8, :8] * self.scale**2
            minima.append(Minimum(2.0 * float(fit.cost), fit.x, np.asarray(covariance), log_volume))
        return sorted(minima, key=lambda minimum: minimum.cost)

    def _candidates(self) -> ComplexArray:
        """H of the best starts, (n, 2, 2)."""
        rng = np.random.default_rng(_SEED)
        plain = np.linalg.lstsq(self.D, self.F, rcond=None)[0].T
        spread = np.linalg.norm(self.patterns) / np.sqrt(np.mean(np.abs(self.D) ** 2))
        wobble = rng.standard_normal((_STARTS, 2, 2)) + 1j * rng.standard_normal((_STARTS, 2, 2))
        wobble[0] = 0.0
        h = plain + spread * np.linalg.norm(plain) / 2 * wobble
        weight = 1 / self.sigma[:, None]
        for _ in range(_SWEEPS):
            clean = (self.D - np.exp(1j * self._angles(h)) @ self.patterns) * weight
            adjoint = np.swapaxes(clean, -1, -2).conj()
            h = np.swapaxes(np.linalg.solve(adjoint @ clean, adjoint @ (self.F * weight)), -1, -2)
        remaining = (self.F - (self.D - np.exp(1j * self._angles(h)) @ self.patterns) @ np.swapaxes(h, -1, -2)) * weight
        cost = (np.abs(remaining) ** 2).sum(axis=(-1, -2))
        return h[_distinct(h, cost)]


def _distinct(h: ComplexArray, cost: FloatArray) -> list[int]:
    """The best starts that ended in different places."""
    chosen: list[int] = []
    for i in np.argsort(cost, kind="stable"):
        size = np.linalg.norm(h[i])
        if all(np.linalg.norm(h[i] - h[j]) > 2e-3 * size for j in chosen):
            chosen.append(int(i))
        if len(chosen) == _POLISHED:
            break
    return chosen
