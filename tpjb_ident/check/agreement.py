"""Runs of one point against each other: what each answers to the force, and which one stands apart from the rest.

All runs of a point share one matrix H. Each run is held against the matrix of the others, in units of what these
scatter about it themselves, so that a quiet rig shows a gain that is some per cent off and a noisy one does not cry.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.problem import Severity
from tpjb_ident.check.findings import RUN_GAIN
from tpjb_ident.check.point_readings import MIN_RUNS, PointReadings, one_by_one
from tpjb_ident.check.run_gain import dynamic_difference, gain_of_run, wrong_gains
from tpjb_ident.check.wiring import repairs

#: A run that differs by this share stands apart in any case, where the others agree to the second share.
_OUTLIER, _AGREE = 0.08, 0.03
#: Differences below this share are no fault: loads and temperatures differ from run to run.
_LEAST = 0.03
#: Probability at which chance is no explanation any more.
_CHANCE = 1e-4


def check_agreement(readings: PointReadings, stiffness: ComplexArray) -> set[int]:
    """Name runs that answer otherwise than the others at their operating point; their places."""
    if len(readings) < MIN_RUNS:
        return set()
    misfits = readings.misfits(stiffness)
    outliers = set()
    if np.median(misfits) <= _AGREE:
        outliers = set(np.flatnonzero(misfits > max(_OUTLIER, 6 * float(np.median(misfits)))).tolist())
    outliers |= _apart(readings, outliers)
    consistent = [i for i in range(len(readings)) if i not in outliers]
    common = readings.stiffness(consistent) if outliers else None
    for i in sorted(outliers):
        gain = gain_of_run(readings, i, consistent) if len(readings.channels) == 4 else None
        hint = ""
        if gain is not None and gain.chance <= _CHANCE:
            direction = "much" if gain.gain > 1 else "little"
            hint = f"; as if {readings.channels[gain.channels[0]].name} read {abs(gain.gain - 1):.0%} too {direction}"
        _tell(readings, i, stiffness if common is None else common, hint)
    return outliers


def check_gains(readings: PointReadings, known_outliers: Collection[int]) -> None:
    """Name runs in which one channel has a gain of its own."""
    cure = "Check this channel's amplifier, range and cable in this run; leave it out or repeat it"
    names = [channel.name for channel in readings.channels]
    for gain in wrong_gains(readings, known_outliers) if len(names) == 4 else ():
        name, report = names[gain.channels[0]], readings.seen[gain.run].report
        report.say(f"{RUN_GAIN}{name}", "warning", f"channel {name}", gain.words(names), cure)


def _apart(readings: PointReadings, known: set[int]) -> set[int]:
    """Runs beyond chance of the others' matrix, the worst first, until none is left or too many are."""

    def farthest(remaining: list[int]) -> int | None:
        tried = [(*_distance(readings, i, [j for j in remaining if j != i]), i) for i in remaining]
        ratio, misfit, worst = max(tried)
        return None if ratio < 1.0 or misfit < _LEAST else worst

    return one_by_one(len(readings), known, farthest)


def _distance(readings: PointReadings, run: int, others: list[int]) -> tuple[float, float]:
    """How far a run is from the others' matrix: over what chance allows, and as a share of its force.

    The residual's square over its variance, by the others' scatter, follows an F distribution.
    """
    stiffness = readings.stiffness(others)
    difference = None if stiffness is None else dynamic_difference(readings, run, others, stiffness)
    if stiffness is None or difference is None:
        return 0.0, 0.0
    from scipy.special import fdtri

    ratio = float(np.mean(difference.rest**2 / np.diag(difference.noise)))
    return ratio / float(fdtri(4, difference.spare, 1 - _CHANCE)), float(readings.misfits(stiffness)[run])


def _tell(readings: PointReadings, run: int, stiffness: ComplexArray, gain: str) -> None:
    misfit = float(readings.misfits(stiffness)[run])
    hint = _name_misfit(readings, run, stiffness, misfit) or gain
    severity: Severity = "error" if misfit > 0.5 or (hint and misfit > 0.2) else "warning"
    share = f"{misfit:.0%}" if misfit > 0.1 else f"{misfit:.1%}"
    text = f"differs by {share} from the other runs at this operating point{hint}"
    cure = "Check this run's channels and set points; leave it out or repeat it"
    key = f"{RUN_GAIN}of the run" if gain and hint == gain else "disagrees"
    readings.seen[run].report.say(key, severity, "displacement and force", text, cure)


def _name_misfit(readings: PointReadings, run: int, stiffness: ComplexArray, misfit: float) -> str:
    """Name the one wiring fault of probes or cells that explains a run apart from the others."""
    force, probes, cells = readings.force[run], readings.probes[run], readings.cells[run]
    answer = stiffness @ readings.probe_plane
    tried = [
        (np.linalg.norm(force - answer @ matrix @ probes) / np.linalg.norm(force), words)
        for words, matrix in repairs(readings.channels[:2], scales=True)
    ]
    for words, matrix in repairs(readings.channels[2:], scales=True) if len(readings.channels) == 4 else ():
        # The inertia part of the force stays: only the cells are supposed to be at fault.
        mended = readings.cell_plane @ matrix @ cells + readings.inertia[run]
        tried.append((np.linalg.norm(mended - answer @ probes) / np.linalg.norm(mended), words))
    tried.sort()
    clear = tried[0][0] < misfit / 4 and tried[0][0] < tried[1][0] / 2
    return f"; as if {tried[0][1]}" if clear else ""
