"""Mains pick-up on the excitation line: its size is known from the other runs, its phase is not.

At 50 Hz excitation the mains line cannot be fitted apart. But the campaign's other runs show how large the pick-up of
every probe is, and it is constant; only its phase differs from run to run. So each run has one unknown angle per probe
instead of an unknown vector, and six directions give more equations than unknowns: H and the angles are found together
by least squares. That has many minima, so it is no term of the linear solve: what it finds is taken off the readings
before the solve, and what the angles leave uncertain is its own share of the budget.
"""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.arrowhead import complex_matrix, real_numbers

MAINS_ON_LINE = "mains on excitation line"
MAINS_CORRECTED = "mains corrected"
#: Runs that must show the pick-up apart from the excitation before its size counts as known.
MIN_RUNS = 6
#: How well the probes' phases must agree over the runs to count as one pattern.
_LOCKED = 0.95
#: Along a pattern every run leaves one real equation, and H has four numbers there.
_MIN_DIRECTIONS = 4
#: Degrees of freedom with which the scatter seen at the other points is believed.
_PRIOR_DOF = 8.0
#: Starts about the plain fit, rounds in which they are run down, best ones that are polished, in so many rounds at
#: most, and their seed.
_STARTS = 2000
_SWEEPS = 25
_POLISHED = 30
_ROUNDS = 100
_SEED = 5060


@dataclass(frozen=True)
class Pickup:
    """Mains pick-up of the displacement probes, known but for angles."""

    patterns: ComplexArray  #: (m, 2) complex
    size: FloatArray  #: (probes,), m: amplitude per probe
    runs: int


def mains_pickup(lines: Sequence[ComplexArray | None], axes: FloatArray) -> Pickup | None:
    """Size of the mains line in every probe, from runs where nothing else is on it; `axes` (m,) [rad]."""
    along = directions(axes)
    pickups = [along @ line for line in lines if line is not None]
    if len(pickups) < MIN_RUNS:
        return None
    probes = np.array(pickups)
    size = np.median(np.abs(probes), axis=0)
    back = np.linalg.pinv(along).T
    relative = probes * np.exp(-1j * np.angle(probes[:, :1]))
    locked = np.abs(np.exp(1j * np.angle(relative)).mean(axis=0)).min() > _LOCKED
    if locked:
        return Pickup((size * np.exp(1j * np.angle(relative.mean(axis=0))))[None] @ back, size, len(pickups))
    return Pickup(size[:, None] * back, size, len(pickups))


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

    @functools.cached_property
    def scale(self) -> float:
        """What H is divided by among the unknowns [N/m]."""
        return float(np.linalg.norm(self.F) / np.linalg.norm(self.D))

    def h(self, x: FloatArray) -> ComplexArray:
        """H of the unknowns, (2, 2) [N/m]; `x` (8 + g m,)."""
        return complex_matrix(self.entries(x))

    def entries(self, x: FloatArray) -> FloatArray:
        """The eight real entries of H [N/m]; `x` (8 + g m,)."""
        return x[:8] * self.scale

    def vectors(self, x: FloatArray) -> ComplexArray:
        """Disturbance of every run in X, Y, (g, 2) [m]; `x` (8 + g m,)."""
        return np.exp(1j * x[8:].reshape(len(self.D), -1)) @ self.patterns

    def residual(self, x: FloatArray) -> FloatArray:
        """Weighted residuals, (4 g,); `x` (8 + g m,)."""
        r = (self.F - (self.D - self.vectors(x)) @ self.h(x).T) / self.sigma[:, None]
        return np.sqrt(2.0) * np.concatenate([r.real.ravel(), r.imag.ravel()])

    def start(self, h: ComplexArray) -> FloatArray:
        """Unknowns for a given H: the angles are those of what H leaves of the displacements; `h` (2, 2) [N/m]."""
        return np.concatenate([real_numbers(h) / self.scale, self._angles(h).ravel()])

    def _angles(self, h: ComplexArray) -> FloatArray:
        """Angles for given H, batched: (..., 2, 2) -> (..., g, m)."""
        remaining = self.D - self.F @ np.swapaxes(np.linalg.inv(h), -1, -2)
        return np.angle(remaining @ np.linalg.pinv(self.patterns))

    def solve(self) -> list[Minimum]:
        """Distinct minima, best first.

        Many starts about the plain fit are run down by turns (angles for H, H for angles), all at once;
        the best of them are polished.
        """
        from scipy.optimize import least_squares

        minima: list[Minimum] = []
        for h in self._candidates():
            start = self.start(h)
            fit = least_squares(self.residual, start, method="lm", max_nfev=_ROUNDS * len(start))
            if fit.status <= 0 or any(np.abs(fit.x[:8] - m.x[:8]).max() < 1e-5 for m in minima):
                continue
            normal = fit.jac.T @ fit.jac
            log_volume = -0.5 * np.linalg.slogdet(normal)[1]
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
        remaining = self.F * weight - clean @ np.swapaxes(h, -1, -2)
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


