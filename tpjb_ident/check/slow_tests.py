"""Check dry, clearance and locus runs: the shaft must go where it is pushed, toward the stated pad."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Severity
from rigdata.vector import directions
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.response import definiteness, mirrored
from tpjb_ident.check.set_points import angle_between, to_plane
from tpjb_ident.check.wiring import guess_wiring, name_fault

_ANGLE_WARNING, _ANGLE_ERROR = 10.0, 30.0
#: Cosine of the angle between load and motion; rigs move sideways by up to a quarter of the way.
_FOLLOWS = math.cos(math.radians(40.0))
#: Angle [deg] by which the shaft lies aside of the load, beyond what friction does: warning, error.
_TURNED = (12.0, 20.0)
#: Standard errors of the mean angle over the dry runs beyond which it is one, and runs that tell it.
_CLEAR, _MIN_RUNS = 4.0, 3
#: A shaft that moves less than this [m] in a dry test may as well be a probe that drifts.
_FIRM_MOVE = 1.5e-6
#: A clearance polygon and a locus are far from round; 1 is round.
_LEAST_DEFINITE = 0.02
#: Loads within this angle [deg] go toward one pad.
_SAME_PAD = 25.0
#: A load goes toward a pad of the arrangement within this angle [deg].
_AT_PAD = 12.0
#: Numbers of pads that bearings have.
_PADS = range(3, 13)
_Shown = tuple[Observation, float]


def _planes(observation: Observation) -> tuple[FloatArray, FloatArray] | None:
    """Force and displacement (n, 2) of the thinned samples, rows without a value left out."""
    force, shaft = observation.pick("force"), observation.pick("displacement")
    if len(force) < 2 or len(shaft) < 2:
        return None
    rows = np.isfinite(observation.samples[:, force + shaft]).all(axis=1)
    if np.count_nonzero(rows) < 20:
        return None
    samples = observation.samples[rows]
    planes = (samples[:, columns] @ np.linalg.pinv(_directions(observation, columns)).T for columns in (force, shaft))
    return next(planes), next(planes)


def _directions(observation: Observation, where: Sequence[int]) -> FloatArray:
    """Unit vectors (m, 2) of some channels."""
    return directions(np.array([observation.channels[i].axis for i in where]))


def check_dry(runs: Sequence[Observation]) -> None:
    """Dry pivot runs: a load that rises, its direction, pads told apart."""
    directions: list[tuple[Observation, float]] = []
    for observation in runs:
        planes = _planes(observation)
        if planes is None:
            continue
        push = _main_move(planes[0])
        if push is None:
            observation.report.say(
                "no load", "error", "force", "the load does not rise", "Check the cells; repeat the run"
            )
            continue
        shows = math.degrees(math.atan2(push[1], push[0]))
        directions.append((observation, shows))
        if "static_load_direction" in observation.run.stated:
            _check_push(observation, shows, push)
    _check_labels(directions)


def check_shaft_follows(runs: Sequence[Observation]) -> None:
    """Dry pivot runs: the shaft goes toward the pad, where the force can be trusted."""
    followed: list[Observation] = []
    angles: list[float] = []
    for observation in runs:
        planes = _planes(observation)
        push = None if planes is None or "force" in observation.report.doubts else _main_move(planes[0])
        if planes is None or push is None:
            continue
        aside = _check_follows(observation, planes, push)
        if aside is not None:
            followed.append(observation)
            angles.append(aside)
    if len(angles) < _MIN_RUNS:
        return
    turn = float(np.mean(angles))
    if abs(turn) > _CLEAR * float(np.std(angles, ddof=1)) / math.sqrt(len(angles)):
        for observation in followed:
            _judge_turns(observation, np.full(len(observation.pick("displacement")), turn))


def _main_move(force: FloatArray) -> FloatArray | None:
    """From the least to the greatest force, (2,) [N]; None where it hardly changes."""
    size = np.linalg.norm(force, axis=1)
    few = max(3, len(force) // 20)
    order = np.argsort(size)
    low, high = np.median(force[order[:few]], axis=0), np.median(force[order[-few:]], axis=0)
    noise = float(np.median(np.abs(np.diff(size))))
    move = high - low
    return move if float(np.hypot(*move)) > max(10 * noise, 1e-9) else None


def _check_push(observation: Observation, shows: float, push: FloatArray) -> None:
    nominal = observation.run.point.static_load_direction_deg
    off = angle_between(shows, nominal)
    if off <= _ANGLE_WARNING:
        return
    cells = observation.pick("force")
    channels = [observation.channels[i] for i in cells]
    wanted = np.array([math.cos(math.radians(nominal)), math.sin(math.radians(nominal))])
    guess = guess_wiring(channels, _directions(observation, cells) @ push, wanted)
    severity: Severity = "error" if off > _ANGLE_ERROR else "warning"
    if guess:
        observation.report.doubts.add("force")
    stated = f"static_load_direction of pad {observation.run.pad} is {nominal:g} deg"
    text = f"the load rises toward {shows:.0f} deg, {stated}{guess}"
    cure = "Check pad and static_load_direction of this run, and the cells' axes and cables"
    observation.report.say(f"push direction{guess}", severity, "force", text, cure)


def _check_follows(observation: Observation, planes: tuple[FloatArray, FloatArray], push: FloatArray) -> float | None:
    """The shaft must go toward the pad, mainly along the load; by how much it goes aside [deg], None where untold."""
    unit = push / np.hypot(*push)
    load = planes[0] @ unit
    centred = load - load.mean()
    slope = centred @ (planes[1] - planes[1].mean(axis=0)) / float(centred @ centred)
    size = float(np.hypot(*slope))
    if size * float(np.ptp(load)) < _FIRM_MOVE:
        return None
    if float(slope @ unit) > _FOLLOWS * size:
        return math.degrees(math.atan2(unit[0] * slope[1] - unit[1] * slope[0], float(slope @ unit)))
    probes = observation.pick("displacement")
    channels = [observation.channels[i] for i in probes]
    guess = guess_wiring(channels, _directions(observation, probes) @ slope, unit, within=20.0)
    goes, pushed = math.degrees(math.atan2(slope[1], slope[0])), math.degrees(math.atan2(unit[1], unit[0]))
    text = f"the shaft goes toward {goes:.0f} deg while the load pushes toward {pushed:.0f} deg{guess}"
    cure = "Check axis, polarity and cables of the probes"
    names = " and ".join(c.name for c in channels)
    _say_of_probes(observation, f"signs {names}{guess}", "error", text, cure)
    return None


def _say_of_probes(observation: Observation, key: str, severity: Severity, text: str, cure: str) -> None:
    """Say what is wrong with the probes, in whatever run they serve."""
    names = [observation.channels[i].name for i in observation.pick("displacement")]
    observation.report.say(key, severity, f"channels {' and '.join(names)}", text, cure, names)


def check_sweeps(runs: Sequence[Observation]) -> None:
    """Clearance runs: the shaft moves to the side to which the small load pushes it."""
    for observation in runs:
        planes = _planes(observation)
        if planes is None:
            continue
        force, shaft = planes[0] - planes[0].mean(axis=0), planes[1] - planes[1].mean(axis=0)
        sizes = np.linalg.svd(force, compute_uv=False)
        if sizes[-1] < 0.3 * sizes[0]:
            text = "the load does not sweep around all directions"
            observation.report.say("sweep", "warning", "force", text, "A clearance run needs a rotating load")
            continue
        gain = np.linalg.lstsq(force, shaft, rcond=None)[0].T
        if _judge_gain(observation, gain):
            _judge_turns(observation, _turns(observation))


def _turns(observation: Observation) -> FloatArray:
    """Angle of every probe's axis, as the load that goes around shows it, less the stated one (m,) [deg]."""
    force, probes = observation.pick("force"), observation.pick("displacement")
    samples = observation.samples[np.isfinite(observation.samples[:, force + probes]).all(axis=1)]
    load = samples[:, force] @ np.linalg.pinv(_directions(observation, force)).T
    load -= load.mean(axis=0)
    design = np.column_stack([load / np.linalg.norm(load, axis=1, keepdims=True), np.ones(len(load))])
    answer = np.linalg.lstsq(design, samples[:, probes], rcond=None)[0]
    along = _directions(observation, probes)
    turned = along[:, 0] * answer[1] - along[:, 1] * answer[0]
    return np.asarray(np.degrees(np.arctan2(turned, np.sum(along * answer[:2].T, axis=1))))


