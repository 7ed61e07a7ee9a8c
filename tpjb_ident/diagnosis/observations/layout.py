"""What was measured where: the questions that a model must answer to stand beside a campaign."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DynamicTest:
    """Dynamic tests at one static operating point."""

    load: float
    direction: float
    speed: float
    excitation: tuple[float, ...]
    pads: tuple[int, ...] = ()


@dataclass(frozen=True)
class LocusTest:
    """One load direction of the locus: load [N], direction [rad], speed [rad/s]."""

    load: float
    direction: float
    speed: float


@dataclass(frozen=True)
class DryTest:
    """A dry test on one pad: read loads [N] at which the compliance is compared."""

    pad: int
    load: tuple[float, ...]


@dataclass(frozen=True)
class Layout:
    """All tests of a campaign, in the order of the observation vector."""

    dynamic: tuple[DynamicTest, ...]
    locus: tuple[LocusTest, ...] = ()
    dry: tuple[DryTest, ...] = ()
    push_load: float | None = None
    temperature_position: tuple[float, ...] = ()
