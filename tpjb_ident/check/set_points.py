"""Set points of a run against what its channels show: load, directions, speed, excitation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from rigdata.vector import directions, inverse_directions
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.wiring import guess_wiring, repairs
from tpjb_ident.phasors.bad_samples import robust_deviation
from tpjb_ident.phasors.run_data import oil_force as film_force

#: Angle [deg] between what is stated and what is shown: warning, error.
ANGLE_WARNING, ANGLE_ERROR = 10.0, 30.0
_SPEED_STILL = 2 * math.pi * 0.5
_LINE_OVER_FLOOR = 8.0
#: A mean force below this share of the set point is none, if it is not clearly there.
_NO_STATIC = (0.002, 0.02)
#: Runs needed before the load of one can be told apart; share (or angle, as a share of the load) that is no scatter,
#: and robust standard deviations over the runs.
_MIN_RUNS, _LOAD_OFF, _MANY = 4, 0.04, 6.0


def plane_of(channels: Sequence[Channel]) -> FloatArray:
    """Matrix (2, m) from one reading per channel to X, Y."""
    return inverse_directions(tuple(float(c.axis or 0.0) for c in channels))


def plane_vector(observation: Observation, quantity: str, values: NDArray[Any]) -> NDArray[Any] | None:
    """X, Y of one value per channel of `quantity`; None where its channels do not span the plane; `values` (m,)."""
    places = observation.pick(quantity)
    if len(places) < 2:
        return None
    vector = plane_of(observation.of(quantity)) @ values[places]
    return vector if np.all(np.isfinite(vector)) else None


def angle_between(first: float, second: float, period: float = 360.0) -> float:
    """Smallest angle between two directions [deg]."""
    return abs((first - second + period / 2) % period - period / 2)


def check_static_loads(observations: Sequence[Observation]) -> bool:
    """Mean force of dynamic and locus runs against the stated static load, its direction, and the other runs.

    Cells that show no static force in any run are of a kind that shows none: that is a note, and nothing is held
    against them; it is False then.
    """
    shown: list[tuple[Observation, complex]] = []
    for observation in observations:
        nominal = observation.run.point.static_load
        if observation.run.kind in {"dynamic", "locus"} and observation.lines is not None and nominal > 0:
            mean = plane_vector(observation, "force", observation.lines.mean)
            if mean is not None:
                turn = np.exp(-1j * observation.run.point.static_load_direction)
                shown.append((observation, complex(complex(mean[0], mean[1]) / nominal * turn)))
    ratios = np.array([ratio for _, ratio in shown], dtype=complex)
    if without_static_part(ratios):
        for observation, _ in shown:
            text = "is none, as of piezo-electric cells"
            observation.report.say(
                "no static force", "note", "mean force", text, "Nothing; static loads are taken as set"
            )
        return False
    for observation, ratio in shown:
        _check_size(observation, abs(ratio))
        if abs(ratio) >= 0.02:
            _check_direction(observation, math.degrees(np.angle(ratio)))
    if len(shown) < _MIN_RUNS:
        return True
    middle = complex(np.median(ratios.real), np.median(ratios.imag))
    off = np.abs(ratios - middle) / max(abs(middle), 1e-12)
    allowed = max(_LOAD_OFF, _MANY * robust_deviation(off))
    for (observation, ratio), distance in zip(shown, off):
        reported = any(f.key.startswith("load ") for f in observation.report.found)
        if distance > allowed and not reported:
            text = (
                f"is {abs(ratio / middle) - 1:+.1%} in size and {math.degrees(np.angle(ratio / middle)):+.1f} deg in "
                "direction off what the set point and the other runs of the campaign let one expect"
            )
            cure = "Check static_load and its direction in this run, and the gain of the cells"
            observation.report.say("load ratio", "warning", "mean force", text, cure)
    return True


def without_static_part(ratios: ComplexArray) -> bool:
    """Whether the cells show no static force at all, as piezo-electric ones: not a little of it, but none."""
    if not len(ratios):
        return False
    mean = abs(complex(ratios.mean()))
    error = float(np.sqrt(np.mean(np.abs(ratios - ratios.mean()) ** 2) / max(len(ratios) - 1, 1)))
    return bool(mean < _NO_STATIC[0] or (mean < _NO_STATIC[1] and mean < 4 * error))


def _check_direction(observation: Observation, off: float) -> None:
    """Mean force that points so far from the stated load [deg]."""
    if abs(off) <= ANGLE_WARNING or observation.lines is None:
        return
    point = observation.run.point
    readings = observation.lines.mean[observation.pick("force")]
    guess = guess_wiring(observation.of("force"), readings, directions(point.static_load_direction))
    severity: Severity = "error" if abs(off) > ANGLE_ERROR else "warning"
    if severity == "error":
        observation.report.doubts.add("force")
    nominal = point.static_load_direction_deg
    points = math.remainder(nominal + off, 360.0)
    text = f"points to {points:.0f} deg, static_load_direction is {nominal:g} deg{guess}"
    cure = "Check the cells' axis and polarity, their cables, and static_load_direction"
    observation.report.say(f"load direction{guess}", severity, "mean force", text, cure)


def _check_size(observation: Observation, ratio: float) -> None:
    off = abs(ratio - 1.0)
    if off <= 0.1:
        return
    hint = ""
    for factor in (10.0, 100.0, 1000.0):
        for times, word in ((factor, "too small"), (1 / factor, "too large")):
            if abs(ratio / times - 1.0) < 0.3:
                hint = f"; as if the sensitivity in the manifest were {factor:g} times {word}"
    severity: Severity = "error" if ratio < 0.7 or ratio > 1.4 else "warning"
    load = observation.run.point.static_load
    text = f"is {ratio * load:.4g} N, static_load says {load:.4g} N ({ratio:.3g} times){hint}"
    cure = "Check sensitivity, full_scale and excitation of the cells, and static_load"
    observation.report.say(f"load size{hint}", severity, "mean force", text, cure)


def check_speed(observation: Observation) -> None:
    """Speed channel against the stated shaft speed."""
    nominal, measured = observation.run.point.shaft_speed, observation.speed
    if math.isnan(measured):
        return
    stated_hz, measured_hz = nominal / (2 * math.pi), measured / (2 * math.pi)
    if nominal == 0.0:
        if abs(measured) > _SPEED_STILL:
            text = f"shows {measured_hz:.3g} Hz in a run without rotation"
            observation.report.say("speed", "warning", "speed channel", text, "Check the channel, kind and shaft_speed")
        return
    off = abs(measured / nominal - 1.0)
    if off > 0.03:
        severity: Severity = "error" if off > 0.1 else "warning"
        text = f"shows {measured_hz:.4g} Hz, shaft_speed says {stated_hz:.4g} Hz"
        observation.report.say(
            "speed", severity, "speed channel", text, "Check shaft_speed and the channel's sensitivity"
        )


def oil_force(observation: Observation, mass: float) -> ComplexArray | None:
    """Force phasor of the film on the housing, F_cell + m_h a_h, X and Y [N]; None where not measured."""
    if observation.lines is None:
        return None
    force = plane_vector(observation, "force", observation.lines.phasor)
    if force is None:
        return None
    acceleration = plane_vector(observation, "acceleration", observation.lines.phasor)
    if math.isnan(mass):  # not stated: the housing's inertia stays in the force
        acceleration, mass = None, 0.0
    return film_force(force, acceleration, mass)


def excited(observation: Observation) -> bool:
    """Whether the force shows the excitation line above its noise."""
    if observation.lines is None:
        return False
    cells = observation.pick("force")
    size, floor = np.abs(observation.lines.phasor[cells]), observation.lines.floor[cells]
    return bool(np.any(size > _LINE_OVER_FLOOR * floor) and np.any(size > 0))


def check_excitation(runs: Sequence[Observation], mass: float) -> None:
    """Excitation of dynamic runs: there at all, as strong as in the other runs, in the stated direction."""
    forces = {id(s): f for s in runs if (f := oil_force(s, mass)) is not None}
    relative = {
        id(s): float(np.linalg.norm(forces[id(s)])) / max(s.run.point.static_load, 1e-9)
        for s in runs
        if id(s) in forces and excited(s)
    }
    usual = float(np.median(list(relative.values()))) if relative else 0.0
    shown: list[tuple[Observation, ComplexArray]] = []
    for observation in runs:
        if id(observation) not in forces:
            continue
        if id(observation) not in relative or (len(relative) > 3 and relative[id(observation)] < 0.1 * usual):
            _missing_line(observation)
        elif "force" not in observation.report.doubts:
            shown.append((observation, forces[id(observation)]))
    _check_directions(shown)


def _missing_line(observation: Observation) -> None:
    point = observation.run.point
    frequency = observation.other_line
    hint = f"; the strongest other line is near {frequency:.3g} Hz" if math.isfinite(frequency) else ""
    text = f"the force shows no line at the excitation frequency of {point.excitation_hz:g} Hz{hint}"
    cure = "Check excitation_frequency, and whether the actuators ran; repeat the run"
    observation.report.say("no excitation", "error", "force", text, cure)
    observation.report.doubts.add("force")


def _along(force: ComplexArray) -> float:
    """Direction of the long axis of the force ellipse [deg, modulo 180]; NaN where it is nearly a circle."""
    sizes, axes = np.linalg.eigh(np.real(np.outer(force, force.conj())))
    return math.degrees(math.atan2(axes[1, 1], axes[0, 1])) if sizes[0] < 0.25 * sizes[1] else math.nan


def _check_directions(shown: Sequence[tuple[Observation, ComplexArray]]) -> None:
    directed = [
        (s, f, math.degrees(s.run.excitation_direction)) for s, f in shown if s.run.excitation_direction is not None
    ]
    off = [(s, f, d) for s, f, d in directed if angle_between(_along(f), d, 180.0) > ANGLE_WARNING]
    guess = _common_wiring([(s, d) for s, _, d in directed]) if len(off) > 2 else ""
    for observation, _, _ in directed if guess else ():
        observation.report.doubts.add("force")  # the cells are wired wrongly in the other runs too
    for observation, force, nominal in off:
        shows = _along(force)
        severity: Severity = "error" if guess or angle_between(shows, nominal, 180.0) > ANGLE_ERROR else "warning"
        if severity == "error":
            observation.report.doubts.add("force")
        near = round(nominal + (shows - nominal + 90.0) % 180.0 - 90.0)
        text = f"the excitation shows along {near} deg, excitation_direction says {nominal:g} deg{guess}"
        cure = "Check excitation_direction, and the cells' axes and cables"
        observation.report.say(f"excitation direction{guess}", severity, "force", text, cure)


def _common_wiring(directed: Sequence[tuple[Observation, float]]) -> str:
    """One fault of the cells that brings nearly all excitations into their stated directions."""
    channels = directed[0][0].of("force")
    if len(channels) != 2:
        return ""
    for words, matrix in repairs(channels):
        correct = 0
        for observation, nominal in directed:
            same = [c.name for c in observation.of("force")] == [c.name for c in channels]
            if observation.lines is not None and same:
                repaired = plane_of(channels) @ matrix @ observation.lines.phasor[observation.pick("force")]
                correct += angle_between(_along(repaired), nominal, 180.0) <= ANGLE_WARNING
        if correct >= 0.8 * len(directed):
            return f"; as if {words}"
    return ""
