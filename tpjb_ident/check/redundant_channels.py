"""Channels beyond the two that a plane needs, held against each other at the excitation line.

Probes in two planes, or four load cells: their readings are the projections of one vector, so m channels leave m - 2
conditions that no motion of a rigid shaft breaks. What is left is a gain of one channel, or a shaft that tilts between
the planes; the records do not tell which. The mean of the planes may be off by as much as each differs from it, so
half of a difference is taken as the half-width of a rectangle (GUM 4.3.7) in the uncertainty of the channels' gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from rigdata.vector import directions
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import excited

#: Gain uncertainty of a channel for which the manifest states none, as `[tolerances] probe_gain` has it.
_USUAL_GAIN = 0.005
#: Differences of so many standard deviations of the stated uncertainties are told.
_CLEAR = 3.0
#: A difference that stands this many standard errors above the scatter of the runs is no noise.
_SEEN = 4.0
_MIN_RUNS = 3
#: Difference of gains beyond any calibration: an axis, a sign or a cable is wrong.
_NO_GAIN = 0.3
#: A channel below this share of the largest is dead, which is told elsewhere.
_DEAD = 1e-3
#: From a rectangle's half-width, shared by the two channels of a pair, to the standard deviation of each.
_RECTANGLE = math.sqrt(2.0 / 3.0)


@dataclass(frozen=True)
class InconsistentChannels:
    """Channels of one quantity that do not tell the same vector."""

    quantity: str
    names: tuple[str, ...]
    gains: FloatArray = field(repr=False)  #: (m,): least changes of their gains that make them agree

    def uncertainty(self) -> dict[str, float]:
        """Standard deviation of every channel's gain that comes from the difference."""
        return {n: _RECTANGLE * abs(float(g)) for n, g in zip(self.names, self.gains, strict=True) if g}

    def sentence(self) -> str:
        """Say which channel reads more than the others, and by how much."""
        order = np.argsort(self.gains)
        high, low = self.names[order[0]], self.names[order[-1]]
        apart = float(self.gains[order[-1]] - self.gains[order[0]])
        return (
            f"{high} reads {apart:.1%} more at the excitation than {low} and the others foretell, in all runs: a gain, "
            "or a shaft that tilts"
        )


def inconsistent_channels(runs: Sequence[Observation]) -> tuple[InconsistentChannels, ...]:
    """Find the quantities whose channels contradict each other in all runs alike."""
    inconsistent = []
    for quantity in ("displacement", "force"):
        groups: dict[tuple[str, ...], list[ComplexArray]] = {}
        by_names: dict[tuple[str, ...], list[Channel]] = {}
        for observation in runs:
            places = observation.pick(quantity)
            if len(places) < 3 or not excited(observation):
                continue
            names = tuple(observation.channels[i].name for i in places)
            by_names[names] = [observation.channels[i] for i in places]
            groups.setdefault(names, []).extend(z for z in observation.phasors[:, places] if np.isfinite(z).all())
        inconsistent += [
            a for names, z in groups.items() if (a := _apart(quantity, by_names[names], np.array(z))) is not None
        ]
    return tuple(inconsistent)


def _apart(quantity: str, channels: Sequence[Channel], phasors: ComplexArray) -> InconsistentChannels | None:
    """Judge the phasors (n, m) of one set of channels: one of every sine, several of an excitation over a band."""
    along = directions([float(c.axis or 0.0) for c in channels])
    size = np.median(np.abs(phasors), axis=0) if len(phasors) else np.zeros(len(channels))
    if len(phasors) < _MIN_RUNS or np.linalg.matrix_rank(along) < 2 or size.min() < _DEAD * size.max():
        return None
    plane = np.array([c.plane for c in channels])
    tilted = np.hstack([along, plane[:, None] * along])
    # (m, m - 2) or less: what neither a vector of the plane nor a tilt between the stated planes does
    outside = np.linalg.svd(tilted)[0][:, np.linalg.matrix_rank(tilted) :]
    if not outside.size:
        return None
    vectors = phasors @ np.linalg.pinv(along).T
    projected = vectors @ along.T
    # every run is one vote of its own size: beyond^T (gain * seen) = beyond^T phasor
    size = np.linalg.norm(projected, axis=1)
    design = np.concatenate([(outside.T * (s / n)) for s, n in zip(projected, size)])
    remaining = (phasors / size[:, None] @ outside).ravel()
    real, target = np.concatenate([design.real, design.imag]), np.concatenate([remaining.real, remaining.imag])
    inverse = np.linalg.pinv(real, rcond=1e-6)
    gains = inverse @ target
    spread = float(np.sum((target - real @ gains) ** 2)) / max(len(target) - np.linalg.matrix_rank(real), 1)
    noise = np.sqrt(np.diag(inverse @ inverse.T) * spread)
    stated = np.array([_USUAL_GAIN if c.uncertainty is None else c.uncertainty for c in channels])
    allowed = np.sqrt(np.diag((inverse @ real) @ np.diag(stated**2) @ (inverse @ real).T))
    if not (np.abs(gains) > np.maximum(_CLEAR * allowed, _SEEN * noise)).any():
        return None
    return InconsistentChannels(quantity, tuple(c.name for c in channels), -np.asarray(gains))


def report_inconsistent_channels(runs: Sequence[Observation]) -> None:
    """Warn of channels that contradict each other, and note what that adds to the uncertainty of their gains."""
    cure = "Calibrate them against each other, or state the `uncertainty` of their gains"
    for group in inconsistent_channels(runs):
        for report in {
            observation.run.id: observation.report for observation in runs if observation.pick(group.quantity)
        }.values():
            report.gains.update(group.uncertainty())
            place = f"channels {', '.join(group.names)}"
            severity: Severity = "error" if np.ptp(group.gains) > _NO_GAIN else "warning"
            report.say(f"apart {group.quantity}", severity, place, group.sentence(), cure)


def widened(channels: Mapping[str, Channel], more: Mapping[str, float]) -> dict[str, Channel]:
    """Channels with the uncertainty that their differences add to what the manifest states."""
    return {
        n: replace(c, uncertainty=math.hypot(c.uncertainty or 0.0, more[n])) if n in more else c
        for n, c in channels.items()
    }
