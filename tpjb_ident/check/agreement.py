"""Runs of one point against each other: what each answers to the force, and which one stands apart from the rest.

All runs of a point share one matrix H. Each run is held against the matrix of the others, in units of what these
scatter about it themselves, so that a quiet rig shows a gain that is some per cent off and a noisy one does not cry.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from tpjb_ident.check.findings import RUN_GAIN
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.point_readings import PointReadings, leverage, stiffness_of
from tpjb_ident.check.run_gain import gain_of_run, wrong_gains
from tpjb_ident.check.set_points import excited, oil_force, to_plane
from tpjb_ident.check.wiring import repairs

#: A run that differs by this share stands apart in any case, where the others agree to the second share.
_OUTLIER, _AGREE = 0.08, 0.03
#: Differences below this share are no fault: loads and temperatures differ from run to run.
_LEAST = 0.03
#: Probability at which chance is no explanation any more.
_CHANCE = 1e-4
#: Runs needed before one can be told apart from the others, and share of them that can be.
_MIN_RUNS, _MOST = 4, 1 / 3


@dataclass(frozen=True)
class RunResponse:
    """One dynamic run: force and displacement phasors."""

    seen: Observation
    force: ComplexArray  #: (2,) complex, N: X, Y
    readings: ComplexArray  #: (2,) complex: of the two displacement channels, SI
    channels: tuple[Channel, ...]

    @property
    def names(self) -> list[str]:
        """Names of the probes and cells."""
        return [c.name for c in (*self.channels, *(self.seen.channels[i] for i in self.seen.pick("force")))]

    @property
    def displacement(self) -> ComplexArray:
        """X, Y [m]."""
        return to_plane(self.channels, self.readings)


def response_of(observation: Observation, mass: float) -> RunResponse | None:
    """Take the phasors of a run; None where it does not show them, or its force is in doubt already."""
    probes = observation.pick("displacement")
    force = oil_force(observation, mass)
    if (
        len(probes) != 2
        or force is None
        or observation.lines is None
        or "force" in observation.report.doubts
        or not excited(observation)
    ):
        return None
    readings = observation.lines.phasor[probes]
    if not np.all(np.isfinite(readings)) or not np.any(np.abs(readings) > 8 * observation.lines.floor[probes]):
        return None
    return RunResponse(observation, force, readings, tuple(observation.channels[i] for i in probes))


def _solve_stiffness(responses: Sequence[RunResponse]) -> ComplexArray | None:
    """H of ``F = H D``, least squares; None where the runs excite one direction only."""
    return stiffness_of(np.stack([a.displacement for a in responses]), np.stack([a.force for a in responses]))


def misfit_of(response: RunResponse, stiffness: ComplexArray, repair: FloatArray | None = None) -> float:
    """Share of the force that H does not explain, after a repair (2, 2) of the displacement readings."""
    readings = response.readings if repair is None else repair @ response.readings
    predicted = stiffness @ to_plane(response.channels, readings)
    return float(np.linalg.norm(response.force - predicted) / np.linalg.norm(response.force))


def robust_stiffness(group: Sequence[RunResponse]) -> ComplexArray | None:
    """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it."""
    best: tuple[float, ComplexArray] | None = None
    for pair in combinations(group[:24], 2):
        stiffness = _solve_stiffness(pair)
        if stiffness is None:
            continue
        misfit = float(np.median([misfit_of(a, stiffness) for a in group]))
        if best is None or misfit < best[0]:
            best = (misfit, stiffness)
    if best is None:
        return None
    close = [a for a in group if misfit_of(a, best[1]) <= max(3 * best[0], 1e-9)]
    refined = _solve_stiffness(close)
    return best[1] if refined is None else refined


def check_agreement(
    group: Sequence[RunResponse], stiffness: ComplexArray, readings: PointReadings | None = None
) -> set[int]:
    """Name runs that answer otherwise than the others at their operating point; their places in the group."""
    if len(group) < _MIN_RUNS:
        return set()
    misfits = np.array([misfit_of(a, stiffness) for a in group])
    outliers = set()
    if np.median(misfits) <= _AGREE:
        allowed = max(_OUTLIER, 6 * float(np.median(misfits)))
        outliers = {i for i, misfit in enumerate(misfits) if misfit > allowed}
    outliers |= _apart(group, outliers)
    consistent = [i for i in range(len(group)) if i not in outliers]
    common = _solve_stiffness([group[i] for i in consistent]) if outliers and len(consistent) > 1 else None
    for i in sorted(outliers):
        gain = None if readings is None else gain_of_run(readings, i, consistent)
        hint = ""
        if gain is not None and gain.chance <= _CHANCE:
            direction = "much" if gain.gain > 1 else "little"
            hint = f"; as if {group[0].names[gain.channels[0]]} read {abs(gain.gain - 1):.0%} too {direction}"
        _tell(group[i], stiffness if common is None else common, hint)
    return outliers


def check_gains(group: Sequence[RunResponse], known_outliers: Collection[int], readings: PointReadings) -> None:
    """Name runs in which one channel has a gain of its own."""
    cure = "Check this channel's amplifier, range and cable in this run; leave it out or repeat it"
    for gain in wrong_gains(readings, known_outliers):
        names = group[0].names
        name, report = names[gain.channels[0]], group[gain.run].seen.report
        report.say(f"{RUN_GAIN}{name}", "warning", f"channel {name}", gain.words(names), cure)


def _apart(group: Sequence[RunResponse], known: set[int]) -> set[int]:
    """Runs beyond chance of the others' matrix, the worst first, until none is left or too many are."""
    outliers: set[int] = set(known)
    while len(outliers) + 1 <= _MOST * len(group):
        remaining = [i for i in range(len(group)) if i not in outliers]
        if len(remaining) < _MIN_RUNS:
            break
        tried = [(_distance(group[i], [group[j] for j in remaining if j != i]), i) for i in remaining]
        (ratio, misfit), worst = max(tried)
        if ratio < 1.0 or misfit < _LEAST:
            break
        outliers.add(worst)
    return outliers


