"""The one run of an operating point in which one probe or cell reads some per cent too much or too little.

A gain is named where phasors and means together leave no room for chance, the phasors show it by themselves, the means
do not contradict it, and nothing else in the run is strange. So a wandering position, a load that missed its set point
or a warmer bearing names nothing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tpjb_ident.check.gain_evidence import (
    LEVER_KNOWN,
    Difference,
    Evidence,
    PointReadings,
    common_stiffness,
    dynamic_difference,
    dynamic_pattern,
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
#: A part of the reading beyond this is no gain some per cent off.
_MOST_PART = 0.9
#: Another channel explains a run as well if it leaves no more than this: a thousandth of the likelihood.
_AS_WELL = 2 * math.log(1e3)
#: An explanation that lets the mean move freely must leave this much less: ln of the equations, times one more unknown.
_FREE = 2.0
#: Runs needed, and the share of them that can be at fault.
_MIN_RUNS, _MOST = 4, 1 / 3


@dataclass(frozen=True)
class WrongGain:
    """A gain that one channel has in one run only."""

    run: int
    channels: tuple[int, ...]
    gain: float
    error: float
    means: bool
    chance: float


@dataclass(frozen=True)
class _Try:
    """One channel's explanation of a run; `left` is the sum of squares that it leaves, over all equations."""

    channel: int
    joint: Evidence
    means: bool
    left: float


def wrong_gains(readings: PointReadings, known: Collection[int] = ()) -> list[WrongGain]:
    """Find runs with one wrong gain, the clearest first."""
    count, outliers, gains = len(readings.probes), set(known), list[WrongGain]()
    while len(outliers) + 1 <= _MOST * count:
        remaining = [i for i in range(count) if i not in outliers]
        if len(remaining) < _MIN_RUNS:
            break
        tried = [gain_of_run(readings, i, [j for j in remaining if j != i]) for i in remaining]
        clearest = min((t for t in tried if t is not None), key=lambda t: t.chance, default=None)
        # each run is tried with two cells and two probes, a probe with two zeros
        if clearest is None or clearest.chance > _CHANCE / (6 * len(remaining)):
            break
        gains.append(clearest)
        outliers.add(clearest.run)
    return gains


def gain_of_run(readings: PointReadings, run: int, agreeing: Sequence[int]) -> WrongGain | None:
    """The gain of one channel that explains `run` best beside the `agreeing` runs; None where no single one does.

    Where the best is too small to be a fault, no worse one is named in its place.
    """
    tried = sorted(_tries(readings, run, agreeing), key=lambda t: t.left)
    if not tried or abs(tried[0].joint.part) < _LEAST:
        return None
    best = tried[0]
    alike = dict.fromkeys(t.channel for t in tried if t.left < best.left + _AS_WELL)
    gain = 1 / (1 - best.joint.part)
    error = gain**2 / float(np.sqrt(best.joint.information))
    return WrongGain(run, tuple(alike), gain, error, best.means, best.joint.chance())


def _tries(readings: PointReadings, run: int, agreeing: Sequence[int]) -> Iterator[_Try]:
    """Explanations of `run` by one channel's gain that nothing in it contradicts."""
    stiffness = common_stiffness(readings, agreeing)
    if stiffness is None:
        return
    dynamic = dynamic_difference(readings, run, agreeing, stiffness)
    static = static_difference(readings, run, agreeing, stiffness)
    if dynamic is None:
        return
    for channel in range(4):
        pattern = dynamic_pattern(readings, run, channel, stiffness)
        shown = dynamic.evidence(pattern)
        if shown.chance() > _PHASORS_SHOW or shown.part > _MOST_PART:
            continue
        for lever, slack in _levers(readings, run, channel, shown.part):
            evidence = _with_means(static, channel, lever, slack, shown)
            misfit = dynamic.misfit(pattern, evidence.joint.part)
            if evidence.left <= _STRANGE and misfit <= _STRANGE:
                yield replace(
                    evidence, left=len(pattern) * (evidence.left + misfit) + (_FREE if lever is None else 0.0)
                )


def _levers(readings: PointReadings, run: int, channel: int, part: float) -> Iterator[tuple[float | None, float]]:
    """Readings that a gain would multiply in the mean, with the uncertainty of the shift; None where not known.

    A probe's gain may count from the bearing's centre, or, as that of an amplifier, from 0 V.
    """
    if channel >= 2:
        yield float(readings.cell_means[run, channel - 2]), 0.0
        return
    mean, zero = float(readings.probe_means[run, channel]), readings.centre[channel]
    yield mean, 0.0
    yield (None, 0.0) if zero is None else (mean - zero, abs(LEVER_KNOWN * (mean - zero) * part))


def _with_means(static: Difference | None, channel: int, lever: float | None, slack: float, shown: Evidence) -> _Try:
    """Join what the means say of a channel; left is what they differ by per equation, infinite in contradiction."""
    if static is None:
        return _Try(channel, shown, False, 0.0)
    pattern = np.where(np.arange(4) == channel, 1.0 if lever is None else lever, 0.0)
    widened = static.widened(channel, slack)
    by_phasor = widened.evidence(pattern)
    if lever is None or by_phasor.information <= 0:
        # the mean may have moved by anything
        return _Try(channel, shown, False, widened.misfit(pattern, by_phasor.part))
    apart = abs(by_phasor.part - shown.part) / np.sqrt(1 / by_phasor.information + 1 / shown.information)
    joint = shown.joined(by_phasor)
    remaining = widened.misfit(pattern, joint.part) if apart <= _AGREE else np.inf
    return _Try(channel, joint, by_phasor.chance() < _PHASORS_SHOW, remaining)
