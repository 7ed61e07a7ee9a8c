"""Other plans than the paper's: what users' campaigns lack or have besides, and bearings of other make."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from model.bearing import Bearing
from rigdata.virtual_rig import RigPlan
from rigdata.virtual_rig.plan import DryTest, operating_points


def _paper(bearing: Bearing) -> RigPlan:
    return replace(RigPlan.like_paper(), dry=tuple(DryTest(k + 1) for k in range(len(bearing.pads))))


@dataclass(frozen=True)
class Test:
    """A bearing and what is done with it; without a plan, what the paper does."""

    bearing: Bearing
    given: RigPlan | None = field(default=None)

    @property
    def plan(self) -> RigPlan:
        """The test series."""
        return self.given or _paper(self.bearing)


def _without(*names: str) -> Callable[[Bearing], Test]:
    return lambda bearing: Test(bearing, replace(_paper(bearing), **dict.fromkeys(names, ())))  # type: ignore[arg-type]


def _loads(bearing: Bearing, pairs: list[tuple[float, float]], fast: bool = False) -> Test:
    points = operating_points(pairs)
    if fast:
        points += operating_points(pairs, speed=2 * math.pi * 40.0)
    return Test(bearing, replace(_paper(bearing), dynamic=points))


def _few_directions(bearing: Bearing) -> Test:
    return Test(bearing, replace(_paper(bearing), directions=(0.0, math.pi / 2)))


def _four_pads(bearing: Bearing) -> Test:
    """Four pads, the load between two of them."""
    pads = tuple(
        replace(bearing.pads[0], pivot_angle=math.radians(a), arc=math.radians(70.0))
        for a in (-45.0, 45.0, 135.0, 225.0)
    )
    return Test(bearing.with_pads(pads))


def _between(bearing: Bearing) -> Test:
    """The same bearing turned by half a pad."""
    turn = math.pi / len(bearing.pads)
    return Test(bearing.with_pads(tuple(replace(p, pivot_angle=p.pivot_angle + turn) for p in bearing.pads)))


def _offset(bearing: Bearing) -> Test:
    return Test(bearing.with_pads(tuple(replace(p, pivot_offset=0.6) for p in bearing.pads)))


def _preload(bearing: Bearing) -> Test:
    """Assembled clearance 15 % less: more preload."""
    pads = tuple(replace(p, assembled_clearance=0.85 * p.assembled_clearance) for p in bearing.pads)
    return Test(bearing.with_pads(pads))


#: By name: the test of a drawn bearing.
PLANS: Mapping[str, Callable[[Bearing], Test]] = {
    "no dry tests": _without("dry"),
    "no polygon": _without("clearance"),
    "no locus": _without("locus"),
    "dynamic only": _without("dry", "clearance", "locus"),
    "one load": lambda b: _loads(b, [(5000.0, f) for f in (10.0, 20.0, 25.0, 30.0, 40.0, 50.0)]),
    "two speeds": lambda b: _loads(b, [(w, 25.0) for w in (2500.0, 5000.0, 8750.0)], fast=True),
    "two directions": _few_directions,
    "four pads": _four_pads,
    "load between pads": _between,
    "offset 0.6": _offset,
    "more preload": _preload,
}
