"""Check dry, clearance and locus runs: what their own fits refuse, and whether the shaft goes where it is pushed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError, Severity
from rigdata.vector import directions
from tpjb_ident.check.observation import NO_NOISE, Observation
from tpjb_ident.check.response import definiteness, mirrored
from tpjb_ident.check.set_points import angle_between, plane_of, plane_vector
from tpjb_ident.check.wiring import guess_wiring, name_fault
from tpjb_ident.clearance.sweep import sweep_samples
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.slow_samples import live_run
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.dry_record import DryRecord, read_dry_run
from tpjb_ident.pivot.refusals import refused_records

#: Angle [deg] by which the shaft lies aside of the load, beyond what friction does: warning, error.
_TURNED = (12.0, 20.0)
#: Standard errors of the mean angle over the dry runs beyond which it is one, and runs that tell it.
_CLEAR, _MIN_RUNS = 4.0, 3
#: Angle [deg] within which dry runs count as turned alike.
_ALIKE = 12.0
#: Angle [rad] beyond which a direction is that of a wrong channel, not of where the shaft stood.
_LEAST_WRONG = math.radians(8.0)
#: A direction of the shaft that is known no better [rad] may as well be that of a probe that drifts.
_FIRM = math.radians(5.0)
#: Angle [deg] within which mended channels point where they should; a shaft moves sideways as well.
_MENDED = {"force": 8.0, "displacement": 20.0}
#: A clearance polygon and a locus are far from round; 1 is round.
_LEAST_DEFINITE = 0.02
#: Loads within this angle [deg] go toward one pad.
_SAME_PAD = 25.0
#: A load goes toward a pad of the arrangement within this angle [deg].
_AT_PAD = 12.0
#: Numbers of pads that bearings have.
_LEAST_PADS, _MOST_PADS = 3, 12
#: Smaller over larger extent of a load that goes around.
_GOES_AROUND = 0.3


def check_dry(runs: Sequence[Observation]) -> None:
    """Dry pivot runs: what the fit of the pivots refuses, turned probes, contradicting numbers of pads."""
    settings = PivotSettings()
    read: list[tuple[Observation, DryRecord]] = []
    for observation in runs:
        run = observation.run
        stated = run.point.static_load_direction if "static_load_direction" in run.stated else None
        try:
            read.append((observation, read_dry_run(run, stated, settings)))
        except RigDataError as error:
            _take(observation, error.problems)
    angles = np.full(max((record.pad for _, record in read), default=0), np.nan)
    for _, record in read:
        angles[record.pad - 1] = record.angle
    try:
        records, problems, _ = refused_records([record for _, record in read], settings, angles)
    except BadInputError:  # holds too short for the fit
        return
    turned = _turned_alike(records)
    first = {problem.run: problem for problem in reversed(problems)}
    for (observation, _), record in zip(read, records):
        if turned is not None and _is_firm(record):
            _judge_turns(observation, np.full(len(observation.pick("displacement")), turned))
        elif record.run.id in first:
            _say_refusal(observation, record, first[record.run.id])
    shows = [math.degrees(math.remainder(r.angle + r.load_direction.angle, 2 * math.pi)) for r in records]
    _check_labels([observation for observation, _ in read], shows)


def _take(observation: Observation, problems: Sequence[Problem]) -> None:
    """Note what a reading refuses; not where as much is said already, nor that a computed record stands still."""
    if not any(f.problem.severity == "error" or f.key == NO_NOISE for f in observation.report.found):
        observation.report.take(problems)


def _is_firm(record: DryRecord) -> bool:
    """Whether the load goes toward the pad, and the shaft clearly somewhere."""
    return record.displacement_direction.se < _FIRM and abs(record.load_direction.angle) < _LEAST_WRONG


def _turned_alike(records: Sequence[DryRecord]) -> float | None:
    """Angle [deg] by which the shaft goes aside of the load in all dry runs; None where it does not, or not alike."""
    aside = [math.degrees(r.displacement_direction.angle - r.load_direction.angle) for r in records if _is_firm(r)]
    if len(aside) < _MIN_RUNS:
        return None
    turn, spread = float(np.mean(aside)), float(np.std(aside, ddof=1))
    clear = abs(turn) > max(_TURNED[0], _CLEAR * spread / math.sqrt(len(aside)))
    return turn if clear and np.max(np.abs(np.array(aside) - turn)) < _ALIKE else None


def _say_refusal(observation: Observation, record: DryRecord, problem: Problem) -> None:
    """Say why the fit refuses a dry run; of wrong channels with the fault that explains them, where one does."""
    quantity, report = problem.place.partition(" ")[0], observation.report
    direction = record.load_direction if quantity == "force" else record.displacement_direction
    if quantity not in _MENDED or abs(direction.angle) < _LEAST_WRONG:
        report.say(problem.what, problem.severity, problem.place, problem.what, problem.cure)
        return
    channels = observation.of(quantity)
    wanted = record.angle + (0.0 if quantity == "force" else record.load_direction.angle)
    readings = directions([c.axis or 0.0 for c in channels]) @ directions(record.angle + direction.angle)
    hint = guess_wiring(channels, readings, directions(wanted), within=_MENDED[quantity])
    if quantity == "displacement" and _is_firm(record):
        _say_of_probes(observation, ("signs", hint), problem.severity, problem.what + hint, problem.cure)
        return
    if hint:
        report.doubts.add(quantity)
    report.say(f"{problem.place}{hint}", problem.severity, problem.place, problem.what + hint, problem.cure)


def _say_of_probes(observation: Observation, key: tuple[str, str], severity: Severity, text: str, cure: str) -> None:
    """Say what is wrong with the probes, in whatever run they serve; `key` stands around their names."""
    names = [channel.name for channel in observation.of("displacement")]
    listed = " and ".join(names)
    observation.report.say(f"{key[0]} {listed}{key[1]}", severity, f"channels {listed}", text, cure, names)


def check_sweeps(runs: Sequence[Observation]) -> None:
    """Clearance runs: the shaft moves to the side to which the small load pushes it; or else what the fit refuses."""
    for observation in runs:
        before = len(observation.report.found)
        _check_sweep(observation)
        if len(observation.report.found) > before or "force" in observation.report.doubts:
            continue
        try:
            sweep_samples(live_run(observation.run))
        except RigDataError as error:
            _take(observation, [replace(problem, severity="warning") for problem in error.problems])


def _check_sweep(observation: Observation) -> None:
    """Judge the movement under a load that goes around."""
    cells, probes = observation.pick("force"), observation.pick("displacement")
    if len(cells) < 2 or len(probes) < 2:
        return
    samples = observation.samples[np.isfinite(observation.samples[:, [*cells, *probes]]).all(axis=1)]
    if len(samples) < 20:
        return
    force = samples[:, cells] @ plane_of(observation.of("force")).T
    shaft = samples[:, probes] @ plane_of(observation.of("displacement")).T
    gain = _gain(force, shaft)
    if gain is not None and _judge_gain(observation, gain):
        _judge_turns(observation, _turns(observation, force, samples[:, probes]))


def _gain(force: FloatArray, shaft: FloatArray) -> FloatArray | None:
    """Displacement by force (2, 2) [m/N] of some points (n, 2); None where the load does not go around."""
    about = force - force.mean(axis=0)
    sizes = np.linalg.svd(about, compute_uv=False)
    if sizes[-1] < _GOES_AROUND * sizes[0]:
        return None
    return np.asarray(np.linalg.lstsq(about, shaft - shaft.mean(axis=0), rcond=None)[0].T)


def _turns(observation: Observation, force: FloatArray, readings: FloatArray) -> FloatArray:
    """Angle of every probe's axis, as the load (n, 2) that goes around shows it, less the stated one (m,) [deg]."""
    load = force - force.mean(axis=0)
    design = np.column_stack([load / np.linalg.norm(load, axis=1, keepdims=True), np.ones(len(load))])
    answer = np.linalg.lstsq(design, readings, rcond=None)[0]
    along = directions([channel.axis or 0.0 for channel in observation.of("displacement")])
    turned = along[:, 0] * answer[1] - along[:, 1] * answer[0]
    return np.asarray(np.degrees(np.arctan2(turned, np.sum(along * answer[:2].T, axis=1))))


