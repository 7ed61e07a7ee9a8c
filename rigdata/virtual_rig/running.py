"""Runs with the shaft turning: dynamic and locus. Forces on the film, and how shaft and housing answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig.instruments import Instruments
from rigdata.virtual_rig.motion import MotionLine, RunPhysics, SteadyMotion
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.plan import PlannedRun
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError, load_vector


def running_physics(run: PlannedRun, truth: RigTruth, instruments: Instruments, noise: Noise, seed: int) -> RunPhysics:
    """Physics of a dynamic or locus run.

    The actuators' force goes through the film: F_oil = H d at every line, d shaft relative to housing. The
    housing stands on its cells, so F_oil = F_cell + m_h a_h with F_cell = k_cell x_h.
    """
    if run.point is None:
        raise VirtualRigError(f"run {run.id} needs a set point")
    rng = stream(seed, run.record, "physics")
    actual = _missed(run.point, noise, rng)
    stiffness_point = actual if noise.set_point.stiffness_follows else run.point
    position_point = actual if noise.set_point.position_follows else run.point
    shaft_angle = rng.uniform(0, 2 * np.pi)
    forces = _actuator_forces(run, noise, rng)
    unbalance = noise.shaft.unbalance * actual.shaft_speed**2
    if unbalance:
        turning = unbalance * np.array([1.0, -1j]) * np.exp(1j * shaft_angle)
        forces.append((actual.shaft_speed, turning))
    lines = tuple(
        answer(frequency, force, truth.h(replace(stiffness_point, excitation=frequency)), instruments)
        for frequency, force in forces
    )
    motion = SteadyMotion(
        position=truth.centre(replace(position_point, excitation=0.0)),
        load=load_vector(actual),
        lines=lines,
        temperature=truth.temperatures(replace(position_point, excitation=0.0)),
        speed=actual.shaft_speed,
        surface=_surface_runout(noise, seed, shaft_angle),
    )
    time = np.arange(round(run.seconds * run.rate)) / run.rate
    return RunPhysics(time, motion, _facts(actual, motion))


def _missed(point: OperatingPoint, noise: Noise, rng: np.random.Generator) -> OperatingPoint:
    """Draw the point that is really run when the set point is `point`."""
    miss = noise.set_point
    load, direction, speed = rng.standard_normal(3)
    return replace(
        point,
        static_load=point.static_load * (1 + miss.load * load),
        static_load_direction=point.static_load_direction + miss.direction * direction,
        shaft_speed=point.shaft_speed * (1 + miss.speed * speed),
    )


def _actuator_forces(run: PlannedRun, noise: Noise, rng: np.random.Generator) -> list[tuple[float, ComplexArray]]:
    """Force phasors (2,) [N] of the actuators, with their frequencies [rad/s]."""
    forces: list[tuple[float, ComplexArray]] = []
    if run.direction is None:
        return forces
    along = np.array([np.cos(run.direction), np.sin(run.direction)])
    across = np.array([-along[1], along[0]])
    defects = noise.actuators
    for frequency, amplitude in run.lines:
        phase = np.exp(1j * rng.uniform(0, 2 * np.pi))
        gain = 1 + defects.scatter * rng.standard_normal()
        talk = defects.cross_talk * (rng.standard_normal() + 1j * rng.standard_normal()) / np.sqrt(2)
        forces.append((frequency, amplitude * phase * (gain * along + talk * across)))
        for order, share in enumerate(defects.harmonics, 2):
            turn = np.exp(1j * rng.uniform(0, 2 * np.pi))
            forces.append((order * frequency, amplitude * share * turn * along))
    return forces


def answer(frequency: float, force: ComplexArray, h: ComplexArray, instruments: Instruments) -> MotionLine:
    """How shaft and housing answer an oil force phasor (2,) [N] at one frequency [rad/s].

    The film passes the force on to the housing: k_cell x_h - m_h omega^2 x_h = F_oil.
    """
    cells = np.array(instruments.cell_stiffness)
    # written with the compliance, so that rigid cells (infinite stiffness) are no special case
    housing = (force / cells) / (1 - instruments.true_mass * frequency**2 / cells)
    acceleration = -(frequency**2) * housing
    return MotionLine(
        frequency=frequency,
        oil_force=force,
        displacement=np.asarray(np.linalg.solve(h, force), dtype=complex),
        cell_force=force - instruments.true_mass * acceleration,
        acceleration=acceleration,
    )


def _surface_runout(noise: Noise, seed: int, shaft_angle: float) -> ComplexArray:
    """Runout phasors of 1X, 2X, ... [m] at a shaft angle [rad]; the surface is the same in the whole campaign."""
    sizes = np.array(noise.shaft.runout, dtype=float)
    orders = np.arange(1, len(sizes) + 1)
    phases = stream(seed, "", "campaign").uniform(0, 2 * np.pi, len(sizes))
    return sizes * np.exp(1j * (phases + orders * shaft_angle))


def _facts(actual: OperatingPoint, motion: SteadyMotion) -> dict[str, object]:
    return {
        "static_load_N": actual.static_load,
        "static_load_direction_deg": actual.static_load_direction_deg,
        "shaft_speed_Hz": actual.shaft_speed_hz,
        "x_m": float(motion.position[0]),
        "y_m": float(motion.position[1]),
        "lines": [
            {
                "frequency_Hz": round(line.frequency / (2 * np.pi), 9),
                "oil_force_N": _parts(line.oil_force),
                "displacement_m": _parts(line.displacement),
            }
            for line in motion.lines
        ],
    }


def _parts(phasor: ComplexArray) -> list[list[float]]:
    """[[Re x, Im x], [Re y, Im y]]."""
    return [[float(p.real), float(p.imag)] for p in phasor]
