"""Mains pick-up on the excitation line: its size is known from the other runs, its phase is not.

At 50 Hz excitation the mains line cannot be fitted apart. But the campaign's other runs show how large the pick-up of
every probe is, and it is constant; only its phase differs from run to run. So each run has one unknown angle per probe
instead of an unknown vector, and six directions give more equations than unknowns: H and the angles are found together
by least squares. That has many minima, so it is no term of the linear solve: what it finds is taken off the readings
before the solve, and what the angles leave uncertain is its own share of the budget.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions
from tpjb_ident.conditions import Condition
from tpjb_ident.terms.mains_angles import MainsEquations

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
class MainsFit:
    """Pick-up of every run of a point, found together with H."""

    pickup: ComplexArray  #: (n_runs, 2) complex, m: X and Y share of the measured displacement at the best minimum
    shift: FloatArray  #: (8,), N/m: from H at the best minimum to the mean over all
    covariance: FloatArray  #: (8, 8), N^2/m^2: what not knowing the angles leaves in H
    dof: float
    chi_square: float

    @property
    def change(self) -> ComplexArray:
        """The shift as a matrix, (2, 2) [N/m]."""
        return (self.shift[:4] + 1j * self.shift[4:]).reshape(2, 2)

    def condition(self, pickup: Pickup) -> Condition:
        """What was done about it."""
        size = ", ".join(f"{1e6 * s:.3g} um" for s in pickup.size)
        return Condition(
            MAINS_CORRECTED,
            f"pick-up of {size} known from {pickup.runs} other runs, its phase fitted per run "
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
