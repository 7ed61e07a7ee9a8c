"""What a dynamic run answers to the force: its phasors, and the matrix that the runs of a point share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rigdata.calibration import Channel
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.check.gain_evidence import stiffness_of
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import excited, oil_force, to_plane


@dataclass(frozen=True)
class Answer:
    """One dynamic run: force and displacement phasors.

    Attributes
    ----------
    seen : Observation
    force : (2,) complex ndarray
        X, Y [N].
    readings : (2,) complex ndarray
        Of the two displacement channels, SI.
    channels : tuple of Channel
        These two.
    """

    seen: Observation
    force: ComplexArray
    readings: ComplexArray
    channels: tuple[Channel, ...]

    @property
    def displacement(self) -> ComplexArray:
        """X, Y [m]."""
        return to_plane(self.channels, self.readings)


def answer_of(seen: Observation, mass: float) -> Answer | None:
    """Take the phasors of a run; None where it does not show them, or its force is in doubt already.

    Parameters
    ----------
    seen : Observation
    mass : float
        Of the housing [kg]; NaN where not stated.
    """
    where = seen.pick("displacement")
    force = oil_force(seen, mass)
    if len(where) != 2 or force is None or seen.lines is None or "force" in seen.report.doubts or not excited(seen):
        return None
    readings = seen.lines.phasor[where]
    if not np.all(np.isfinite(readings)) or not np.any(np.abs(readings) > 8 * seen.lines.floor[where]):
        return None
    return Answer(seen, force, readings, tuple(seen.channels[i] for i in where))


def solve_stiffness(answers: Sequence[Answer]) -> ComplexArray | None:
    """H of ``F = H D``, least squares; None where the runs excite one direction only.

    Parameters
    ----------
    answers : sequence of Answer
    """
    return stiffness_of(np.stack([a.displacement for a in answers]), np.stack([a.force for a in answers]))


def misfit_of(answer: Answer, stiffness: ComplexArray, repair: FloatArray | None = None) -> float:
    """Share of the force that H does not explain, after a repair (2, 2) of the displacement readings.

    Parameters
    ----------
    answer : Answer
    stiffness : (2, 2) complex ndarray
        H [N/m].
    repair : (2, 2) ndarray, optional
        On the readings of the two channels.
    """
    readings = answer.readings if repair is None else repair @ answer.readings
    predicted = stiffness @ to_plane(answer.channels, readings)
    return float(np.linalg.norm(answer.force - predicted) / np.linalg.norm(answer.force))


def robust_stiffness(group: Sequence[Answer]) -> ComplexArray | None:
    """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it.

    Parameters
    ----------
    group : sequence of Answer
        Runs of one operating point.
    """
    best: tuple[float, ComplexArray] | None = None
    for pair in combinations(group[:24], 2):
        stiffness = solve_stiffness(pair)
        if stiffness is None:
            continue
        misfit = float(np.median([misfit_of(a, stiffness) for a in group]))
        if best is None or misfit < best[0]:
            best = (misfit, stiffness)
    if best is None:
        return None
    close = [a for a in group if misfit_of(a, best[1]) <= max(3 * best[0], 1e-9)]
    refined = solve_stiffness(close)
    return best[1] if refined is None else refined
