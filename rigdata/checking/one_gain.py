"""The one run of an operating point in which one probe or cell reads some per cent too much or too little.

A gain is named where phasors and means together leave no room for chance, the phasors show it by themselves, the means
do not contradict it, and nothing else in the run is strange. So a wandering position, a load that missed its set point
or a warmer bearing names nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.checking.gain_evidence import (
    Difference,
    Evidence,
    PointReadings,
    common_stiffness,
    dynamic_difference,
    dynamic_pattern,
    lever_slack,
    static_difference,
)

#: Probability of naming anything in an operating point without fault.
_CHANCE = 1e-4
#: The phasors must show the gain themselves, with this probability of chance at most.
_PHASORS_SHOW = 0.05
#: Rest that a lone gain may leave, per equation in units of its covariance: 1 % of honest runs leave more.
_STRANGE = 6.0
#: The two estimates may differ by this many standard deviations.
_AGREE = 3.0
#: Smaller gains are no fault: calibrations promise no more.
_LEAST = 0.01
#: Another channel explains a run as well if its chance is not this many times greater.
_AS_WELL = 1e3
#: Runs needed, and the share of them that can be at fault.
_MIN_RUNS, _MOST = 4, 1 / 3


@dataclass(frozen=True)
class WrongGain:
    """A gain that one channel has in one run only.

    Attributes
    ----------
    run : int
        Its place among the runs.
    channels : tuple of int
        Probes 0 and 1, cells 2 and 3; the likeliest first, then those that would explain the run as well.
    gain : float
        Reading over truth of the first.
    error : float
        Standard error of the gain.
    means : bool
        Whether the mean readings speak for it too.
    """

    run: int
    channels: tuple[int, ...]
    gain: float
    error: float
    means: bool


@dataclass(frozen=True)
class _Try:
    """One channel's explanation of a run."""

    chance: float
    channel: int
    joint: Evidence
    means: bool


def wrong_gains(
    readings: PointReadings, centre: Sequence[float | None] = (None, None), known: Collection[int] = ()
) -> list[WrongGain]:
    """Find runs with one wrong gain, the clearest first.

    Parameters
    ----------
    readings : PointReadings
    centre : sequence of float or None
        What each probe reads at the bearing's centre [m], None where not known. A gain may count from there, or, as
        that of an amplifier, from 0 V.
    known : collection of int
        Runs that are at fault already; nothing is held against them.

    Returns
    -------
    list of WrongGain
        Empty for fewer than four runs; a third of them at most, with the known ones.
    """
    count, apart, found = len(readings.probes), set(known), list[WrongGain]()
    while len(apart) + 1 <= _MOST * count:
        left = [i for i in range(count) if i not in apart]
        if len(left) < _MIN_RUNS:
            break
        tried = [(t.chance, i, t) for i in left for t in _tries(readings, i, [j for j in left if j != i], centre)]
        tried.sort(key=lambda entry: entry[0])
        # each run is tried with two cells and two probes, a probe with two zeros
        if not tried or tried[0][0] > _CHANCE / (6 * len(left)):
            break
        chance, run, best = tried[0]
        alike = dict.fromkeys(t.channel for c, i, t in tried if i == run and c <= max(_AS_WELL * chance, 1e-300))
        gain = 1 / (1 - best.joint.part)
        error = gain**2 / float(np.sqrt(best.joint.information))
        found.append(WrongGain(run, tuple(alike), gain, error, best.means))
        apart.add(run)
    return found


def _tries(readings: PointReadings, one: int, others: Sequence[int], centre: Sequence[float | None]) -> Iterator[_Try]:
    """Explanations of run `one` by one channel's gain that hold by all rules but the probability."""
    dynamic, static = dynamic_difference(readings, one, others), static_difference(readings, one, others)
    stiffness = common_stiffness(readings, others)
    if dynamic is None or stiffness is None:
        return
    for channel in range(4):
        pattern = dynamic_pattern(readings, one, channel, stiffness)
        shown = dynamic.evidence(pattern)
        if shown.chance() > _PHASORS_SHOW or shown.part >= 0.9:
            continue
        for lever, slack in _levers(readings, one, channel, centre, shown.part):
            joint, means = _with_means(static, channel, lever, slack, shown)
            if joint is None or abs(joint.part) < _LEAST or dynamic.misfit(pattern, joint.part) > _STRANGE:
                continue
            yield _Try(joint.chance(), channel, joint, means)


def _levers(
    readings: PointReadings, one: int, channel: int, centre: Sequence[float | None], part: float
) -> Iterator[tuple[float | None, float]]:
    """Readings that a gain would multiply in the mean, with the uncertainty of the shift; None where not known."""
    if channel >= 2:
        yield float(readings.cell_means[one, channel - 2]), 0.0
        return
    mean, zero = float(readings.probe_means[one, channel]), centre[channel]
    yield mean, 0.0
    yield (None, 0.0) if zero is None else (mean - zero, lever_slack(mean - zero, part))


def _with_means(
    static: Difference | None, channel: int, lever: float | None, slack: float, shown: Evidence
) -> tuple[Evidence | None, bool]:
    """Join what the means say of a channel; None where they contradict its gain."""
    if static is None or lever is None:
        return shown, False
    pattern = np.where(np.arange(4) == channel, lever, 0.0)
    widened = static.widened(channel, slack)
    told = widened.evidence(pattern)
    if told.information <= 0:
        return shown, False
    apart = abs(told.part - shown.part) / np.sqrt(1 / told.information + 1 / shown.information)
    joint = shown.joined(told)
    if apart > _AGREE or widened.misfit(pattern, joint.part) > _STRANGE:
        return None, False
    return joint, told.chance() < _PHASORS_SHOW