def _distance(response: RunResponse, remaining: Sequence[RunResponse]) -> tuple[float, float]:
    """How far a run is from the others' matrix: over what chance allows, and as a share of its force.

    With s^2 the others' variance per equation and d the run's displacement, its residual r has the variance
    s^2 (1 + d* (sum of d d*)^-1 d); |r|^2 over it follows an F distribution.
    """
    stiffness = _solve_stiffness(remaining)
    spare = 2 * (2 * len(remaining) - 4)
    if stiffness is None or spare < 4:
        return 0.0, 0.0
    from scipy.special import fdtri

    scales = np.array([np.linalg.norm(a.displacement) for a in remaining])
    unit = np.stack([a.displacement for a in remaining]) / scales[:, None]
    rest = np.stack([a.force - stiffness @ a.displacement for a in remaining]) / scales[:, None]
    variance = float(np.sum(np.abs(rest) ** 2)) / spare
    size = float(np.linalg.norm(response.displacement))
    residual = float(np.linalg.norm(response.force - stiffness @ response.displacement)) / size
    ratio = residual**2 / 4 / (max(variance, 1e-300) * (1 + leverage(unit, response.displacement / size)))
    return ratio / float(fdtri(4, spare, 1 - _CHANCE)), misfit_of(response, stiffness)


def _tell(response: RunResponse, stiffness: ComplexArray, gain: str) -> None:
    misfit = misfit_of(response, stiffness)
    hint = _name_misfit(response, stiffness, misfit) or gain
    severity: Severity = "error" if misfit > 0.5 or (hint and misfit > 0.2) else "warning"
    share = f"{misfit:.0%}" if misfit > 0.1 else f"{misfit:.1%}"
    text = f"differs by {share} from the other runs at this operating point{hint}"
    cure = "Check this run's channels and set points; leave it out or repeat it"
    key = f"{RUN_GAIN}of the run" if gain and hint == gain else "disagrees"
    response.seen.report.say(key, severity, "displacement and force", text, cure)


def _name_misfit(response: RunResponse, stiffness: ComplexArray, misfit: float) -> str:
    """Name the one wiring fault of probes or cells that explains a run apart from the others."""
    tried = [(misfit_of(response, stiffness, m), w) for w, m in repairs(response.channels, scales=True)]
    observation, where = response.seen, response.seen.pick("force")
    cells = [observation.channels[i] for i in where]
    if len(cells) == 2 and observation.lines is not None:
        phasors = observation.lines.phasor[where]
        for words, matrix in repairs(cells, scales=True):
            # The inertia part of the force stays: only the cells are supposed to be at fault.
            force = response.force + to_plane(cells, matrix @ phasors - phasors)
            tried.append((misfit_of(replace(response, force=force), stiffness), words))
    tried.sort()
    clear = tried[0][0] < misfit / 4 and tried[0][0] < tried[1][0] / 2
    return f"; as if {tried[0][1]}" if clear else ""
