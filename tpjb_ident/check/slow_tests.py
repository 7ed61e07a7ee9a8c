"""Check dry, clearance and locus runs: what their own fits refuse, and whether the shaft goes where it is pushed."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.problem import Problem, RigDataError
from rigdata.vector import directions, inverse_directions
from tpjb_ident.check.findings import explanation, far, indefiniteness, pointing, repairs
from tpjb_ident.check.observation import NO_NOISE, Observation
from tpjb_ident.clearance.sweep import sweep_samples
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.dry_record import DryRecord, read_dry_run
from tpjb_ident.pivot.refusals import refused_records

#: Angle [rad] beyond which a direction is that of a wrong channel, not of where the shaft stood.
_LEAST_WRONG = math.radians(8.0)
#: A direction of the shaft that is known no better [rad] may as well be that of a probe that drifts.
_FIRM = math.radians(5.0)
#: Angle [deg] within which mended channels point where they should; a shaft moves sideways as well.
_MENDED = {"force": 8.0, "displacement": 20.0}
#: A clearance polygon and a locus are far from round; 1 is round. A mended one is rounder than the second.
_LEAST_DEFINITE, _MENDED_DEFINITE = 0.02, 0.15
#: Loads within this angle [deg] go toward one pad; toward a pad of the arrangement within the second.
_SAME_PAD, _AT_PAD = 25.0, 12.0
#: Numbers of pads that bearings have.
_LEAST_PADS, _MOST_PADS = 3, 12
#: Smaller over larger extent of a load that goes around.
_GOES_AROUND = 0.3
#: Distance of a position from where the others let one expect it: share of their own, and times the median one.
_ASIDE, _MANY = 0.7, 5.0


def check_dry(runs: Sequence[Observation]) -> None:
    """Dry pivot runs: what the fit of the pivots refuses, contradicting numbers of pads."""
    observations, records = [], []
    for observation in runs:
        run = observation.run
        direction = run.point.static_load_direction if "static_load_direction" in run.stated else None
        try:
            records.append(read_dry_run(run, direction))
            observations.append(observation)
        except RigDataError as error:
            _take(observation, error.problems)
    angles = np.full(max((record.pad for record in records), default=0), np.nan)
    for record in records:
        angles[record.pad - 1] = record.angle
    try:
        records, problems, _ = refused_records(records, angles)
    except BadInputError:  # holds too short for the fit
        return
    first = {problem.run: problem for problem in reversed(problems)}
    for observation, record in zip(observations, records):
        if record.run.id in first:
            _refuse(observation, record, first[record.run.id])
    shown = [math.degrees(math.remainder(r.angle + r.load_direction.angle, 2 * math.pi)) for r in records]
    _check_labels(observations, shown)


def _take(observation: Observation, problems: Sequence[Problem]) -> None:
    """Note what a reading refuses; not where as much is said already, nor that a computed record stands still."""
    if not any(f.problem.severity == "error" or f.key == NO_NOISE for f in observation.report.findings):
        observation.report.take(problems)


def _refuse(observation: Observation, record: DryRecord, problem: Problem) -> None:
    """Say why the fit refuses a dry run; of wrong channels with the fault that explains them, where one does."""
    quantity, report, hint = problem.place.partition(" ")[0], observation.report, ""
    load, is_force = record.load_direction, quantity == "force"
    direction, aim = (load, 0.0) if is_force else (record.displacement_direction, load.angle)
    if quantity in _MENDED and abs(direction.angle) >= _LEAST_WRONG:
        within = _MENDED[quantity]
        misfit = pointing(directions(record.angle + direction.angle), math.degrees(record.angle + aim), within)
        hint = explanation(repairs(observation.of(quantity)), misfit, within, alike=2)
        if not is_force and direction.se < _FIRM and abs(load.angle) < _LEAST_WRONG:
            names = observation.names(quantity)
            report.ask("aside", 1.0, *names, hint=hint, grave=problem.severity, what=problem.what)
            return
    if hint and is_force:
        report.cells_doubted = True
    key = f"{problem.place}{hint}" if hint else problem.what
    report.note(key, problem.severity, problem.place, problem.what + hint, problem.cure)


def check_sweeps(runs: Sequence[Observation]) -> None:
    """Clearance runs: the shaft moves to the side to which the small load pushes it; or else what the fit refuses."""
    for observation in runs:
        before = len(observation.report.findings)
        _check_sweep(observation)
        if len(observation.report.findings) > before or observation.report.cells_doubted:
            continue
        try:
            sweep_samples(live_run(observation.run))
        except RigDataError as error:
            _take(observation, [replace(problem, severity="warning") for problem in error.problems])


def _check_sweep(observation: Observation) -> None:
    """Judge the movement under a load that goes around, and the axis of every probe that it shows."""
    cells, probes = observation.pick("force"), observation.pick("displacement")
    samples = observation.samples[np.isfinite(observation.samples[:, [*cells, *probes]]).all(axis=1)]
    if min(len(cells), len(probes)) < 2 or len(samples) < 20:
        return
    load, readings = samples[:, cells] @ inverse_directions(observation.of("force")).T, samples[:, probes]
    gain = _gain(load, readings @ inverse_directions(observation.of("displacement")).T)
    if gain is None or not _is_pushed(observation, gain):
        return
    load = load - load.mean(axis=0)
    design = np.column_stack([load / np.linalg.norm(load, axis=1, keepdims=True), np.ones(len(load))])
    answer = np.array([1.0, 1.0j]) @ np.linalg.lstsq(design, readings, rcond=None)[0][:2]
    axes = np.array([channel.axis or 0.0 for channel in observation.of("displacement")])
    turns = np.degrees(np.angle(answer * np.exp(-1j * axes)))
    common, names = np.median([*turns, 0.0]), observation.names("displacement")  # the cells have a say too
    if not observation.report.ask("turned", abs(common), *names, angle=common):
        for name, turn in zip(names, turns - common):
            observation.report.ask("turned", abs(turn), name, angle=turn)


def _gain(force: FloatArray, shaft: FloatArray) -> FloatArray | None:
    """Displacement by force (2, 2) [m/N] of some points (n, 2); None where the load does not go around."""
    about = force - force.mean(axis=0)
    solution, _, _, sizes = np.linalg.lstsq(about, shaft - shaft.mean(axis=0), rcond=None)
    return None if sizes[-1] < _GOES_AROUND * sizes[0] else solution.T


def _is_pushed(observation: Observation, gain: FloatArray) -> bool:
    """Whether `gain` (2, 2) [m/N] from force to displacement is positive definite, as it must be."""
    if not np.any(gain) or observation.report.cells_doubted:
        return False
    if indefiniteness(gain) < 1 / _LEAST_DEFINITE:
        return True
    probes = observation.of("displacement")
    hint = explanation(repairs(probes), lambda repair: indefiniteness(repair @ gain), 1 / _MENDED_DEFINITE)
    observation.report.ask("side", 2.0 if hint else 1.0, *observation.names("displacement"), hint=hint)
    return False


def check_locus(runs: Sequence[Observation]) -> None:
    """Locus runs together: mean positions follow the directions of the loads."""
    groups = defaultdict(list)
    for run in runs:
        means = run.mean("force"), run.mean("displacement")
        if np.isfinite(means).all() and len(run.of("displacement")) == 2 and not run.report.cells_doubted:
            groups[run.run.point.static_load, run.run.point.spin].append(run)
    for group in groups.values():
        loads = np.array([run.mean("force") for run in group])
        places = np.array([run.mean("displacement") for run in group])
        gain = _gain(loads, places) if len(group) >= 4 else None
        if gain is None:
            continue
        for run in group:
            _is_pushed(run, gain)
        off = places - loads @ gain.T
        size = np.median(np.linalg.norm(places - places.mean(axis=0), axis=1))
        distances = np.linalg.norm(off - off.mean(axis=0), axis=1)
        for k in np.flatnonzero(far(distances, _ASIDE * size, _MANY, count=6)):
            group[k].report.ask("place", off=1e6 * distances[k])


def _check_labels(runs: Sequence[Observation], shown: Sequence[float]) -> None:
    """Name runs whose pad number contradicts the others'; `shown` [deg] is where each load goes.

    Two runs that contradict each other do not tell which of them is wrong. The others do: pads stand evenly around the
    shaft, so that the run is wrong which the arrangement that most runs agree on leaves over.
    """
    pads = np.array([observation.run.pad or 0 for observation in runs], dtype=int)
    angles = np.array(shown)
    numbers = _arranged(pads, angles)
    for k, (run, pad, number) in enumerate(zip(runs, pads, numbers)):
        near = np.abs((angles[:k] - angles[k] + 180.0) % 360.0 - 180.0) < _SAME_PAD
        beside = f"; by the directions of the other runs it is pad {number}" if number != pad else ""
        if np.array_equal(numbers, pads):
            for first in np.flatnonzero(near != (pads[:k] == pad))[:1]:
                beside = f", pad {pads[first]} toward {shown[first]:.0f} deg in run {runs[first].run.id}"
        if beside:
            run.report.ask("pad", pad=pad, shown=shown[k], beside=beside)


def _arranged(pads: IntArray, shown: FloatArray) -> IntArray:
    """Numbers (n,) of the pads by the evenly spaced arrangement that most of the runs agree on.

    The stated ones where fewer than three runs agree, or half of them, or where two arrangements serve as many.
    """
    best, most, is_single = pads, max(2, len(pads) // 2), True
    for count in range(max([_LEAST_PADS, *pads]), _MOST_PADS + 1):
        for step in (360.0 / count, -360.0 / count):
            for pad, angle in zip(pads, shown):
                turns = (shown - angle) / step
                numbers = (np.round(turns).astype(int) + pad - 1) % count + 1
                agree = int(np.sum(numbers == pads))
                if np.any(np.abs(turns - np.round(turns)) * abs(step) > _AT_PAD) or agree < most:
                    continue
                is_single = agree > most or (is_single and bool(np.array_equal(numbers, best)))
                best, most = (numbers, agree) if agree > most else (best, most)
    return best if is_single else pads
