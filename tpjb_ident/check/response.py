"""Signs and places of sensors, from how the shaft answers to force.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe
wired to the wrong input or with the wrong sign turns the answer into its mirror image, which is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Severity
from tpjb_ident.check.agreement import check_agreement, check_gains
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.point_readings import PointReadings, point_readings, probe_centres
from tpjb_ident.check.set_points import excited, oil_force, plane_of
from tpjb_ident.check.wiring import name_fault
from tpjb_ident.phasors.shaft import shaft_order

#: Where half of the runs differ by more than this share there is no one answer to judge.
_NO_ANSWER = 0.08
_DEFINITE = 0.05
_MAX_ANISOTROPY = 6.0


def check_responses(runs: Sequence[Observation], mass: float, sweeps: Sequence[Observation] = ()) -> None:
    """Compare the dynamic runs of every operating point with each other and with what a film can do."""
    groups: dict[object, list[Observation]] = {}
    for observation in runs:
        point = observation.run.point
        if shaft_order(point.excitation_hz, point.shaft_speed_hz):  # runout answers there too, as no film does
            continue
        if _shows_response(observation, mass):
            probes = tuple((c.name, c.axis) for c in observation.of("displacement"))
            groups.setdefault((point, *probes), []).append(observation)
    centres = probe_centres(sweeps)
    for group in groups.values():
        readings = point_readings(group, mass, centres)
        stiffness = readings.robust_stiffness()
        if stiffness is None:
            continue
        _check_signs(readings, stiffness)
        check_gains(readings, check_agreement(readings, stiffness))


def _shows_response(observation: Observation, mass: float) -> bool:
    """Whether two probes show the excitation, and the force is known and not in doubt already."""
    probes = observation.pick("displacement")
    if len(probes) != 2 or "force" in observation.report.doubts or not excited(observation):
        return False
    if observation.lines is None or oil_force(observation, mass) is None:
        return False
    readings = observation.lines.phasor[probes]
    return bool(np.all(np.isfinite(readings)) and np.any(np.abs(readings) > 8 * observation.lines.floor[probes]))


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


def _check_signs(readings: PointReadings, stiffness: ComplexArray) -> None:
    """Positive stiffness and damping; most of the runs must agree, else there is no one answer to judge."""
    if np.median(readings.misfits(stiffness)) > _NO_ANSWER:
        return
    channels = readings.channels[:2]
    names = " and ".join(c.name for c in channels)
    if _film_like(stiffness) > _DEFINITE:
        _check_scales(readings, stiffness, names)
        return
    hint = name_fault(channels, lambda repair: _film_like(stiffness @ np.linalg.inv(mirrored(channels, repair))))
    damping = float(np.linalg.eigvalsh((stiffness.imag + stiffness.imag.T) / 2)[0])
    kind = "damping" if definiteness(stiffness.real) > _DEFINITE else "stiffness"
    text = f"answer the force with negative {kind}, which a film does not have{hint}"
    cure = "Check axis, polarity and cables of the probes (and of the cells)"
    severity: Severity = "error" if hint or damping < 0 else "warning"
    for observation in readings.seen:
        observation.report.say(f"signs {names}{hint}", severity, f"channels {names}", text, cure)


def _check_scales(readings: PointReadings, stiffness: ComplexArray, names: str) -> None:
    """A film is not many times stiffer along one probe than along the other."""
    sizes = np.linalg.norm(stiffness @ readings.probe_plane, axis=0)
    if sizes.max() < _MAX_ANISOTROPY * sizes.min():
        return
    large, small = readings.channels[int(np.argmin(sizes))].name, readings.channels[int(np.argmax(sizes))].name
    text = (
        f"{large} moves {sizes.max() / sizes.min():.0f} times more per force than {small}; "
        "as if one sensitivity were ten times off"
    )
    cure = "Check the sensitivities of the two probes"
    for observation in readings.seen:
        observation.report.say(f"scales {names}", "warning", f"channels {names}", text, cure)
