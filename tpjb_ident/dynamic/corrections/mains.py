"""Mains pick-up on the excitation line: its size is known from the other runs, its phase is not.

At 50 Hz excitation the mains line cannot be fitted apart. But the campaign's other runs show how
large the pick-up of every probe is, and it is constant; only its phase differs from run to run. So
each run has one unknown angle per probe instead of an unknown vector, and six directions give more
equations than unknowns: H and the angles are found together by least squares.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.corrections.mains_angles import MainsEquations
from tpjb_ident.dynamic.estimators.errors_in_variables import repeats
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median

MAINS_ON_LINE = "mains on excitation line"
MAINS_CORRECTED = "mains corrected"
#: Runs that must show the pick-up apart from the excitation before its size counts as known.
MIN_RUNS = 6
#: How well the probes' phases must agree over the runs to count as one pattern.
LOCKED = 0.95
#: Along a pattern every run leaves one real equation, and H has four numbers there.
_MIN_DIRECTIONS = 4
#: Degrees of freedom with which the scatter seen at the other points is believed.
_PRIOR_DOF = 8.0


@dataclass(frozen=True)
class Pickup:
    """Mains pick-up of the displacement probes, known but for angles."""

    patterns: ComplexArray  #: (m, 2) complex
    size: FloatArray  #: (probes,), m: amplitude per probe
    runs: int


def mains_pickup(lines: Sequence[ComplexArray | None], axes: FloatArray) -> Pickup | None:
    """Size of the mains line in every probe, from runs where nothing else sits on it; `axes` (m,) [rad]."""
    along = directions(axes)
    pickups = [along @ line for line in lines if line is not None]
    if len(pickups) < MIN_RUNS:
        return None
    probes = np.array(pickups)
    size = np.median(np.abs(probes), axis=0)
    back = np.linalg.pinv(along).T
    relative = probes * np.exp(-1j * np.angle(probes[:, :1]))
    locked = np.abs(np.exp(1j * np.angle(relative)).mean(axis=0)).min() > LOCKED
    if locked:
        return Pickup((size * np.exp(1j * np.angle(relative.mean(axis=0))))[None] @ back, size, len(pickups))
    return Pickup(size[:, None] * back, size, len(pickups))


@dataclass(frozen=True)
class MainsFit:
    """Pick-up of every run of a point, found together with H."""

    pickup: ComplexArray  #: (n_runs, 2) complex, m: X and Y share of the measured displacement at the best minimum
    shift: FloatArray  #: (8,), N/m
    covariance: FloatArray  #: (8, 8), N^2/m^2: what not knowing the angles leaves in H
    dof: float
    chi_square: float


def fit_mains(data: PointData, pickup: Pickup, scatter: float) -> MainsFit | None:
    """Find the pick-up's angles of all runs of a point."""
    means = _direction_means(data)
    if means is None:
        return None
    D, F = means
    spare = 4 * len(D) - 8 - len(pickup.patterns) * len(D)
    if spare < 1 or len(D) < _MIN_DIRECTIONS:
        return None
    problem = MainsEquations(D, F, pickup.patterns, scatter * np.linalg.norm(F, axis=1))
    minima = problem.solve()
    if not minima:
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
    best = minima[0].x
    shift = mean - problem.entries(best)
    return MainsFit(problem.vectors(best), shift, covariance, _PRIOR_DOF + spare, cost / spare)


def _direction_means(data: PointData) -> tuple[ComplexArray, ComplexArray] | None:
    """Robust mean of every run's windows; None when a run has none left."""
    table = phasor_table(data.D, data.F, data.run_index)
    if table.n_directions < len(data.runs):
        return None
    good = np.zeros(len(table))
    for i in range(table.n_directions):
        selected = table.direction == i
        size = np.abs(table.D[selected] - complex_median(table.D[selected])) + np.abs(
            table.F[selected] - complex_median(table.F[selected])
        )
        size = size.max(axis=1)
        good[selected] = size <= 4 * np.median(size)
    averaged = repeats(table, good, rounds=1)
    if averaged is None or len(averaged.means) < len(data.runs):
        return None
    return averaged.means.D * table.d_scale, averaged.means.F * table.f_scale


def without_mains(data: PointData, fit: MainsFit) -> PointData:
    """The point's windows with the pick-up taken out of the displacements."""
    return replace(data, D=data.D - fit.pickup[data.run_index])


def with_mains_uncertainty(est: DynamicStiffness, fit: MainsFit) -> DynamicStiffness:
    """Move an estimate to the mean over the possible angles, and add what they leave uncertain."""
    if not np.isfinite(est.h).all():
        return est
    total = est.covariance + fit.covariance
    moved = est.h + (fit.shift[:4] + 1j * fit.shift[4:]).reshape(2, 2)
    return replace(est, h=moved, covariance=total, dof=np.minimum(est.dof, fit.dof))


def corrected_condition(pickup: Pickup, fit: MainsFit) -> Condition:
    """What was done about it."""
    size = ", ".join(f"{1e6 * s:.3g} um" for s in pickup.size)
    return Condition(
        MAINS_CORRECTED,
        f"pick-up of {size} known from {pickup.runs} other runs, its phase fitted per run "
        f"(reduced chi-square {fit.chi_square:.2g}); intervals widened for it",
    )


def relative_scatter(points: Iterable[PointData], first: list[DynamicStiffness]) -> float:
    """Typical force residual of a run's mean, relative to its force, where no mains disturbs."""
    sizes = []
    for data, est in zip(points, first):
        coincident = any(MAINS_ON_LINE in run.conditions for run in data.runs)
        if coincident or not np.isfinite(est.h).all() or len(data.runs) < 3:
            continue
        means = _direction_means(data)
        if means is None:
            continue
        D, F = means
        residual = (F - D @ est.h.T) / np.linalg.norm(F, axis=1)[:, None]
        sizes.append(np.mean(np.abs(residual) ** 2) * len(D) / (len(D) - 2))
    return float(np.sqrt(np.median(sizes))) if sizes else 0.003


def force_pickup(lines: Iterable[ComplexArray | None]) -> FloatArray:
    """Usual size of the mains line in the oil force, X and Y (2,) [N], from runs where nothing else sits on it."""
    sizes = [np.abs(line) for line in lines if line is not None]
    return np.median(sizes, axis=0) if sizes else np.zeros(2)


def force_pickup_spread(data: PointData, size: FloatArray) -> FloatArray:
    """Covariance (8, 8) that mains in the cells leaves in H: its phase is another one in every run [N^2/m^2].

    `size` (2,).
    """
    means = _direction_means(data)
    if means is None:
        return np.zeros((8, 8))
    D, _ = means
    inverse = np.linalg.pinv(D.conj().T @ D).real.diagonal()
    variance = 0.5 * np.outer(size**2, inverse).ravel()
    return np.diag(np.tile(variance, 2))
