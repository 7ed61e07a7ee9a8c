"""Sizes that no rig can show: a sensor description, a mass or a rate that is off by ten to a thousand.

Every bound is one of physics, not of this campaign: what probes resolve, what a film lets a shaft move, what cells give
way under the load that they carry, what a loader can hold against a stator's weight. The runs are judged one by one,
from their sizes at the excitation line alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.problem import RigDataError, Severity
from rigdata.run import Run
from tpjb_ident.check.observation import Observation
from tpjb_ident.check.set_points import oil_force, plane_vector
from tpjb_ident.phasors.run_data import QUANTITIES
from tpjb_ident.phasors.slow_samples import is_spare

#: A running shaft's vibration, run-out and noise together, from low to high, that no probe shows [m]: error, warning.
_STILL_PROBE = (2e-8, 1e-7)
#: Motion at the excitation line that is none [m]; and the most that is too little where the load over the dynamic
#: stiffness is too short for any film [m].
_NO_MOTION, _LITTLE_MOTION, _SHORTEST_FILM = 1e-8, 3e-8, 1e-6
#: Load over dynamic stiffness is below the clearance, which is 1.5 thousandths of a diameter at most; the diameter from
#: the load and the least specific load of a test [Pa], with a floor for tests of a few newtons [m]. Beyond any bearing.
_CLEARANCE_RATIO, _LEAST_PRESSURE, _CLEARANCE_FLOOR, _NO_CLEARANCE = 1.5e-3, 5e4, 1.5e-4, 1e-3
#: Cells give way by less than this under the static load [m], and no housing stands on springs as stiff as this [N/m].
_SAG, _STIFFEST = 5e-4, 1e11
#: Housings that hang free move against the shaft as much as they accelerate; others may a few times more.
_FREE_HOUSING = 3.0
#: A stator's weight over the largest load of a campaign, gravity [m/s^2], and the share of the cells' force from which
#: the inertia of such a stator decides on K and C.
_WEIGHT, _GRAVITY, _INERTIA = 3.0, 9.81, 0.1
#: Rate of a file over the manifest's, as a share; clocks differ by less. An error from a decade on.
_RATE, _RATE_ERROR = 0.01, 10.0
#: Sizes below this many times their noise say nothing.
_CLEAR = 8.0
_CALIBRATION = "Check sensitivity, unit and full_scale of the channels in the manifest"
#: Key, severity, place, what, cure; as `Reporter.say` takes them.
Finding = tuple[str, Severity, str, str, str]


@dataclass(frozen=True)
class Sizes:
    """Sizes of one run at its excitation line, SI; NaN where they are not measured."""

    run: Run
    motion: float  #: m, of the shaft against the housing
    cells: float  #: N
    film: float  #: N, cells and the housing's inertia
    acceleration: float  #: m/s^2
    static: float  #: N, mean of the cells
    travel: dict[str, float]  #: by probe, m: from low to high over the run, whatever moves it
    noise_free: bool = False
    spare: tuple[str, ...] = ()  #: still probes that the run does not need

    @property
    def film_length(self) -> float:
        """Static load over dynamic stiffness [m]."""
        return self.run.point.static_load * self.motion / self.film if self.film > 0 else math.nan

    @property
    def carried(self) -> bool:
        """Whether the cells carry the static load."""
        return self.static > 0.5 * self.run.point.static_load > 0

    @property
    def cell_stiffness(self) -> float:
        """Stiffness of the springs that the housing stands on [N/m]."""
        return self.cells * self.run.point.excitation**2 / self.acceleration if self.acceleration > 0 else math.nan


def sizes(observation: Observation, mass: float) -> Sizes:
    """Sizes of a run from what one pass over it found."""
    lines = observation.lines
    motion = cells = accelerated = static = math.nan
    if lines is not None:
        clear = np.abs(lines.phasor) > _CLEAR * lines.floor
        motion, cells, accelerated = (
            _length(plane_vector(observation, q, lines.phasor)) if clear[observation.pick(q)].any() else math.nan
            for q in QUANTITIES
        )
        static = _length(plane_vector(observation, "force", lines.mean))
    film = _length(oil_force(observation, mass))
    travel = {}
    for place in observation.pick("displacement"):
        travel[observation.channels[place].name] = float(observation.spread[2, place] - observation.spread[0, place])
    alive = [c for c in observation.channels if travel.get(c.name, 0.0) >= _STILL_PROBE[1]]
    spare = tuple(c.name for c in observation.channels if c.name in travel and is_spare(c, alive))
    noise_free = any(finding.key == "no noise" for finding in observation.report.found)
    return Sizes(observation.run, motion, cells, film, accelerated, static, travel, noise_free, spare)


def _length(vector: NDArray[Any] | None) -> float:
    return math.nan if vector is None else float(np.linalg.norm(vector))


def check_magnitudes(observations: Sequence[Observation], mass: float) -> None:
    """Hold every run against what a rig can show; findings go to the runs' reports."""
    largest = max((observation.run.point.static_load for observation in observations), default=0.0)
    sines = [o for o in observations if o.run.kind == "dynamic" and o.run.excitation_kind == "sine"]
    measured = {id(observation): sizes(observation, mass) for observation in sines}
    weight = [*_weight([*measured.values()], mass, largest)]
    for observation in observations:
        findings = [*_rate(observation.run)]
        if (size := measured.get(id(observation))) is not None:
            findings += [*_probes(size), *_film(size), *_housing(size), *weight]
        for finding in findings:
            observation.report.say(*finding)