@dataclass(frozen=True)
class MainsFit:
    """Pick-up of every run of a point, found together with H."""

    known: Pickup  #: what the other runs tell of it
    pickup: ComplexArray  #: (n_runs, 2) complex, m: X and Y share of the measured displacement at the best minimum
    shift: FloatArray  #: (8,), N/m: from H at the best minimum to the mean over all
    covariance: FloatArray  #: (8, 8), N^2/m^2: what not knowing the angles leaves in H
    dof: float
    chi_square: float

    def condition(self) -> Condition:
        """What was done about it."""
        size = ", ".join(f"{1e6 * s:.3g} um" for s in self.known.size)
        return Condition(
            MAINS_CORRECTED,
            f"pick-up of {size} known from {self.known.runs} other runs, its phase fitted per run "
            f"(reduced chi-square {self.chi_square:.2g}); intervals widened for it",
        )


def fit_mains(D: ComplexArray, F: ComplexArray, pickup: Pickup, scatter: float) -> MainsFit | None:
    """Find the pick-up's angles of all runs of a point.

    `D`, `F` (n_runs, 2): means of displacement [m] and oil force [N] as at the set point; `scatter`: of the force from
    run to run, relative. None where the runs leave no equation to spare.
    """
    spare = 4 * len(D) - 8 - len(pickup.patterns) * len(D)
    if spare < 1 or len(D) < _MIN_DIRECTIONS or not np.isfinite(D).all() or not np.isfinite(F).all():
        return None
    problem = MainsEquations(D, F, pickup.patterns, scatter * np.linalg.norm(F, axis=1))
    if not (minima := problem.solve()):
        return None
    cost = minima[0].cost
    inflation = (_PRIOR_DOF + cost) / (_PRIOR_DOF + spare)
    # Other minima that are nearly as good are other answers: the mean of all, each by its probability.
    log_share = np.array([m.log_volume - 0.5 * (m.cost - cost) / inflation for m in minima])
    share = np.exp(log_share - log_share.max())
    share /= share.sum()
    entries = np.array([problem.entries(m.x) for m in minima])
    mean = share @ entries
    covariance = (entries - mean).T @ ((entries - mean) * share[:, None])
    for weight, minimum in zip(share, minima):
        covariance = covariance + weight * inflation * minimum.covariance
    vectors = problem.vectors(minima[0].x)
    return MainsFit(pickup, vectors, mean - entries[0], covariance, _PRIOR_DOF + spare, cost / spare)


def force_pickup(lines: Iterable[ComplexArray | None]) -> FloatArray:
    """Usual size of the mains line in the oil force, X and Y (2,) [N], from runs where nothing else is on it."""
    sizes = [np.abs(line) for line in lines if line is not None]
    return np.median(sizes, axis=0) if sizes else np.zeros(2)


def force_pickup_spread(D: ComplexArray, size: FloatArray) -> FloatArray:
    """Covariance (8, 8) that mains in the cells leaves in H: its phase is another one in every run [N^2/m^2].

    `D` (n_runs, 2) [m], `size` (2,) [N].
    """
    inverse = np.linalg.pinv(D.conj().T @ D).real.diagonal()
    variance = 0.5 * np.outer(size**2, inverse).ravel()
    return np.diag(np.tile(variance, 2))
