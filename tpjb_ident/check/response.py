"""What the runs of an operating point answer to force: as a film can, and as the other runs do.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe
wired to the wrong input or with the wrong sign turns the answer into its mirror image, which is not.

All runs of a point share one matrix H. Each run is held against the matrix of the others, in units of what these
scatter about it themselves, so that a quiet rig shows a gain that is some per cent off and a noisy one does not cry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtri

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.point_runs import PointRuns, point_runs, probe_centres
from tpjb_ident.check.questions import far
from tpjb_ident.check.run_gain import CHANCE, WrongGain, dynamic_difference, gain_of_run, wrong_gains
from tpjb_ident.check.wiring import explanation, indefiniteness, repairs
from tpjb_ident.phasors.shaft import shaft_order

#: Where half of the runs differ by more than this share there is no one answer to judge.
_NO_ANSWER = 0.08
_DEFINITE = 0.05
#: A mended answer is at least as definite as this.
_MENDED = 0.15
#: A run that differs by this share stands apart in any case, where the others agree to the second share.
_OUTLIER, _AGREE = 0.08, 0.03
#: Differences below this share are no fault: loads and temperatures differ from run to run.
_LEAST = 0.03
#: Runs needed before one can be told apart from the others.
_MIN_RUNS = 4


def check_responses(observations: Sequence[Observation], mass: float, sweeps: Sequence[Observation]) -> None:
    """Compare the dynamic runs of every operating point with each other and with what a film can do."""
    groups: dict[object, list[Observation]] = {}
    for observation in observations:
        point, probes = observation.run.point, observation.of("displacement")
        # runout answers at a line of the shaft too, as no film does
        is_clear = not shaft_order(point.excitation_hz, point.shaft_speed_hz)
        is_clear &= observation.shows("force") and observation.shows("displacement")
        measured = np.array([observation.film_force(mass), observation.line("displacement")])
        if is_clear and len(probes) == 2 and "force" not in observation.report.doubts and np.isfinite(measured).all():
            groups.setdefault((point, *((c.name, c.axis) for c in probes)), []).append(observation)
    centres = probe_centres(sweeps)
    for group in groups.values():
        runs = point_runs(group, mass, centres)
        stiffness = runs.robust_stiffness()
        if stiffness is not None:
            _check_film(runs, stiffness)
            if len(runs) >= _MIN_RUNS:
                _check_agreement(runs, stiffness)


def _film_like(stiffness: ComplexArray) -> float:
    """Misfit of a matrix to what a film can be."""
    return max(indefiniteness(stiffness.real), indefiniteness(stiffness.imag))


def _check_film(runs: PointRuns, stiffness: ComplexArray) -> None:
    """Positive stiffness and damping, alike along both probes; most of the runs must agree on them."""
    if np.median(runs.misfits(stiffness)) > _NO_ANSWER:
        return
    probes = runs.channels[:2]
    names = [probe.name for probe in probes]
    if _film_like(stiffness) < 1 / _DEFINITE:
        sizes = np.linalg.norm(stiffness @ runs.probe_plane, axis=0)
        larger, smaller = names[int(np.argmin(sizes))], names[int(np.argmax(sizes))]
        for observation in runs.observations:
            observation.report.ask("scales", float(sizes.max() / sizes.min()), *names, larger=larger, smaller=smaller)
        return
    hint = explanation(repairs(probes), lambda repair: _film_like(stiffness @ np.linalg.inv(repair)), 1 / _MENDED)
    if not hint and indefiniteness(stiffness.imag) < 1 / _DEFINITE:
        return  # stiffness may be negative: added mass, cross-coupling
    is_grave = bool(hint) or np.linalg.eigvalsh(stiffness.imag + stiffness.imag.T)[0] < 0
    for observation in runs.observations:
        observation.report.ask("signs", 2.0 if is_grave else 1.0, *names, hint=hint)


def _check_agreement(runs: PointRuns, stiffness: ComplexArray) -> None:
    """Name runs that answer otherwise than the others, then those in which one channel has a gain of its own."""
    misfits = runs.misfits(stiffness)
    clear = far(misfits, _OUTLIER, 6.0) & (np.median(misfits) <= _AGREE)
    outliers = runs.outlying(np.flatnonzero(clear).tolist(), lambda run, peers: _distance(runs, run, peers))
    consistent = runs.without(outliers)
    common = runs.stiffness(consistent) if outliers else stiffness
    for run in sorted(outliers):
        _report(runs, run, consistent, stiffness if common is None else common)
    for run, gain in wrong_gains(runs, outliers).items() if len(runs.channels) == 4 else ():
        name, *alike = _names(runs, gain)
        hint = f" (or {' or '.join(alike)} another gain)" if alike else ""
        report, direction = runs.observations[run].report, _direction(gain)
        report.ask("gain", abs(gain.gain - 1), name, hint=hint, direction=direction, error=gain.error)


def _names(runs: PointRuns, gain: WrongGain) -> list[str]:
    return [runs.channels[k].name for k in gain.channels]


def _direction(gain: WrongGain) -> str:
    return "much" if gain.gain > 1 else "little"


def _distance(runs: PointRuns, run: int, peers: list[int]) -> float:
    """How far a run is from the others' matrix, over what chance allows; zero where it is no fault.

    The residual's square over its variance, by the others' scatter, follows an F distribution.
    """
    stiffness = runs.stiffness(peers)
    difference = None if stiffness is None else dynamic_difference(runs, run, peers, stiffness)
    if stiffness is None or difference is None or runs.misfits(stiffness)[run] < _LEAST:
        return 0.0
    ratio = float(np.mean(difference.residual**2 / np.diag(difference.noise)))
    return ratio / float(fdtri(4, difference.spare, 1 - CHANCE))


def _report(runs: PointRuns, run: int, consistent: Sequence[int], stiffness: ComplexArray) -> None:
    """Name a run that differs, with the wiring fault of probes or cells that explains it, or the gain."""
    misfit, report = float(runs.misfits(stiffness)[run]), runs.observations[run].report
    probes, cells = runs.channels[:2], runs.channels[2:]
    tried = [(words, np.hstack([repair, np.eye(2)])) for words, repair in repairs(probes, scales=True)]
    tried += [(words, np.hstack([np.eye(2), repair])) for words, repair in repairs(cells, scales=True)]

    def unexplained(repair: FloatArray) -> float:
        # the inertia part of the force stays: only the cells are supposed to be at fault
        force = repair[:, 2:] @ (runs.force - runs.inertia)[run] + runs.inertia[run]
        answer = stiffness @ repair[:, :2] @ runs.displacement[run]
        return float(np.linalg.norm(force - answer) / np.linalg.norm(force))

    if hint := explanation(tried, unexplained, misfit / 4):
        report.ask("miswired", misfit, hint=hint)
        return
    gain = gain_of_run(runs, run, consistent) if cells else None
    if gain is not None and gain.chance <= CHANCE:
        hint = f"; as if {_names(runs, gain)[0]} read {abs(gain.gain - 1):.0%} too {_direction(gain)}"
        report.ask("gain of the run", misfit, hint=hint)
    else:
        report.ask("disagrees", misfit)
