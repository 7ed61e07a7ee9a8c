"""Dynamic runs that cannot be used: left out and named, while the others of their operating point count.

A file that is missing or damaged, a channel that is dead: the run says nothing, and nothing else suffers from that. A
point keeps its answer as long as other runs excite it; one that loses all of its runs is told as lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigdata.operating_point import OperatingPoint
from tpjb_ident.conditions import Condition

#: Condition of a run whose accelerometer is dead.
DEAD_ACCELEROMETER = "accelerometer-dead"
#: Runs named one by one; more are counted.
_LISTED = 6


@dataclass(frozen=True)
class ExcludedRun:
    """A dynamic run that takes no part."""

    run: str
    point: OperatingPoint
    error: Exception

    @property
    def reason(self) -> str:
        """The first reason, in one line."""
        return str(self.error).partition("\n")[0]

    def belongs(self, point: OperatingPoint, any_excitation: bool) -> bool:
        """Whether the run is one of an operating point, whatever the run's lines are or only at its set point."""
        alike = self.point.static_key == point.static_key
        return alike and (any_excitation or self.point.excitation_hz == point.excitation_hz)


def named_runs(excluded: Sequence[ExcludedRun], of: int) -> tuple[Condition, ...]:
    """What the campaign has to say: which of its `of` dynamic runs take no part, and why."""
    if not excluded:
        return ()
    listed = "; ".join(f"{run.run} ({run.reason})" for run in excluded[:_LISTED])
    more = f"; and {len(excluded) - _LISTED} more" if len(excluded) > _LISTED else ""
    return (Condition("runs-left-out", f"{len(excluded)} of {of} dynamic runs take no part: {listed}{more}"),)


def without_runs(point: OperatingPoint, excluded: Sequence[ExcludedRun], any_excitation: bool) -> tuple[Condition, ...]:
    """What a point has to say of its runs that take no part."""
    runs = [run.run for run in excluded if run.belongs(point, any_excitation)]
    return (Condition("run-left-out", f"without {', '.join(runs)}, which cannot be used"),) if runs else ()


def lost_points(
    points: Sequence[OperatingPoint], excluded: Sequence[ExcludedRun], any_excitation: bool, kind: str = "run"
) -> tuple[Condition, ...]:
    """Name the operating points that have no run left; a `kind` of run other than usual is one over a band."""
    lost = [run for run in excluded if not any(run.belongs(point, any_excitation) for point in points)]
    if not lost:
        return ()
    places = [f"{run.point.static_load / 1e3:g} kN" for run in lost]
    if kind == "run":
        places = [f"{place}, {run.point.excitation_hz:g} Hz" for place, run in zip(places, lost)]
    runs = ", ".join(run.run for run in lost[:_LISTED]) + (", ..." if len(lost) > _LISTED else "")
    return (Condition("point-lost", f"no usable {kind} at {'; '.join(dict.fromkeys(places))}: {runs}"),)
