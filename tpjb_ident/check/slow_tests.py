"""Check dry, clearance and locus runs: the shaft must go where it is pushed, toward the stated pad."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from rigdata.vector import directions
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.response import definiteness, mirrored
from tpjb_ident.check.set_points import ANGLE_ERROR, ANGLE_WARNING, angle_between, plane_of, plane_vector
from tpjb_ident.check.wiring import guess_wiring, name_fault

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
_LEAST_PADS, _MOST_PADS = 3, 12
#: Smaller over larger extent of a load that goes around.
_GOES_AROUND = 0.3
_Planes = tuple[FloatArray, FloatArray, FloatArray]


def _planes(observation: Observation) -> _Planes | None:
    """Force and displacement (n, 2), probes (n, m) of the thinned samples, rows without a value left out."""
    probes, cells = observation.pick("displacement"), observation.pick("force")
    if len(cells) < 2 or len(probes) < 2:
        return None
    force = observation.samples[:, cells] @ plane_of(observation.of("force")).T
    shaft = observation.samples[:, probes] @ plane_of(observation.of("displacement")).T
    rows = np.isfinite(np.hstack([force, shaft])).all(axis=1)
    if np.count_nonzero(rows) < 20:
        return None
    return force[rows], shaft[rows], observation.samples[rows][:, probes]


def _along(channels: Sequence[Channel]) -> FloatArray:
    """Unit vectors (m, 2) of some channels."""
    return directions(np.array([c.axis for c in channels]))


def check_dry(runs: Sequence[Observation]) -> None:
    """Dry pivot runs: a load that rises, its direction, pads told apart."""
    pushed: list[tuple[Observation, float]] = []
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
        pushed.append((observation, shows))
        if "static_load_direction" in observation.run.stated:
            _check_push(observation, shows, push)
    _check_labels([observation for observation, _ in pushed], [shows for _, shows in pushed])


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
    point, channels = observation.run.point, observation.of("force")
    off = angle_between(shows, point.static_load_direction_deg)
    if off <= ANGLE_WARNING:
        return
    guess = guess_wiring(channels, _along(channels) @ push, directions(point.static_load_direction))
    severity: Severity = "error" if off > ANGLE_ERROR else "warning"
    if guess:
        observation.report.doubts.add("force")
    stated = f"static_load_direction of pad {observation.run.pad} is {point.static_load_direction_deg:g} deg"
    text = f"the load rises toward {shows:.0f} deg, {stated}{guess}"
    cure = "Check pad and static_load_direction of this run, and the cells' axes and cables"
    observation.report.say(f"push direction{guess}", severity, "force", text, cure)


def _check_follows(observation: Observation, planes: _Planes, push: FloatArray) -> float | None:
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
    channels = observation.of("displacement")
    guess = guess_wiring(channels, _along(channels) @ slope, unit, within=20.0)
    goes, pushed = math.degrees(math.atan2(slope[1], slope[0])), math.degrees(math.atan2(unit[1], unit[0]))
    text = f"the shaft goes toward {goes:.0f} deg while the load pushes toward {pushed:.0f} deg{guess}"
    cure = "Check axis, polarity and cables of the probes"
    _say_of_probes(observation, ("signs", guess), "error", text, cure)
    return None


def _say_of_probes(observation: Observation, key: tuple[str, str], severity: Severity, text: str, cure: str) -> None:
    """Say what is wrong with the probes, in whatever run they serve; `key` stands around their names."""
    names = [channel.name for channel in observation.of("displacement")]
    listed = " and ".join(names)
    observation.report.say(f"{key[0]} {listed}{key[1]}", severity, f"channels {listed}", text, cure, names)


def check_sweeps(runs: Sequence[Observation]) -> None:
    """Clearance runs: the shaft moves to the side to which the small load pushes it."""
    for observation in runs:
        planes = _planes(observation)
        if planes is None:
            continue
        gain = _gain(planes[0], planes[1])
        if gain is None:
            text = "the load does not sweep around all directions"
            observation.report.say("sweep", "warning", "force", text, "A clearance run needs a rotating load")
        elif _judge_gain(observation, gain):
            _judge_turns(observation, _turns(observation.of("displacement"), planes))


def _gain(force: FloatArray, shaft: FloatArray) -> FloatArray | None:
    """Displacement by force (2, 2) [m/N] of some points (n, 2); None where the load does not go around."""
    about = force - force.mean(axis=0)
    sizes = np.linalg.svd(about, compute_uv=False)
    if sizes[-1] < _GOES_AROUND * sizes[0]:
        return None
    return np.asarray(np.linalg.lstsq(about, shaft - shaft.mean(axis=0), rcond=None)[0].T)


def _turns(probes: Sequence[Channel], planes: _Planes) -> FloatArray:
    """Angle of every probe's axis, as the load that goes around shows it, less the stated one (m,) [deg]."""
    load = planes[0] - planes[0].mean(axis=0)
    design = np.column_stack([load / np.linalg.norm(load, axis=1, keepdims=True), np.ones(len(load))])
    answer = np.linalg.lstsq(design, planes[2], rcond=None)[0]
    along = _along(probes)
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