def _judge_turns(observation: Observation, turns: FloatArray) -> None:
    """Axes of probes (m,) [deg] that lie elsewhere than stated, all alike or some."""
    names = [observation.channels[i].name for i in observation.pick("displacement")]
    common = float(np.median(turns))
    cure = "Check the axes of the probes (and of the cells)"
    if abs(common) > _TURNED[0]:
        severity: Severity = "error" if abs(common) > _TURNED[1] else "warning"
        text = f"the shaft lies {common:+.0f} deg from where the load pushes it, as if all probes stood there"
        _say_of_probes(observation, f"turned {' '.join(names)}", severity, text, cure)
        return
    for name, turn in zip(names, turns):
        if abs(turn - common) > _TURNED[0]:
            severity = "error" if abs(turn - common) > _TURNED[1] else "warning"
            text = f"answers the load as if it stood {turn - common:+.0f} deg from its axis"
            observation.report.say(f"turned {name}", severity, f"channel {name}", text, cure, [name])


def check_locus(runs: Sequence[Observation]) -> None:
    """Locus runs together: mean positions follow the directions of the loads."""
    groups: dict[object, list[Observation]] = {}
    for observation in runs:
        measured = len(observation.pick("displacement")) == 2 and len(observation.pick("force")) >= 2
        if observation.lines is not None and measured and "force" not in observation.report.doubts:
            point = observation.run.point
            groups.setdefault((point.static_load, point.spin), []).append(observation)
    for group in groups.values():
        loads: list[FloatArray] = []
        places: list[FloatArray] = []
        for observation in group:
            assert observation.lines is not None
            for quantity, into in (("force", loads), ("displacement", places)):
                columns = observation.pick(quantity)
                into.append(to_plane([observation.channels[i] for i in columns], observation.lines.mean[columns]))
        force, shaft = np.array(loads), np.array(places)
        rows = np.isfinite(np.hstack([force, shaft])).all(axis=1)
        if np.count_nonzero(rows) < 4:
            continue
        force, shaft = force[rows] - force[rows].mean(axis=0), shaft[rows] - shaft[rows].mean(axis=0)
        sizes = np.linalg.svd(force, compute_uv=False)
        if sizes[-1] > 0.3 * sizes[0]:
            gain = np.linalg.lstsq(force, shaft, rcond=None)[0].T
            for observation in group:
                _judge_gain(observation, gain)
            _judge_places([group[i] for i in np.flatnonzero(rows)], shaft, shaft - force @ gain.T)


