"""Mains pick-up on the excitation line: its size is known from the other runs, its phase is not.

At 50 Hz excitation the mains line cannot be fitted apart. But the campaign's other runs show how
large the pick-up of every probe is, and it is constant; only its phase differs from run to run. So
each run has one unknown angle per probe instead of an unknown vector, and six directions give more
equations than unknowns: H and the angles are found together by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tpjb_ident.dynamic.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.conditions import Condition
from tpjb_ident.dynamic.errors_in_variables import repeats
from tpjb_ident.dynamic.ols import ols_fit
from tpjb_ident.dynamic.phasor_table import phasor_table
from tpjb_ident.dynamic.point_data import PointData
from tpjb_ident.dynamic.run_phasors import RunPhasors
from tpjb_ident.dynamic.stiffness import DynamicStiffness

MAINS_ON_LINE = "mains on excitation line"
#: Runs that must show the pick-up apart from the excitation before its size counts as known.
MIN_RUNS = 6
_STARTS = 16
_SEED = 5060
#: Degrees of freedom with which the scatter seen at the other points is believed.
_PRIOR_DOF = 8.0


@dataclass(frozen=True)
class Pickup:
    """Mains pick-up of the displacement probes.

    Attributes
    ----------
    size : (m,) ndarray
        Amplitude per probe [m].
    directions : (m, 2) ndarray
        cos and sin of every probe's axis.
    runs : int
        How many runs it was seen in.
    """

    size: FloatArray
    directions: FloatArray
    runs: int


def mains_pickup(runs: list[RunPhasors], axes: FloatArray) -> Pickup | None:
    """Size of the mains line in every probe, from runs where nothing else sits on it.

    Parameters
    ----------
    runs : list of RunPhasors
    axes : (m,) ndarray
        Probe axes [rad].
    """
    directions = np.stack([np.cos(axes), np.sin(axes)], axis=1)
    seen = []
    for run in runs:
        names = [line.name for line in run.lines.nuisance]
        if "mains" not in names or _shared(run, names.index("mains")):
            continue
        z = run.displacement.phasors[:, len(run.lines.excitation) + names.index("mains")]
        z = z[np.isfinite(z).all(axis=1)]
        if len(z):
            seen.append(np.abs(directions @ _median(z)))
    if len(seen) < MIN_RUNS:
        return None
    return Pickup(np.median(seen, axis=0), directions, len(seen))


def _shared(run: RunPhasors, index: int) -> bool:
    """Whether a drive harmonic was merged into the mains line of this run."""
    mains = run.lines.nuisance[index]
    return any(abs(n * e.frequency - mains.frequency) <= mains.wander for e in run.lines.excitation for n in (2, 3))


def _median(z: ComplexArray) -> ComplexArray:
    return np.asarray(np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0))


@dataclass(frozen=True)
class MainsFit:
    """Pick-up of every run of a point, found together with H.

    Attributes
    ----------
    pickup : (n_runs, 2) complex ndarray
        X and Y share of the measured displacement [m].
    covariance : (8, 8) ndarray
        What not knowing the angles leaves in H [N^2/m^2].
    dof : float
    chi_square : float
        Against the scatter between runs that the campaign shows elsewhere, 4 degrees of freedom per
        four equations to spare.
    """

    pickup: ComplexArray
    covariance: FloatArray
    dof: float
    chi_square: float


def fit_mains(data: PointData, pickup: Pickup, scatter: float) -> MainsFit | None:
    """Find the pick-up's angles of all runs of a point.

    Parameters
    ----------
    data : PointData
    pickup : Pickup
    scatter : float
        Standard deviation of a run's force residual relative to its force, as other points show it.

    Returns
    -------
    MainsFit or None
        None when there are too few runs for it.
    """
    means = _direction_means(data)
    if means is None:
        return None
    D, F = means
    unknowns = 8 + len(pickup.size) * len(D)
    spare = 4 * len(D) - unknowns
    if spare < 1:
        return None
    problem = _Problem(D, F, pickup, scatter * np.linalg.norm(F, axis=1))
    solutions = problem.solve()
    if not solutions:
        return None
    cost, x, jacobian = solutions[0]
    inflation = (_PRIOR_DOF + cost) / (_PRIOR_DOF + spare)
    covariance = problem.covariance(jacobian) * inflation
    # Other minima that are nearly as good are other answers: their distance is uncertainty too.
    weights = np.exp(-0.5 * np.array([c - cost for c, _, _ in solutions]) / inflation)
    for weight, (_, other, _) in zip(weights / weights.sum(), solutions):
        step = problem.entries(other) - problem.entries(x)
        covariance = covariance + weight * np.outer(step, step)
    return MainsFit(problem.vectors(x), covariance, _PRIOR_DOF + spare, cost / spare)


def _direction_means(data: PointData) -> tuple[ComplexArray, ComplexArray] | None:
    """Robust mean of every run's windows; None when a run has none left."""
    table = phasor_table(data.D, data.F, data.run_index)
    if table.n_directions < len(data.runs):
        return None
    good = np.zeros(len(table))
    for i in range(table.n_directions):
        mine = table.direction == i
        size = np.abs(table.D[mine] - _median(table.D[mine])) + np.abs(table.F[mine] - _median(table.F[mine]))
        size = size.max(axis=1)
        good[mine] = size <= 4 * np.median(size)
    averaged = repeats(table, good, rounds=1)
    if averaged is None or len(averaged.means) < len(data.runs):
        return None
    return averaged.means.D * table.d_scale, averaged.means.F * table.f_scale


