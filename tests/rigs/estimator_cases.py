"""A simulated situation for estimators: one H, eight directions, repeats, four kinds of faults; scores in it."""

from dataclasses import dataclass

import numpy as np

from tests.phasors.phasor_cases import complex_normal
from tests.rigs.closed_form import vector
from tpjb_ident.estimators.estimate import estimate_dynamic_stiffness

OMEGA = 2 * np.pi * 25.0
H_TRUE = np.array([[2.0e8, 2.0e7], [-1.5e7, 5.0e8]]) + 1j * OMEGA * np.array([[4.0e5, 2e4], [1e4, 6.0e5]])
TRUE = vector(H_TRUE)
#: Actual force = this times the command: 2-4 % cross-talk that nobody knows.
CROSS_TALK = np.array([[1.0, 0.03], [-0.02, 1.0]])
FORCE = 500.0
FORCE_NOISE = 0.02


@dataclass(frozen=True)
class Case:
    """One row of the study."""

    kind: str = ""
    share: float = 0.0
    relx: float = 0.05
    directions: int = 8
    windows: int = 20

    @property
    def name(self) -> str:
        fault = f"{self.kind} {100 * self.share:.0f} %" if self.kind else "clean"
        extra = f" relx {100 * self.relx:.0f} %" if self.relx != 0.05 else ""
        size = "" if (self.directions, self.windows) == (8, 20) else f" {self.directions}x{self.windows}"
        return fault + extra + size


@dataclass(frozen=True)
class Sample:
    """Phasors of one replicate: D, F, command (n, 2), direction (n,)."""

    D: np.ndarray
    F: np.ndarray
    direction: np.ndarray
    command: np.ndarray


def draw(case: Case, seed: int, replicate: int) -> Sample:
    """One replicate; `seed` and `replicate` fix it."""
    rng = np.random.default_rng([seed, replicate])
    span = 2 * np.pi if case.directions == 8 else np.pi
    angle = np.arange(case.directions) * span / case.directions
    phase = np.exp(2j * np.pi * rng.random(case.directions))
    command = FORCE * np.stack([np.cos(angle), np.sin(angle)], axis=1) * phase[:, None]
    force = command @ CROSS_TALK.T
    displacement = np.linalg.solve(H_TRUE, force.T).T
    rms = np.sqrt(np.mean(np.abs(displacement) ** 2))
    direction = np.repeat(np.arange(case.directions), case.windows)
    n = len(direction)
    F = force[direction] + FORCE_NOISE * FORCE / np.sqrt(2) * complex_normal(rng, n, 2)
    D = displacement[direction] + case.relx * rms * complex_normal(rng, n, 2)
    bad = rng.random(n) < case.share
    if case.kind == "force":
        F[bad] += _fault(rng, int(bad.sum()), FORCE)
    elif case.kind == "forcesys":
        F[bad] += _fault(rng, 1, FORCE)
    elif case.kind == "lev":
        D[bad] += _fault(rng, int(bad.sum()), rms)
    elif case.kind == "gain":
        D[bad] *= 0.4
    elif case.kind:
        raise ValueError(f"unknown kind of fault {case.kind!r}")
    return Sample(D, F, direction, command[direction])


def _fault(rng: np.random.Generator, n: int, unit: float) -> np.ndarray:
    """+3..10 units in a random direction with a random phase."""
    angle = 2 * np.pi * rng.random(n)
    size = unit * rng.uniform(3, 10, n) * np.exp(2j * np.pi * rng.random(n))
    return size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@dataclass(frozen=True)
class Score:
    """What one method does in one case."""

    rmse: float  #: ||H - H_true||_F / ||H_true||_F [%]
    bias: np.ndarray  #: (2,), of kxx, kyy [%]
    coverage: float  #: of the 95 % intervals, all entries [%]
    worst: float  #: largest relative error of any replicate [%]


def score(case: Case, method: str, replicates: int, seed: int) -> Score:
    """Run one method on `replicates` fresh draws."""
    name, _, norm = method.partition(":")
    errors, biases, inside = [], [], []
    for replicate in range(replicates):
        s = draw(case, seed, replicate)
        command = s.command if name == "iv" else None
        est = estimate_dynamic_stiffness(
            s.D, s.F, OMEGA, s.direction, method=name, norm=norm or None, reference=command
        )
        errors.append(np.linalg.norm(est.h - H_TRUE) / np.linalg.norm(H_TRUE))
        biases.append(np.diag(est.k) / np.diag(H_TRUE.real) - 1)
        lo, hi = est.interval(0.95)
        inside.append((lo <= TRUE) & (hi >= TRUE))
    return Score(
        100 * float(np.sqrt(np.mean(np.square(errors)))),
        100 * np.mean(biases, axis=0),
        100 * float(np.mean(inside)),
        100 * float(np.max(errors)),
    )