def _judge_places(group: Sequence[Observation], shaft: FloatArray, off: FloatArray) -> None:
    """A position that lies elsewhere than the others of its load and speed let one expect."""
    size, misfit = float(np.median(np.hypot(*shaft.T))), np.hypot(*off.T)
    for observation, distance in zip(group, misfit):
        if len(group) >= 6 and distance > max(0.7 * size, 5 * float(np.median(misfit))):
            text = f"the mean position lies {1e6 * distance:.0f} um from where the other directions let one expect it"
            cure = "Check the probes of this run: sign, sensitivity, moved?"
            observation.report.say("place", "warning", "displacement", text, cure)


def _judge_gain(observation: Observation, gain: FloatArray) -> bool:
    """Whether `gain` (2, 2) [m/N] from force to displacement is positive definite, as it must be."""
    if definiteness(gain) > _LEAST_DEFINITE or not np.any(gain) or "force" in observation.report.doubts:
        return bool(np.any(gain)) and "force" not in observation.report.doubts
    channels = [observation.channels[i] for i in observation.pick("displacement")]
    hint = name_fault(channels, lambda repair: definiteness(mirrored(channels, repair) @ gain))
    names = " and ".join(c.name for c in channels)
    text = f"the shaft does not go to the side to which the load pushes it{hint}"
    cure = "Check axis, polarity and cables of the probes (and of the cells)"
    _say_of_probes(observation, f"signs {names}{hint}", "error" if hint else "warning", text, cure)
    return False


