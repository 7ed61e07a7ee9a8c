"""Runs against each other: static loads as the cells read them, housing acceleration per cell force, mean positions.

Both ratios belong to the rig and not to the bearing, so all runs share them, whatever their operating point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import excited, plane_vector
from tpjb_ident.check.wiring import repairs

#: Runs needed before one can be told apart.
_MIN_RUNS = 4
#: A load that differs by this share (or this angle, as a share of the load) from the others' is no scatter.
_LOAD_OFF = 0.04
#: In units of the robust standard deviation over the runs.
_MANY = 6.0
#: Share of the foretold acceleration.
_ACCELERATION_OFF = 0.1
#: Lines below this many times their noise say nothing.
_CLEAR = 30.0
#: No film bearing lets its shaft travel further [m].
_MAX_TRAVEL = 1e-3
#: Runs needed before one can be told apart.
_MIN_PLACES = 5
#: Distance from the median of like runs, in units of the range of the middle 80 % of them.
_FAR = 3.0
#: A smaller distance is no jump: dry runs press the shaft against pads on all sides [m].
_MIN_JUMP = {"running": 100e-6, "dry": 300e-6}
#: Runs of one operating point needed, distance from their median in robust standard deviations, and the least [m]: a
#: probe that drifts by 1.5 % of a gap of 1 mm within an operating point was touched, or its amplifier was.
_LIKE_RUNS, _STEP, _LEAST_STEP = 4, 6.0, 15e-6


def check_load_ratios(runs: Sequence[Observation]) -> None:
    """Mean force over set point of every dynamic and locus run against that of all others."""
    shown: list[tuple[Observation, complex]] = []
    for observation in runs:
        nominal = observation.run.point.static_load
        if observation.run.kind not in {"dynamic", "locus"} or observation.lines is None or not nominal > 0:
            continue
        mean = plane_vector(observation, "force", observation.lines.mean)
        if mean is not None:
            turn = complex(np.exp(1j * observation.run.point.static_load_direction))
            shown.append((observation, complex(mean[0], mean[1]) / (nominal * turn)))
    if len(shown) < _MIN_RUNS:
        return
    ratios = np.array([r for _, r in shown])
    middle = complex(np.median(ratios.real), np.median(ratios.imag))
    off = np.abs(ratios - middle) / max(abs(middle), 1e-12)
    allowed = max(_LOAD_OFF, _MANY * 1.4826 * float(np.median(off)))
    for (observation, ratio), distance in zip(shown, off):
        reported = any(f.key.startswith("load ") for f in observation.report.found)
        if distance > allowed and not reported:
            turned = math.degrees(np.angle(ratio / middle))
            text = (
                f"is {abs(ratio / middle) - 1:+.1%} in size and {turned:+.1f} deg in direction off what the set point "
                "and the other runs of the campaign let one expect"
            )
            cure = "Check static_load and its direction in this run, and the gain of the cells"
            observation.report.say("load ratio", "warning", "mean force", text, cure)


def check_housing(runs: Sequence[Observation]) -> None:
    """Acceleration against cell force of the dynamic runs of one frequency: one matrix serves them all."""
    groups: dict[tuple[float, tuple[str, ...]], list[tuple[Observation, ComplexArray, ComplexArray]]] = {}
    for observation in runs:
        accelerometers = observation.pick("acceleration")
        if (
            observation.lines is None
            or len(accelerometers) != 2
            or "force" in observation.report.doubts
            or not excited(observation)
        ):
            continue
        force = plane_vector(observation, "force", observation.lines.phasor)
        readings = observation.lines.phasor[accelerometers]
        if force is None or not np.all(np.isfinite(readings)):
            continue
        if np.linalg.norm(readings) < _CLEAR * np.linalg.norm(observation.lines.floor[accelerometers]):
            continue
        names = tuple(observation.channels[i].name for i in accelerometers)
        key = (round(observation.run.point.excitation_hz, 6), names)
        groups.setdefault(key, []).append((observation, force, np.asarray(readings)))
    for (_, names), group in groups.items():
        if len(group) >= _MIN_RUNS:
            _judge_housing(group, names)


def _misfit(force: ComplexArray, readings: ComplexArray, matrix: ComplexArray) -> float:
    return float(np.linalg.norm(readings - matrix @ force) / np.linalg.norm(readings))


def _common_matrix(group: Sequence[tuple[Observation, ComplexArray, ComplexArray]]) -> ComplexArray | None:
    """Matrix (2, 2) from cell force to readings with the least median misfit among all pairs of runs."""
    best: tuple[float, ComplexArray] | None = None
    all_forces, all_readings = np.array([f for _, f, _ in group]), np.array([r for _, _, r in group])
    sizes = np.linalg.norm(all_readings, axis=1)
    for first, second in combinations(group[:24], 2):
        forces = np.stack([first[1], second[1]], axis=1)
        scaled = forces / np.linalg.norm(forces, axis=0)
        if np.linalg.svd(scaled, compute_uv=False)[-1] < 0.3:
            continue
        matrix = np.asarray(np.linalg.solve(forces.T, np.stack([first[2], second[2]])).T, dtype=np.complex128)
        misfit = float(np.median(np.linalg.norm(all_readings - all_forces @ matrix.T, axis=1) / sizes))
        if best is None or misfit < best[0]:
            best = (misfit, matrix)
    return None if best is None else best[1]


def _judge_housing(group: Sequence[tuple[Observation, ComplexArray, ComplexArray]], names: Sequence[str]) -> None:
    matrix = _common_matrix(group)
    if matrix is None:
        return
    misfits = np.array([_misfit(f, r, matrix) for _, f, r in group])
    allowed = max(_ACCELERATION_OFF, _MANY * float(np.median(misfits)))
    for (observation, force, readings), misfit in zip(group, misfits):
        if misfit <= allowed:
            continue
        channels = [observation.channels[i] for i in observation.pick("acceleration")]
        tried = sorted((_misfit(force, m @ readings, matrix), words) for words, m in repairs(channels, scales=True))
        hint = f"; as if {tried[0][1]}" if tried[0][0] < min(misfit / 3, tried[1][0] / 2) else ""
        text = f"differs by {misfit:.0%} from what the cell force and the other runs at this frequency foretell{hint}"
        cure = "Check polarity, cables and sensitivity of the accelerometers in this run"
        place = f"channels {' and '.join(names)}"
        observation.report.say("housing", "warning", place, text, cure)


def check_positions(runs: Sequence[Observation]) -> None:
    """Mean readings of the probes (gap voltage included) run against run, and their travel."""
    places: dict[tuple[str, str], list[tuple[Observation, float]]] = {}
    for observation in runs:
        for index in observation.pick("displacement"):
            name = observation.channels[index].name
            low, middle, high = observation.spread[:, index]
            if not np.isfinite(middle):
                continue
            state = "running" if observation.run.kind in {"dynamic", "locus"} else "dry"
            places.setdefault((name, state), []).append((observation, float(middle)))
            if high - low > _MAX_TRAVEL:
                text = f"the shaft travels {1e3 * (high - low):.2g} mm, more than a film bearing lets it"
                cure = "Check the sensitivity of the probe, and for loose cables"
                observation.report.say(f"travel {name}", "warning", f"channel {name}", text, cure)
    for (name, state), means in places.items():
        _check_jumps(name, means, _MIN_JUMP[state])
        points: dict[object, list[tuple[Observation, float]]] = {}
        for observation, middle in means:
            if observation.run.kind == "dynamic":
                points.setdefault(observation.run.point, []).append((observation, middle))
        for like in points.values():
            _check_steps(name, like)


def _check_steps(name: str, means: Sequence[tuple[Observation, float]]) -> None:
    """One probe's means in the runs of one operating point."""
    if len(means) < _LIKE_RUNS:
        return
    values = np.array([m for _, m in means])
    off = values - np.median(values)
    allowed = max(_STEP * 1.4826 * float(np.median(np.abs(off))), _LEAST_STEP)
    for (observation, _), distance in zip(means, off):
        if abs(distance) > allowed and "displacement" not in observation.report.doubts:
            text = f"reads {1e6 * distance:+.0f} um on average beside the other runs at this operating point"
            cure = "Check probe and amplifier: moved, or another gain in this run?"
            observation.report.say(f"step {name}", "warning", f"channel {name}", text, cure)


def _check_jumps(name: str, means: Sequence[tuple[Observation, float]], least: float) -> None:
    if len(means) < _MIN_PLACES:
        return
    values = np.array([m for _, m in means])
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    allowed = max(_FAR * (high - low), least)
    for observation, mean in means:
        if abs(mean - middle) > allowed:
            text = (
                f"reads {1e6 * mean:.0f} um on average, others of its kind {1e6 * low:.0f} to {1e6 * high:.0f} um; "
                "the gap voltage is constant within a campaign"
            )
            cure = "Check the probe: moved, wrong sign, wrong sensitivity in this run?"
            observation.report.say(f"position {name}", "error", f"channel {name}", text, cure)
            observation.report.doubts.add("displacement")
