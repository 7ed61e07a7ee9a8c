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
LISTED = 6


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


def named_runs(left: Sequence[ExcludedRun], of: int) -> tuple[Condition, ...]:
    """What the campaign has to say: which of its `of` dynamic runs take no part, and why."""
    if not left:
        return ()
    listed = "; ".join(f"{excluded.run} ({excluded.reason})" for excluded in left[:LISTED])
    more = f"; and {len(left) - LISTED} more" if len(left) > LISTED else ""
    return (Condition("runs-left-out", f"{len(left)} of {of} dynamic runs take no part: {listed}{more}"),)


def without_runs(runs: Sequence[str]) -> tuple[Condition, ...]:
    """What a point has to say of its runs that take no part."""
    return (Condition("run-left-out", f"without {', '.join(runs)}, which cannot be used"),) if runs else ()


def points_without_runs(lost: Sequence[ExcludedRun], places: Sequence[str], kind: str = "run") -> tuple[Condition, ...]:
    """Name the operating points that have no run left: the `places` of the `lost` runs."""
    if not lost:
        return ()
    runs = ", ".join(excluded.run for excluded in lost[:LISTED]) + (", ..." if len(lost) > LISTED else "")
    return (Condition("point-lost", f"no usable {kind} at {'; '.join(dict.fromkeys(places))}: {runs}"),)
