"""Signs and places of sensors, from how the shaft answers to force.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe
wired to the wrong input or with the wrong sign turns the answer into its mirror image, which is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from tpjb_ident.check.agreement import (
    RunResponse,
    check_agreement,
    check_gains,
    misfit_of,
    response_of,
    robust_stiffness,
)
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.point_readings import point_readings, probe_centres
from tpjb_ident.check.set_points import excited, plane_of, to_plane
from tpjb_ident.check.wiring import name_fault
from tpjb_ident.phasors.shaft import shaft_order

#: Where half of the runs differ by more than this share there is no one answer to judge.
_NO_ANSWER = 0.08
_DEFINITE = 0.05
_MAX_ANISOTROPY = 6.0


def check_responses(runs: Sequence[Observation], mass: float, sweeps: Sequence[Observation] = ()) -> None:
    """Compare the dynamic runs of every operating point with each other and with what a film can do."""
    groups: dict[object, list[RunResponse]] = {}
    for observation in runs:
        point = observation.run.point
        if shaft_order(point.excitation_hz, point.shaft_speed_hz):  # runout answers there too, as no film does
            continue
        response = response_of(observation, mass)
        if response is not None:
            names = tuple(c.name for c in response.channels)
            groups.setdefault((observation.run.point, names), []).append(response)
    centres = probe_centres(sweeps)
    for group in groups.values():
        stiffness = robust_stiffness(group)
        if stiffness is None:
            continue
        _check_signs(group, stiffness)
        probes, force = np.stack([a.readings for a in group]), np.stack([a.force for a in group])
        readings = point_readings([a.seen for a in group], probes, force, centres)
        outliers = check_agreement(group, stiffness, readings)
        if readings is not None:
            check_gains(group, outliers, readings)


def definiteness(matrix: NDArray[Any]) -> float:
    """Least over greatest eigenvalue of the symmetric part; 1 is isotropic, not above 0 impossible."""
    low, high = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    return float(low / high) if high > 0 else -1.0


def _film_like(stiffness: ComplexArray) -> float:
    return min(definiteness(stiffness.real), definiteness(stiffness.imag))


def mirrored(channels: Sequence[Channel], repair: FloatArray) -> FloatArray:
    """What a repair (2, 2) of the readings of two channels does to X, Y (2, 2)."""
    plane = plane_of(channels)
    return np.asarray(plane @ repair @ np.linalg.inv(plane))


def _check_signs(group: Sequence[RunResponse], stiffness: ComplexArray) -> None:
    """Positive stiffness and damping; most of the runs must agree, else there is no one answer to judge."""
    if np.median([misfit_of(a, stiffness) for a in group]) > _NO_ANSWER:
        return
    channels = group[0].channels
    names = " and ".join(c.name for c in channels)
    if _film_like(stiffness) > _DEFINITE:
        _check_scales(group, stiffness, names)
        return
    hint = name_fault(channels, lambda repair: _film_like(stiffness @ np.linalg.inv(mirrored(channels, repair))))
    damping = float(np.linalg.eigvalsh((stiffness.imag + stiffness.imag.T) / 2)[0])
    kind = "damping" if definiteness(stiffness.real) > _DEFINITE else "stiffness"
    for response in group:
        text = f"answer the force with negative {kind}, which a film does not have{hint}"
        cure = "Check axis, polarity and cables of the probes (and of the cells)"
        severity: Severity = "error" if hint or damping < 0 else "warning"
        response.seen.report.say(f"signs {names}{hint}", severity, f"channels {names}", text, cure)


def _check_scales(group: Sequence[RunResponse], stiffness: ComplexArray, names: str) -> None:
    """A film is not many times stiffer along one probe than along the other."""
    channels = group[0].channels
    sizes = np.linalg.norm(stiffness @ plane_of(channels), axis=0)
    if sizes.max() < _MAX_ANISOTROPY * sizes.min():
        return
    large, small = channels[int(np.argmin(sizes))].name, channels[int(np.argmax(sizes))].name
    text = (
        f"{large} moves {sizes.max() / sizes.min():.0f} times more per force than {small}; "
        "as if one sensitivity were ten times off"
    )
    for response in group:
        cure = "Check the sensitivities of the two probes"
        response.seen.report.say(f"scales {names}", "warning", f"channels {names}", text, cure)


def check_accelerometers(runs: Sequence[Observation]) -> None:
    """Housing acceleration against cell force: on springs, the two are in antiphase."""
    shown: dict[str, list[tuple[Observation, complex]]] = {}
    for observation in runs:
        for name, ratio in _accelerations(observation):
            shown.setdefault(name, []).append((observation, ratio))
    cure = "Check polarity, axis and sensitivity of the accelerometer"
    usual = {n: float(np.median([abs(r) for _, r in v])) for n, v in shown.items() if len(v) >= 3}
    for name, ratios in shown.items():
        directions = [r / abs(r) for _, r in ratios]
        if len(ratios) >= 3 and float(np.mean(np.real(directions))) > 0.7:
            text = "moves in phase with the cell force; the housing on its springs should move against it"
            for observation in {s.run.id: s for s, _ in ratios}.values():
                observation.report.say(f"accelerometer {name}", "warning", f"channel {name}", text, cure)
        least = min(usual.values(), default=math.nan)
        if name in usual and usual[name] > _MAX_ANISOTROPY * least:
            text = f"shows {usual[name] / least:.0f} times the acceleration per force of the other direction"
            for observation in {s.run.id: s for s, _ in ratios}.values():
                observation.report.say(f"acceleration {name}", "warning", f"channel {name}", text, cure)


def _accelerations(observation: Observation) -> list[tuple[str, complex]]:
    """Acceleration over cell force along each accelerometer that shows the line clearly."""
    lines, cells = observation.lines, observation.pick("force")
    if lines is None or len(cells) < 2 or "force" in observation.report.doubts or not excited(observation):
        return []
    phasors: list[tuple[str, complex]] = []
    for row in observation.phasors:
        force = to_plane([observation.channels[i] for i in cells], row[cells])
        for index in observation.pick("acceleration"):
            channel, phasor = observation.channels[index], row[index]
            axis = channel.axis or 0.0
            along = complex(force @ np.array([math.cos(axis), math.sin(axis)]))
            if abs(phasor) > 8 * lines.floor[index] and abs(along) > 0.3 * float(np.linalg.norm(force)):
                phasors.append((channel.name, complex(phasor) / along))
    return phasors
