"""What the rig really does, the physics that goes into a virtual campaign; and which runs it consists of, how long.

The generator never asks a bearing model (`rigdata` may not import one): whoever calls it hands in the dynamic
stiffness, the mean position, the temperatures and the pivot law, from a model or from thin air.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, radians
from typing import Any, Literal, Self

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigError, tables_beside
from rigdata.vector import directions

PointLaw = Callable[[OperatingPoint], Any]

_FIVE_PADS = tuple(np.radians([-90.0, -18.0, 54.0, 126.0, 198.0]).tolist())


class VirtualRigError(RigError):
    """The virtual rig was asked for something it cannot do; says what and what to do."""


def _with_tuples(entry: Any) -> Any:
    """Lists become tuples, as fields of frozen classes are."""
    if isinstance(entry, dict):
        return {key: _with_tuples(value) for key, value in entry.items()}
    return tuple(entry) if isinstance(entry, list) else entry


#: Tables of `paper_rig.toml`.
PAPER_RIG: dict[str, dict[str, Any]] = _with_tuples(tables_beside(__file__, "paper_rig.toml"))


@dataclass(frozen=True, repr=False)
class RigTruth:
    """The physics of one virtual test bearing."""

    stiffness: PointLaw
    position: PointLaw
    temperature: PointLaw
    pivot_deflection: Callable[[int, FloatArray], Any]
    pivot_angles: tuple[float, ...] = _FIVE_PADS
    clearance: tuple[float, ...] = (80e-6,) * 5
    bearing_name: str = "bearing.toml"
    bearing_text: str = ""
    cold_temperature: float = 24.0

    @classmethod
    def constant(cls, k: Any, c: Any, pivot_stiffness: float | Sequence[float] = 6e8, **fields: Any) -> Self:
        """Make a truth with one K and C at all points: a linear bearing."""
        stiffness = np.array(k, dtype=float)
        damping = np.array(c, dtype=float)
        angles = fields.get("pivot_angles", _FIVE_PADS)
        pivots = np.broadcast_to(np.asarray(pivot_stiffness, dtype=float), (len(angles),))
        linear: dict[str, Any] = {
            "stiffness": lambda point: stiffness + 1j * point.excitation * damping,
            "position": lambda point: np.linalg.solve(stiffness, load_vector(point)),
            "temperature": lambda point: np.full(len(angles), 45.0 + point.static_load / 2e3),
            "pivot_deflection": lambda pad, load: load / pivots[pad - 1],
            "clearance": (80e-6,) * len(angles),
            "bearing_text": 'schema = "tpjb-bearing/1"\nname = "linear test bearing"\n',
        }
        return cls(**linear | fields)

    @property
    def cold_temperatures(self) -> FloatArray:
        """Of all pads at rest, (n_pads,) [degC]."""
        return np.full(len(self.pivot_angles), self.cold_temperature)

    def deflection(self, pad: int, load: FloatArray) -> FloatArray:
        """Pivot deflection of `pad` (1 is pad #1) under `load` (n,) [N] -> (n,) [m]; 0 where it lifts off."""
        return np.asarray(self.pivot_deflection(pad, np.maximum(load, 0.0)))


def load_vector(point: OperatingPoint) -> FloatArray:
    """Static load of a point as (2,) [N]: what pushes the shaft, and what the film puts on the housing."""
    return point.static_load * directions(point.static_load_direction)


def hz(frequency: float) -> float:
    """Frequency in Hz as rad/s."""
    return 2 * pi * frequency


def point_facts(point: OperatingPoint, position: FloatArray) -> dict[str, object]:
    """A point and the shaft's mean position there, as the truth files write them."""
    x, y = position.tolist()
    return {
        "static_load_N": point.static_load,
        "static_load_direction_deg": point.static_load_direction_deg,
        "shaft_speed_Hz": point.shaft_speed_hz,
        "x_m": x,
        "y_m": y,
    }


Branch = Literal["up", "down", "cycle"]
_DOWNWARD = -pi / 2
#: Of a run without load and rotation of its own.
_NO_POINT = OperatingPoint(0.0)


@dataclass(frozen=True)
class DryTest:
    """Load steps toward one pad, no oil, no rotation."""

    pad: int
    levels: tuple[float, ...] = tuple(500.0 * (i + 1) for i in range(10))
    hold: float | tuple[float, ...] = 1.0
    ramp: float = 0.3
    start: float = 250.0
    branch: Branch = "up"
    overshoot: float = 0.0
    load_drift: float = 0.0

    @property
    def holds(self) -> tuple[float, ...]:
        """Hold time of each level [s]."""
        return self.hold if isinstance(self.hold, tuple) else (self.hold,) * len(self.levels)


@dataclass(frozen=True)
class ClearanceSweep:
    """A small load swept once around, no oil, no rotation."""

    push: float = 200.0
    seconds: float = 20.0


@dataclass(frozen=True)
class PlannedRun:
    """One run of the plan."""

    id: str
    kind: Literal["dynamic", "locus", "dry_pivot", "clearance"]
    rate: float
    point: OperatingPoint = _NO_POINT
    direction: float = 0.0
    lines: tuple[tuple[float, float], ...] = ()
    record: str = ""
    test: DryTest | ClearanceSweep | None = None
    seconds: float = 0.0


@dataclass(frozen=True)
class RigPlan:
    """A whole test series."""

    dynamic: tuple[OperatingPoint, ...] = ()
    directions: tuple[float, ...] = tuple(radians(30.0 * i) for i in range(6))
    dynamic_fraction: float = 0.1
    repeats: int = 1
    joint_frequencies: bool = False
    locus: tuple[OperatingPoint, ...] = ()
    dry: tuple[DryTest, ...] = ()
    clearance: tuple[ClearanceSweep, ...] = ()
    dynamic_rate: float = 1000.0  #: sample rates [Hz] and record lengths [s]
    dynamic_seconds: float = 2.0
    locus_seconds: float = 1.0
    dry_rate: float = 500.0

    @classmethod
    def like_paper(cls, pads: int = 5) -> Self:
        """Six loads at 25 Hz, six frequencies at 5 kN, 20 locus directions, a dry test a pad, one sweep."""
        return cls(
            dynamic=operating_points(PAPER_RIG["plan"]["points"]),
            locus=locus_points(20),
            dry=tuple(DryTest(pad) for pad in range(1, pads + 1)),
            clearance=(ClearanceSweep(),),
        )

    @classmethod
    def short(cls, pads: int = 5) -> Self:
        """Three loads at 25 Hz, ten locus directions, a dry test a pad, one sweep: a campaign for a demo."""
        return replace(
            cls.like_paper(pads), dynamic=operating_points(PAPER_RIG["plan"]["short"]), locus=locus_points(10)
        )

    def turning(self, **shaft: Any) -> Self:
        """The same tests with another ``rotation`` of the shaft, or another ``shaft_speed`` [rad/s]."""
        dynamic = tuple(replace(point, **shaft) for point in self.dynamic)
        return replace(self, dynamic=dynamic, locus=tuple(replace(point, **shaft) for point in self.locus))

    def runs(self, pivot_angles: Sequence[float]) -> tuple[PlannedRun, ...]:
        """All runs in order; `pivot_angles` [rad] give the dry tests their directions."""
        runs = (*self._dynamic_runs(), *self._other_runs(pivot_angles))
        for name, count in Counter(run.id for run in runs).items():
            if count > 1:
                raise VirtualRigError(f"the plan has two runs with the id {name!r}; every test only once")
        return runs

    def _dynamic_runs(self) -> Iterator[PlannedRun]:
        for point in self.dynamic:
            if not 0 < point.excitation < pi * self.dynamic_rate:
                raise VirtualRigError(
                    f"an excitation of {point.excitation_hz:g} Hz cannot be sampled at {self.dynamic_rate:g} Hz; "
                    "choose one between zero and half the sample rate"
                )
            together = [p for p in self.dynamic if p.static_key == point.static_key]
            if not self.joint_frequencies:
                together = [point]
            amplitude = self.dynamic_fraction * point.static_load / len(together) ** 0.5
            lines = tuple((p.excitation, amplitude) for p in together)
            for number, direction in enumerate(self.directions, 1):
                for repeat in range(1, self.repeats + 1):
                    tail = f"-{number:02d}" + (f"-r{repeat}" if self.repeats > 1 else "")
                    name, record = (f"d-{self._name(p)}-{p.excitation_hz:g}{tail}" for p in (point, together[0]))
                    seconds = self.dynamic_seconds
                    yield PlannedRun(
                        name, "dynamic", self.dynamic_rate, point, direction, lines, record, seconds=seconds
                    )

    def _other_runs(self, pivot_angles: Sequence[float]) -> Iterator[PlannedRun]:
        for number, point in enumerate(self.locus, 1):
            name = f"l-{_load_name(point)}-{number:02d}"
            yield PlannedRun(name, "locus", self.dynamic_rate, point, record=name, seconds=self.locus_seconds)
        for test in self.dry:
            name, angle = f"p-{test.pad}-{test.branch}", pivot_angles[test.pad - 1]
            yield PlannedRun(name, "dry_pivot", self.dry_rate, direction=angle, record=name, test=test)
        for number, sweep in enumerate(self.clearance, 1):
            yield PlannedRun(f"c-{number}", "clearance", self.dry_rate, record=f"c-{number}", test=sweep)

    def _name(self, point: OperatingPoint) -> str:
        """Load, and whatever else distinguishes the points of this plan."""
        name = _load_name(point)
        if len({p.static_load_direction for p in self.dynamic}) > 1:
            name += f"-w{point.static_load_direction_deg:g}"
        if len({p.spin for p in self.dynamic}) > 1:
            name += f"-n{point.shaft_speed_hz:g}" + ("-cw" if point.spin < 0.0 else "")
        return name


def operating_points(
    pairs: Iterable[tuple[float, float]], direction: float = _DOWNWARD, speed: float = hz(22.0)
) -> tuple[OperatingPoint, ...]:
    """Make set points of (load [N], excitation [Hz]) at one load direction [rad] and speed [rad/s]."""
    return tuple(OperatingPoint(load, direction, speed, hz(frequency)) for load, frequency in pairs)


def locus_points(count: int, load: float = 5000.0) -> tuple[OperatingPoint, ...]:
    """Give `count` directions of one load [N], evenly all around, counter-clockwise from straight down, at 22 Hz."""
    return tuple(OperatingPoint(load, _DOWNWARD + 2 * pi * i / count, hz(22.0)) for i in range(count))


def _load_name(point: OperatingPoint) -> str:
    return f"{point.static_load:07.1f}" if point.static_load % 1 else f"{point.static_load:05.0f}"
