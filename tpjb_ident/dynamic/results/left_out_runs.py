"""Operating points say which of their runs were left out; a point that lost all of its runs is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.left_out import LISTED, LeftOut


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
    """Name the operating points that have no run left.

    Parameters
    ----------
    points : sequence of PointResult
    left : sequence of LeftOut
    any_excitation : bool
        Whether a record holds several excitation lines.
    """
    lost = [one for one in left if not any(_same(one, point, any_excitation) for point in points)]
    places = dict.fromkeys(f"{one.point.static_load / 1e3:g} kN, {one.point.excitation_hz:g} Hz" for one in lost)
    if not places:
        return ()
    runs = ", ".join(one.run for one in lost[:LISTED]) + (", ..." if len(lost) > LISTED else "")
    return (Condition("point-lost", f"no usable run at {'; '.join(places)}: {runs}"),)


def _named(point: PointResult, runs: list[str]) -> PointResult:
    if not runs:
        return point
    condition = Condition("run-left-out", f"without {', '.join(runs)}, which cannot be used")
    return replace(point, quality=merged(point.quality, (condition,)))


def _same(one: LeftOut, result: PointResult, any_excitation: bool) -> bool:
    mine, other = one.point, result.point
    alike = (mine.static_load, mine.static_load_direction_deg, mine.shaft_speed_hz) == (
        other.static_load,
        other.static_load_direction_deg,
        other.shaft_speed_hz,
    )
    return alike and (any_excitation or mine.excitation_hz == other.excitation_hz)
