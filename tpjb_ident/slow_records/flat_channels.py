"""Channels that stand still: stuck, clipped or dead for part of a static test.

A force or displacement that stops in the middle of a staircase looks like a very stiff or very soft pivot: nothing
in the curve itself gives it away, but readings without noise do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem, RigDataError

if TYPE_CHECKING:
    from rigdata.campaign import Run

SHORTEST = 50  # samples
TIMES_EXPECTED = 10.0
NOISE_FREE = 0.5  # share of repeated readings, apart from the longest stretch: a computed record, or a coarse converter


def refuse_flat_channels(run: Run) -> None:
    """Refuse a run one of whose force or displacement channels stands still for a while.

    Parameters
    ----------
    run : Run
        Of any kind.

    Raises
    ------
    RigDataError
        Names every such channel, from when on, and for how long.
    """
    problems = []
    for quantity in ("force", "displacement"):
        seen = {name: _statistics(run, name) for name, c in run.channels.items() if c.quantity == quantity}
        if any(_repeated(s) > NOISE_FREE for s in seen.values() if not s.constant):
            # noise below the converter's step: standing still says nothing here
            continue
        problems += [_problem(run, name, s) for name, s in seen.items() if _stands_still(s)]
    if problems:
        raise RigDataError(problems)


def _statistics(run: Run, name: str) -> ChannelStatistics:
    seen = ChannelStatistics()
    seen.add(np.asarray(run.record(name).values))
    return seen


def _repeated(seen: ChannelStatistics) -> float:
    """Share of samples equal to the one before, apart from the longest stretch."""
    return (seen.repeats - seen.longest_flat + 1) / max(seen.values - seen.longest_flat, 1)


def _stands_still(seen: ChannelStatistics) -> bool:
    return seen.longest_flat >= max(SHORTEST, TIMES_EXPECTED * seen.expected_flat())


def _problem(run: Run, name: str, seen: ChannelStatistics) -> Problem:
    start, share = seen.flat_start / run.sample_rate, seen.longest_flat / max(seen.samples, 1)
    how_long = f"from {start:.2f} s on for {100 * share:.0f} % of the run"
    what = f"run {run.id}: stands still {how_long}: stuck, clipped or dead"
    cure = "Check sensor, range and logger, and repeat the run"
    return Problem("error", run.file, f"channel {name}", what, cure, run=run.id)