def _probes(measured: Sizes) -> Iterator[Finding]:
    for name, travel in measured.travel.items():
        if travel < _STILL_PROBE[1] and not measured.noise_free and measured.run.point.shaft_speed > 0:
            grave = travel < _STILL_PROBE[0] and name not in measured.spare
            severity: Severity = "error" if grave else "warning"
            text = f"shows {1e9 * travel:.2g} nm of vibration, run-out and noise together: no probe resolves that"
            yield f"still {name}", severity, f"channel {name}", text, _CALIBRATION


def _film(measured: Sizes) -> Iterator[Finding]:
    motion, length, load = measured.motion, measured.film_length, measured.run.point.static_load
    place = "displacement and force"
    if motion < _NO_MOTION or (motion < _LITTLE_MOTION and length < _SHORTEST_FILM):
        severity: Severity = "error" if motion < _NO_MOTION else "warning"
        text = f"the shaft moves by {1e9 * motion:.2g} nm at the excitation, a film would let it move further"
        yield "no motion", severity, place, text, _CALIBRATION
    bearing = max(_CLEARANCE_FLOOR, _CLEARANCE_RATIO * math.sqrt(load / _LEAST_PRESSURE))
    if length > min(bearing, _NO_CLEARANCE):
        severity = "error" if length > _NO_CLEARANCE else "warning"
        text = f"load over dynamic stiffness is {1e6 * length:.3g} um: beyond the clearance of a bearing for that load"
        yield "beyond clearance", severity, place, text, _CALIBRATION


def _housing(measured: Sizes) -> Iterator[Finding]:
    """Cells are the springs that the housing stands on: neither so soft nor so stiff."""
    stiffness, load, place = measured.cell_stiffness, measured.run.point.static_load, "acceleration and force"
    free = measured.acceleration < _FREE_HOUSING * measured.run.point.excitation**2 * measured.motion
    carried = measured.carried
    if carried and not free and load > _SAG * stiffness:
        text = f"cells that give way by {1e3 * load / stiffness:.2g} mm under the static load carry no bearing"
        yield "soft cells", "error", place, f"{text}: the accelerations are too large for the forces", _CALIBRATION
    if carried and stiffness > _STIFFEST:
        text = "the housing hardly accelerates for the forces on its cells"
        yield "stiff cells", "warning", place, text, _CALIBRATION


def _weight(measured: Sequence[Sizes], mass: float, largest: float) -> Iterator[Finding]:
    """A stator that stands on its cells is made for the loads, and its inertia is no large part of their force."""
    if mass * _GRAVITY > _WEIGHT * largest > 0:
        decides = any(run.carried and mass * run.acceleration > _INERTIA * run.cells for run in measured)
        severity: Severity = "error" if decides else "warning"
        text = f"a stator of {mass:g} kg weighs {mass * _GRAVITY:.4g} N, the largest static load is {largest:g} N"
        yield "weight", severity, "[housing] mass", text, "Check the mass and its unit"


def _rate(run: Run) -> Iterator[Finding]:
    """The rate that the file shows against the one that the manifest states, where that is meant for this run."""
    stated = getattr(run.reader, "stated_rate", None)
    if stated is None or not (run.kind == "dynamic" or "sample_rate" in run.stated):
        return
    try:
        ratio = run.sample_rate / stated
    except RigDataError:  # said by whoever read the run
        return
    if abs(ratio - 1.0) > _RATE:
        severity: Severity = "error" if not 1.0 / _RATE_ERROR < ratio < _RATE_ERROR else "warning"
        text = f"the file shows {run.sample_rate:g} Hz, the manifest states {stated:g} Hz"
        yield "rate", severity, "sample rate", text, "Check the unit of the time column, and sample_rate"
