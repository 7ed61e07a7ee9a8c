"""Channels that stand still: stuck, clipped or dead for part of a static test.

A force or displacement that stops in the middle of a staircase looks like a very stiff or very soft pivot: nothing
in the curve itself gives it away, but readings without noise do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigdata.checking.channel_statistics import ChannelStatistics
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
    for name, channel in run.channels.items():
        if channel.quantity not in ("force", "displacement"):
            continue
        record = run.record(name)
        seen = ChannelStatistics()
        seen.add(np.asarray(record.values))
        others = max(seen.values - seen.longest_flat, 1)
        repeated = (seen.repeats - seen.longest_flat + 1) / others
        if repeated > NOISE_FREE or seen.longest_flat < max(SHORTEST, TIMES_EXPECTED * seen.expected_flat()):
            continue
        start, share = float(record.time[seen.flat_start]), seen.longest_flat / max(seen.samples, 1)
        how_long = f"from {start:.2f} s on for {100 * share:.0f} % of the run"
        what = f"run {run.id}: stands still {how_long}: stuck, clipped or dead"
        cure = "Check sensor, range and logger, and repeat the run"
        problems.append(Problem("error", run.file, f"channel {name}", what, cure, run=run.id))
    if problems:
        raise RigDataError(problems)
