"""The test plan: which runs a campaign consists of, at which set points, how long."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, radians
from typing import Literal, Self

from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig.truth import PAPER_RIG, VirtualRigError, hz

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

    def turning(self, rotation: str) -> Self:
        """The same tests with the shaft turning ``"counter-clockwise"`` or ``"clockwise"``."""
        dynamic, locus = (tuple(replace(p, rotation=rotation) for p in points) for points in (self.dynamic, self.locus))
        return replace(self, dynamic=dynamic, locus=locus)

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