def _judge_turns(observation: Observation, turns: FloatArray) -> None:
    """Axes of probes (m,) [deg] that lie elsewhere than stated, all alike or some."""
    names = [channel.name for channel in observation.of("displacement")]
    common = float(np.median(turns))
    cure = "Check the axes of the probes (and of the cells)"
    if abs(common) > _TURNED[0]:
        severity: Severity = "error" if abs(common) > _TURNED[1] else "warning"
        text = f"the shaft lies {common:+.0f} deg from where the load pushes it, as if all probes stood there"
        _say_of_probes(observation, ("turned", ""), severity, text, cure)
        return
    for name, turn in zip(names, turns):
        if abs(turn - common) > _TURNED[0]:
            severity = "error" if abs(turn - common) > _TURNED[1] else "warning"
            text = f"answers the load as if it stood {turn - common:+.0f} deg from its axis"
            observation.report.say(f"turned {name}", severity, f"channel {name}", text, cure, [name])


def check_locus(runs: Sequence[Observation]) -> None:
    """Locus runs together: mean positions follow the directions of the loads."""
    groups: dict[object, list[tuple[Observation, FloatArray, FloatArray]]] = {}
    for observation in runs:
        if observation.lines is None or "force" in observation.report.doubts:
            continue
        force, shaft = (plane_vector(observation, q, observation.lines.mean) for q in ("force", "displacement"))
        if force is not None and shaft is not None and len(observation.pick("displacement")) == 2:
            point = observation.run.point
            groups.setdefault((point.static_load, point.spin), []).append((observation, force, shaft))
    for group in groups.values():
        loads, places = (np.array([member[k] for member in group]) for k in (1, 2))
        gain = _gain(loads, places) if len(group) >= 4 else None
        if gain is None:
            continue
        for observation, _, _ in group:
            _judge_gain(observation, gain)
        _judge_places([member[0] for member in group], places, places - loads @ gain.T)


