"""Sizes that no rig can show: a sensor description, a mass or a rate that is off by ten to a thousand.

Every bound is one of physics, not of this campaign: what probes resolve, what a film lets a shaft move, what cells give
way under the load that they carry, what a loader can hold against a stator's weight. The runs are judged one by one,
from their sizes at the excitation line alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.calibration import VECTOR_QUANTITIES
from rigdata.problem import RigDataError, Severity
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.observation import NO_NOISE, Observation
from tpjb_ident.phasors.slow_samples import is_spare

#: A running shaft's vibration, run-out and noise together, from low to high, that no probe shows [m].
_STILL_PROBE = 1e-7
#: Motion at the excitation line that is too little [m]: where the load over the dynamic stiffness is too short for any
#: film [m], and anywhere.
_LITTLE_MOTION, _SHORTEST_FILM, _NO_MOTION = 3e-8, 1e-6, 1e-8
#: Load over dynamic stiffness is below the clearance, which is 1.5 thousandths of a diameter at most; the diameter from
#: the load and the least specific load of a test [Pa], with a floor for tests of a few newtons [m]. Beyond any bearing.
_CLEARANCE_RATIO, _LEAST_PRESSURE, _CLEARANCE_FLOOR, _NO_CLEARANCE = 1.5e-3, 5e4, 1.5e-4, 1e-3
#: Housings that hang free move against the shaft as much as they accelerate; others may a few times more.
_FREE_HOUSING = 3.0
#: Gravity [m/s^2], and the share of the cells' force from which the inertia of a stator decides on K and C.
_GRAVITY, _INERTIA = 9.81, 0.1


@dataclass(frozen=True)
class Sizes:
    """Sizes of one run at its excitation line, SI; NaN where they are not measured."""

    report: Reporter
    motion: float  #: m, of the shaft against the housing
    cells: float  #: N
    acceleration: float  #: m/s^2
    film: float  #: N, cells and the housing's inertia
    static: float  #: N, mean of the cells

    @property
    def is_carried(self) -> bool:
        """Whether the cells carry the static load."""
        return self.static > 0.5 * self.report.run.point.static_load > 0


def check_magnitudes(observations: Sequence[Observation]) -> None:
    """Hold every run against what a rig can show; findings go to the runs' reports."""
    largest = max((observation.run.point.static_load for observation in observations), default=0.0)
    measured = []
    for observation in observations:
        _check_rate(observation.report, observation.run)
        is_sine = observation.run.kind == "dynamic" and observation.run.excitation_kind == "sine"
        check_travel(observation, is_sine)
        if is_sine:
            shown = [observation.line(q) * (1.0 if observation.shows(q) else np.nan) for q in VECTOR_QUANTITIES]
            vectors = *shown, observation.film_force, observation.mean("force")
            measured.append(Sizes(observation.report, *map(float, map(np.linalg.norm, vectors))))
    for sizes in measured:
        check_sizes(sizes)
    check_weight(measured, largest)


def check_travel(observation: Observation, is_sine: bool) -> None:
    """Probes that move too far, or, where a shaft that turns is shaken by a sine, not at all."""
    sizes = np.ptp(observation.spread, axis=0)
    travel = {observation.channels[k].name: float(sizes[k]) for k in observation.pick("displacement")}
    alive = [c for c in observation.channels if travel.get(c.name, 0.0) >= _STILL_PROBE]
    is_shown = is_sine and observation.run.point.shaft_speed > 0 and NO_NOISE not in observation.report.keys
    for channel in observation.of("displacement"):
        name, size = channel.name, travel[channel.name]
        observation.report.ask("travel", size, name)
        if is_shown:
            grave: Severity = "warning" if is_spare(channel, alive) else "error"
            observation.report.ask("still", _STILL_PROBE / max(size, 1e-30), name, grave=grave, travel=size)


def check_sizes(sizes: Sizes) -> None:
    """A shaft that moves too little or too far, cells too soft or too stiff for springs."""
    report, motion, acceleration = sizes.report, sizes.motion, sizes.acceleration
    point = report.run.point
    length = point.static_load * motion / sizes.film if sizes.film > 0 else math.nan
    if motion < (_LITTLE_MOTION if length < _SHORTEST_FILM else _NO_MOTION):
        report.ask("no motion", _LITTLE_MOTION / max(motion, 1e-30), motion=motion)
    bearing = _CLEARANCE_RATIO * math.sqrt(point.static_load / _LEAST_PRESSURE)
    if length > np.clip(bearing, _CLEARANCE_FLOOR, _NO_CLEARANCE):
        report.ask("beyond clearance", length)
    if sizes.is_carried and acceleration > 0:
        stiffness = sizes.cells * point.excitation**2 / acceleration
        report.ask("stiff cells", stiffness)
        if not acceleration < _FREE_HOUSING * point.excitation**2 * motion:
            report.ask("soft cells", point.static_load / max(stiffness, 1e-30))


def check_weight(measured: Sequence[Sizes], largest: float) -> None:
    """A stator is made for its loads, whose thousandth its pads weigh alone; on cells its inertia is no large part."""
    mass = max((sizes.report.run.housing_mass for sizes in measured), default=0.0)
    decides = any(sizes.is_carried and mass * sizes.acceleration > _INERTIA * sizes.cells for sizes in measured)
    ratio = mass * _GRAVITY / largest if largest > 0 else 0.0
    for sizes in measured:
        sizes.report.ask("weight", ratio, grave="error" if decides else "warning", mass=mass, load=largest)
        if ratio:
            sizes.report.ask("light", 1 / ratio, grave="warning" if sizes.is_carried else "error", mass=mass)


def _check_rate(report: Reporter, run: Run) -> None:
    """The rate of the file against the manifest's: the run's, or of a dynamic run with times the campaign's."""
    stated = run.reader.stated_rate
    try:
        if stated and ("sample_rate" in run.stated or (run.kind == "dynamic" and not run.devices[0].counted)):
            report.ask("rate", abs(math.log(run.sample_rate / stated)), rate=run.sample_rate, stated=stated)
    except RigDataError:  # said by whoever read the run
        return