def _check_labels(directions: Sequence[_Shown]) -> None:
    """Name runs whose pad number contradicts another run's.

    Two runs that contradict each other do not tell which of them is wrong. The others do: pads stand evenly around the
    shaft, so that the run is wrong which the arrangement that most runs agree on leaves over.
    """
    pairs = [
        (first, second) for i, second in enumerate(directions) for first in directions[:i] if _contradict(first, second)
    ]
    if not pairs:
        return
    odd = _odd_ones(directions)
    for first, second in pairs:
        struck = [suspect for suspect in (first, second) if id(suspect[0]) in odd]
        suspect, partner = (
            (struck[0], first if struck[0] is second else second) if len(struck) == 1 else (second, first)
        )
        _tell(suspect, partner, odd.get(id(suspect[0])) if len(struck) == 1 else None)


def _contradict(first: _Shown, second: _Shown) -> bool:
    near = angle_between(first[1], second[1]) < _SAME_PAD
    return near != (first[0].run.pad == second[0].run.pad)


def _tell(suspect: _Shown, partner: _Shown, belongs: int | None) -> None:
    """Name a contradiction, at the run that is wrong where that is known."""
    observation, shows = suspect
    text = f"pad {observation.run.pad} is loaded toward {shows:.0f} deg"
    if observation.run.pad == partner[0].run.pad:
        text += f" here, toward {partner[1]:.0f} deg in run {partner[0].run.id}"
    else:
        text += f", as is pad {partner[0].run.pad} in run {partner[0].run.id}"
    cure = "One of the two runs names the wrong pad: correct it"
    if belongs is not None:
        text += f"; by the directions of the other runs it is pad {belongs}"
        cure = "Correct the pad number of this run"
    if not any(f.key == "pad" for f in observation.report.found):
        observation.report.say("pad", "error", "pad", text, cure)


def _odd_ones(directions: Sequence[_Shown]) -> dict[int, int]:
    """Runs (by identity) that the evenly spaced arrangement of all others leaves over, with the pad that they load.

    Empty where fewer than three runs agree on one arrangement, or where two arrangements serve as many.
    """
    largest = max((observation.run.pad or 0) for observation, _ in directions)
    table: dict[frozenset[int], dict[int, int]] = {}
    for count in _PADS:
        for sense in (1, -1):
            if count < largest:
                continue
            step = 360.0 * sense / count
            for observation, shows in directions:
                first = shows - step * ((observation.run.pad or 1) - 1)
                places = {id(s): _pad_at(d, first, step, count) for s, d in directions}
                fit = frozenset(id(s) for s, _ in directions if places[id(s)] == s.run.pad)
                deviating = {id(s): places[id(s)] for s, _ in directions if id(s) not in fit}
                if len(fit) >= 3 and None not in deviating.values():
                    table.setdefault(fit, {k: v for k, v in deviating.items() if v is not None})
    most = max((len(fit) for fit in table), default=0)
    best = [deviating for fit, deviating in table.items() if len(fit) == most]
    return best[0] if len(best) == 1 and 2 * most > len(directions) else {}


def _pad_at(direction: float, first: float, step: float, count: int) -> int | None:
    """Number of the pad toward which a load goes; None between pads."""
    number = round((direction - first) / step)
    return number % count + 1 if angle_between(direction, first + number * step) < _AT_PAD else None
