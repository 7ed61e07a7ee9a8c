"""Normal equations of an arrow: the eight numbers of every point, bordered by the parameters that all points share.

With A_p = J_h^T J_h, E_p = J_h^T J_t, g_p = J_h^T r summed over a point's blocks, G = J_t^T J_t + Lambda and
g = J_t^T r + Lambda (theta_0 - theta) over all blocks::

    S = G - sum_p E_p^T A_p^-1 E_p          d_theta = S^-1 (g - sum_p E_p^T A_p^-1 g_p)
    K_p = -A_p^-1 E_p                       d_h_p = A_p^-1 (g_p - E_p d_theta)
    Cov(theta) = S^-1                       Cov(h_p) = A_p^-1 + K_p S^-1 K_p^T

A parameter of which the records tell little (posterior deviation above 0.8 of the prior's) is considered, not
estimated: its value stays, its prior passes into the covariance. Estimated, it would be moved by what the model of the
others leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray

#: Posterior over prior deviation above which a parameter is considered.
CONSIDERED = 0.8
#: Smallest eigenvalue of a point's equations, scaled to a diagonal of ones, that tells its numbers apart.
_TOLD = 1e-13
#: Numbers of a point: real and imaginary parts of h_xx, h_xy, h_yx, h_yy.
NUMBERS = 8


@dataclass
class Sums:
    """Sums of the normal equations over blocks, P points and q parameters."""

    A: FloatArray  #: (P, k, k), k numbers a point: eight, or those of a model over frequency
    E: FloatArray  #: (P, k, q)
    g_h: FloatArray  #: (P, k)
    G: FloatArray  #: (q, q), without the priors
    g_t: FloatArray  #: (q,)

    @staticmethod
    def empty(points: int, parameters: int, numbers: int = NUMBERS) -> Sums:
        """All zero."""
        return Sums(
            np.zeros((points, numbers, numbers)),
            np.zeros((points, numbers, parameters)),
            np.zeros((points, numbers)),
            np.zeros((parameters, parameters)),
            np.zeros(parameters),
        )

    def add(self, point: IntArray, r: FloatArray, J_h: FloatArray, J_t: FloatArray) -> None:
        """Add weighted rows of blocks: `point` (n,), `r` (n, k), `J_h` (n, k, numbers), `J_t` (n, k, q)."""
        transposed = J_h.transpose(0, 2, 1)
        np.add.at(self.A, point, transposed @ J_h)
        np.add.at(self.E, point, transposed @ J_t)
        np.add.at(self.g_h, point, np.einsum("nka,nk->na", J_h, r))
        flat = J_t.reshape(J_t.shape[0] * J_t.shape[1], J_t.shape[2])
        self.G += flat.T @ flat
        self.g_t += flat.T @ r.reshape(-1)

    def drop(self, points: BoolArray) -> None:
        """Leave points (P,) out that have no answer."""
        self.A[points], self.E[points], self.g_h[points] = np.eye(self.A.shape[1]), 0.0, 0.0


def are_told(A: FloatArray) -> BoolArray:
    """Whether the equations of points (P, 8, 8) determine their numbers, (P,)."""
    size = np.sqrt(np.maximum(np.einsum("paa->pa", A), 1e-300))
    scaled = A / (size[:, :, None] * size[:, None, :])
    return np.asarray(np.linalg.eigvalsh(scaled)[:, 0] > _TOLD)


@dataclass(frozen=True)
class Step:
    """One step of the solve, and the covariances that go with it."""

    h: FloatArray  #: (P, 8)
    theta: FloatArray  #: (q,)
    A_inverse: FloatArray = field(repr=False)  #: (P, 8, 8)
    K: FloatArray = field(repr=False)  #: (P, 8, q)
    S: FloatArray = field(repr=False)  #: (q, q)
    S_inverse: FloatArray = field(repr=False)  #: (q, q): zero in rows and columns of considered parameters
    estimated: BoolArray = field(repr=False)  #: (q,)
    precision: FloatArray = field(repr=False)  #: (q,): Lambda

    def records(self) -> FloatArray:
        """Covariance (P, 8, 8) of the points' numbers that the records leave, the learning of parameters included."""
        learnt = self.S_inverse @ (self.S - np.diag(self.precision)) @ self.S_inverse
        return self.A_inverse + self.K @ learnt @ self.K.transpose(0, 2, 1)

    def factors(self) -> FloatArray:
        """One standard deviation of every parameter's prior, as it moves all points together, (q, P, 8)."""
        moved = np.einsum("pak,kq->qpa", self.K, self.S_inverse) * np.sqrt(self.precision)[:, None, None]
        considered = np.flatnonzero(~self.estimated)
        if len(considered):
            through = self.S_inverse @ self.S[:, considered]
            passed = self.K[:, :, considered] - self.K @ through
            moved[considered] = passed.transpose(2, 0, 1) / np.sqrt(self.precision[considered])[:, None, None]
        return moved

    @property
    def deviation(self) -> FloatArray:
        """Posterior standard deviation of every parameter, (q,)."""
        posterior = np.sqrt(np.maximum(np.diag(self.S_inverse), 0.0))
        return np.where(self.estimated, posterior, 1 / np.sqrt(self.precision))


def step(sums: Sums, to_prior: FloatArray, precision: FloatArray, always: BoolArray) -> Step:
    """Solve the normal equations; `to_prior` (q,) prior mean minus value, `precision` (q,), `always` (q,) bool."""
    A_inverse = np.linalg.inv(sums.A)
    K = -A_inverse @ sums.E
    S = sums.G + np.diag(precision) + np.einsum("pak,pal->kl", sums.E, K)
    g = sums.g_t + precision * to_prior + np.einsum("pak,pa->k", K, sums.g_h)
    posterior = np.sqrt(np.abs(np.diag(np.linalg.inv(S)))) if len(S) else np.zeros(0)
    estimated = (posterior * np.sqrt(precision) < CONSIDERED) | always
    S_inverse = np.zeros_like(S)
    chosen = np.ix_(estimated, estimated)
    S_inverse[chosen] = np.linalg.inv(S[chosen])
    remaining = g - S[:, ~estimated] @ to_prior[~estimated]
    theta = S_inverse @ (estimated * remaining) + np.where(estimated, 0.0, to_prior)
    h = np.einsum("pab,pb->pa", A_inverse, sums.g_h) + K @ theta
    inverse = np.asarray(A_inverse, dtype=float)
    return Step(h, theta, inverse, K, S, S_inverse, np.asarray(estimated), precision)