def _judge_places(group: Sequence[Observation], places: FloatArray, remainder: FloatArray) -> None:
    """A position that lies elsewhere than the others of its load and speed let one expect."""
    shaft, off = places - places.mean(axis=0), remainder - remainder.mean(axis=0)
    size, misfit = float(np.median(np.hypot(*shaft.T))), np.hypot(*off.T)
    for observation, distance in zip(group, misfit):
        if len(group) >= 6 and distance > max(0.7 * size, 5 * float(np.median(misfit))):
            text = f"the mean position lies {1e6 * distance:.0f} um from where the other directions let one expect it"
            cure = "Check the probes of this run: sign, sensitivity, moved?"
            observation.report.say("place", "warning", "displacement", text, cure)


def _judge_gain(observation: Observation, gain: FloatArray) -> bool:
    """Whether `gain` (2, 2) [m/N] from force to displacement is positive definite, as it must be."""
    judged = bool(np.any(gain)) and "force" not in observation.report.doubts
    if not judged or definiteness(gain) > _LEAST_DEFINITE:
        return judged
    channels = observation.of("displacement")
    hint = name_fault(channels, lambda repair: definiteness(mirrored(channels, repair) @ gain))
    text = f"the shaft does not go to the side to which the load pushes it{hint}"
    cure = "Check axis, polarity and cables of the probes (and of the cells)"
    _say_of_probes(observation, ("signs", hint), "error" if hint else "warning", text, cure)
    return False


def _check_labels(runs: Sequence[Observation], shows: Sequence[float]) -> None:
    """Name runs whose pad number contradicts another run's; `shows` [deg] is where each load goes.

    Two runs that contradict each other do not tell which of them is wrong. The others do: pads stand evenly around the
    shaft, so that the run is wrong which the arrangement that most runs agree on leaves over.
    """
    pads = [observation.run.pad or 0 for observation in runs]
    belongs: dict[int, int] | None = None
    for second, first in ((k, i) for k in range(len(runs)) for i in range(k)):
        near = angle_between(shows[first], shows[second]) < _SAME_PAD
        if near == (pads[first] == pads[second]):
            continue
        belongs = _misplaced(pads, shows) if belongs is None else belongs
        wrong, other = (first, second) if first in belongs and second not in belongs else (second, first)
        text = f"pad {pads[wrong]} is loaded toward {shows[wrong]:.0f} deg"
        if pads[wrong] == pads[other]:
            text += f" here, toward {shows[other]:.0f} deg in run {runs[other].run.id}"
        else:
            text += f", as is pad {pads[other]} in run {runs[other].run.id}"
        cure = "One of the two runs names the wrong pad: correct it"
        if wrong in belongs and other not in belongs:
            text += f"; by the directions of the other runs it is pad {belongs[wrong]}"
            cure = "Correct the pad number of this run"
        if not any(f.key == "pad" for f in runs[wrong].report.found):
            runs[wrong].report.say("pad", "error", "pad", text, cure)


def _misplaced(pads: Sequence[int], shows: Sequence[float]) -> dict[int, int]:
    """Runs (by place) that the evenly spaced arrangement of all others leaves over, with the pad that they load.

    Empty where fewer than three runs agree on one arrangement, or where two arrangements serve as many.
    """
    table: dict[frozenset[int], dict[int, int]] = {}
    for count, sense in itertools.product(range(max(_LEAST_PADS, *pads), _MOST_PADS + 1), (1, -1)):
        step = 360.0 * sense / count
        for pad, direction in zip(pads, shows):
            numbers = [_pad_at(angle - direction + step * (pad - 1), step, count) for angle in shows]
            agree = frozenset(k for k, number in enumerate(numbers) if number == pads[k])
            others = {k: number for k, number in enumerate(numbers) if k not in agree and number is not None}
            if len(agree) >= 3 and len(agree) + len(others) == len(pads):
                table.setdefault(agree, others)
    most = max((len(agree) for agree in table), default=0)
    best = [others for agree, others in table.items() if len(agree) == most]
    return best[0] if len(best) == 1 and 2 * most > len(pads) else {}


def _pad_at(angle: float, step: float, count: int) -> int | None:
    """Number of the pad toward which a load goes, so far from the first; None between pads."""
    number = round(angle / step)
    return number % count + 1 if angle_between(angle, number * step) < _AT_PAD else None