@dataclass(frozen=True)
class _Problem:
    """Least squares for H (8 real numbers) and one angle per run and probe.

    Attributes
    ----------
    D, F : (g, 2) complex ndarray
    pickup : Pickup
    sigma : (g,) ndarray
        Of a run's force residual [N].
    """

    D: ComplexArray
    F: ComplexArray
    pickup: Pickup
    sigma: FloatArray

    @property
    def scale(self) -> float:
        return float(np.linalg.norm(self.F) / np.linalg.norm(self.D))

    def h(self, x: FloatArray) -> ComplexArray:
        return np.asarray((x[:4] + 1j * x[4:8]).reshape(2, 2) * self.scale, dtype=complex)

    def entries(self, x: FloatArray) -> FloatArray:
        return x[:8] * self.scale

    def vectors(self, x: FloatArray) -> ComplexArray:
        """Pick-up of every run in X, Y [m]."""
        angle = x[8:].reshape(len(self.D), -1)
        return np.asarray((self.pickup.size * np.exp(1j * angle)) @ np.linalg.pinv(self.pickup.directions).T)

    def residual(self, x: FloatArray) -> FloatArray:
        r = (self.F - (self.D - self.vectors(x)) @ self.h(x).T) / self.sigma[:, None]
        return np.sqrt(2.0) * np.concatenate([r.real.ravel(), r.imag.ravel()])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """D residual / d x, shape (4 g, 8 + g m)."""
        g, m = len(self.D), len(self.pickup.size)
        h, clean = self.h(x), self.D - self.vectors(x)
        slope = np.zeros((g, 2, 8 + g * m), dtype=complex)
        for a in range(2):
            for b in range(2):
                column = -self.scale * clean[:, b] / self.sigma
                slope[:, a, 2 * a + b] = column
                slope[:, a, 4 + 2 * a + b] = 1j * column
        angle = x[8:].reshape(g, m)
        turn = 1j * self.pickup.size * np.exp(1j * angle)
        push = h @ np.linalg.pinv(self.pickup.directions)
        for k in range(m):
            rows = np.arange(g)
            slope[rows, :, 8 + rows * m + k] = turn[:, k, None] * push[:, k] / self.sigma[:, None]
        flat = slope.reshape(2 * g, -1)
        return np.sqrt(2.0) * np.concatenate([flat.real, flat.imag])

    def start(self, h: ComplexArray) -> FloatArray:
        """Unknowns for a given H: the angles are those of what H leaves of the displacements."""
        left = self.D - np.linalg.solve(h, self.F.T).T
        angle = np.angle(left @ self.pickup.directions.T)
        scaled = h.ravel() / self.scale
        return np.concatenate([scaled.real, scaled.imag, angle.ravel()])

    def solve(self) -> list[tuple[float, FloatArray, FloatArray]]:
        """Distinct minima, best first, from the plain fit and from H values about it."""
        from scipy.optimize import least_squares

        rng = np.random.default_rng(_SEED)
        h = ols_fit(self.D, self.F)
        spread = 2 * np.linalg.norm(self.pickup.size) / np.sqrt(np.mean(np.abs(self.D) ** 2))
        found: list[tuple[float, FloatArray, FloatArray]] = []
        for i in range(_STARTS):
            wobble = rng.standard_normal((2, 2)) + 1j * rng.standard_normal((2, 2))
            guess = h if i == 0 else h * (1 + 0.5 * spread * wobble)
            fit = least_squares(self.residual, self.start(guess), self.jacobian, method="lm", max_nfev=400)
            if fit.status > 0 and not any(np.abs(fit.x[:8] - x[:8]).max() < 1e-5 for _, x, _ in found):
                found.append((2.0 * float(fit.cost), fit.x, fit.jac))
        return sorted(found, key=lambda minimum: minimum[0])

    def covariance(self, jacobian: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.pinv(jacobian.T @ jacobian)[:8, :8] * self.scale**2)


def without_mains(data: PointData, fit: MainsFit) -> PointData:
    """The point's windows with the pick-up taken out of the displacements."""
    return replace(data, D=data.D - fit.pickup[data.run_index])


def with_mains_uncertainty(est: DynamicStiffness, fit: MainsFit) -> DynamicStiffness:
    """Add what the angles' uncertainty leaves in H."""
    if not np.isfinite(est.h).all():
        return est
    total = est.covariance + fit.covariance
    return replace(est, covariance=total, dof=np.minimum(est.dof, fit.dof))


def corrected_condition(pickup: Pickup, fit: MainsFit) -> Condition:
    """What was done about it."""
    size = ", ".join(f"{1e6 * s:.3g} um" for s in pickup.size)
    return Condition(
        "mains corrected",
        f"pick-up of {size} known from {pickup.runs} other runs, its phase fitted per run "
        f"(reduced chi-square {fit.chi_square:.2g}); intervals widened for it",
    )


def relative_scatter(points: list[PointData], first: list[DynamicStiffness]) -> float:
    """Typical force residual of a run's mean, relative to its force, where no mains disturbs."""
    sizes = []
    for data, est in zip(points, first):
        struck = any(MAINS_ON_LINE in run.conditions for run in data.runs)
        if struck or not np.isfinite(est.h).all() or len(data.runs) < 3:
            continue
        means = _direction_means(data)
        if means is None:
            continue
        D, F = means
        residual = (F - D @ est.h.T) / np.linalg.norm(F, axis=1)[:, None]
        sizes.append(np.mean(np.abs(residual) ** 2) * len(D) / (len(D) - 2))
    return float(np.sqrt(np.median(sizes))) if sizes else 0.003
