"""Dynamic runs that cannot be used: left out and named, while the others of their operating point count.

A file that is missing or damaged, a channel that is dead: the run says nothing, and nothing else suffers from that. A
point keeps its answer as long as other runs excite it; one that loses all of its runs is told as lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.conditions import Condition, merged
from tpjb_ident.dynamic.point_result import PointResult

#: Condition of a run whose accelerometer is dead.
DEAD_ACCELEROMETER = "accelerometer-dead"
#: Runs named one by one; more are counted.
_LISTED = 6


@dataclass(frozen=True)
class LeftOut:
    """A dynamic run that takes no part.

    Attributes
    ----------
    run : str
    point : OperatingPoint
        Its set points.
    error : Exception
        Why, as `RigDataError` or `RecordTooShortError`.
    """

    run: str
    point: OperatingPoint
    error: Exception

    @property
    def reason(self) -> str:
        """The first reason, in one line."""
        return str(self.error).partition("\n")[0]


def named_runs(left: Sequence[LeftOut], of: int) -> tuple[Condition, ...]:
    """What the campaign has to say: which of its `of` dynamic runs take no part, and why."""
    if not left:
        return ()
    told = "; ".join(f"{one.run} ({one.reason})" for one in left[:_LISTED])
    more = f"; and {len(left) - _LISTED} more" if len(left) > _LISTED else ""
    return (Condition("runs-left-out", f"{len(left)} of {of} dynamic runs take no part: {told}{more}"),)


def named_at_points(
    points: Sequence[PointResult], left: Sequence[LeftOut], any_excitation: bool
) -> tuple[PointResult, ...]:
    """The points, each saying which of its runs were left out.

    Parameters
    ----------
    points : sequence of PointResult
    left : sequence of LeftOut
    any_excitation : bool
        Whether a record holds several excitation lines, so that it belongs to all points of its load.
    """
    return tuple(_named(point, [one.run for one in left if _same(one, point, any_excitation)]) for point in points)


def lost_points(points: Sequence[PointResult], left: Sequence[LeftOut], any_excitation: bool) -> tuple[Condition, ...]:
    """Name the operating points that have no run left."""
    lost = [one for one in left if not any(_same(one, point, any_excitation) for point in points)]
    places = dict.fromkeys(f"{one.point.static_load / 1e3:g} kN, {one.point.excitation_hz:g} Hz" for one in lost)
    if not places:
        return ()
    runs = ", ".join(one.run for one in lost[:_LISTED]) + (", ..." if len(lost) > _LISTED else "")
    return (Condition("point-lost", f"no usable run at {'; '.join(places)}: {runs}"),)


def _named(point: PointResult, runs: list[str]) -> PointResult:
    if not runs:
        return point
    told = Condition("run-left-out", f"without {', '.join(runs)}, which cannot be used")
    return replace(point, quality=merged(point.quality, (told,)))


def _same(one: LeftOut, result: PointResult, any_excitation: bool) -> bool:
    mine, other = one.point, result.point
    alike = (mine.static_load, mine.static_load_direction_deg, mine.shaft_speed_hz) == (
        other.static_load,
        other.static_load_direction_deg,
        other.shaft_speed_hz,
    )
    return alike and (any_excitation or mine.excitation_hz == other.excitation_hz)
