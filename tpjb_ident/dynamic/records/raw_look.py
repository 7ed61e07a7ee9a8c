"""A look at the readings of a run as they were recorded, channel by channel, before they become X and Y.

What a single channel's device did is lost once two channels are turned into a vector: that it was driven into its
limits, or sampled slower than the others.
"""

from __future__ import annotations

import numpy as np

from rigdata.calibration import VECTOR_QUANTITIES
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.measured_run import MeasuredRun
from tpjb_ident.dynamic.records.slower_channels import SlowerChannel, slower_channel

#: Samples from the start that are looked at.
LOOK = 2**14
#: A channel with more of its samples at a limit than this is of no use.
CLIPPED = 0.05


def look_at_readings(run: MeasuredRun) -> tuple[dict[str, SlowerChannel], tuple[Condition, ...]]:
    """Channels that were sampled slower than the export, by name, and what to say of them.

    Parameters
    ----------
    run : rigdata.run.Run
        What only looks like one is not judged.

    Raises
    ------
    RigDataError
        A channel is clipped: its phasors are those of another signal.
    """
    if not isinstance(run, Run):
        return {}, ()
    names = [c.name for c in run.channels.values() if c.quantity in VECTOR_QUANTITIES and c.axis is not None]
    readings = run.reader.read(names, 0, min(run.length, LOOK))
    slower: dict[str, SlowerChannel] = {}
    clipped: list[Problem] = []
    rate = run.sample_rate
    for name, values in zip(names, readings):
        if run.channels[name].quantity != "acceleration":
            clipped += _clipped(run, name, values)
        found = slower_channel(values, rate)
        if found is not None:
            slower[name] = found
    if clipped:
        raise RigDataError(clipped)
    if not slower:
        return {}, ()
    told = ", ".join(f"{n} {'held' if s.held else 'interpolated'} from {s.rate:.4g} Hz" for n, s in slower.items())
    return slower, (Condition("slower-channels", f"{told}; what that does to a sine was taken out"),)


def _clipped(run: Run, name: str, values: np.ndarray) -> list[Problem]:
    statistics = ChannelStatistics()
    statistics.add(values)
    share = 0.0 if statistics.constant else statistics.clipped_share()
    if share <= CLIPPED:
        return []
    unit = run.channels[name].unit
    what = f"{share:.1%} of the samples sit at a limit (from {statistics.low:g} to {statistics.high:g} {unit}): clipped"
    cure = "Widen the channel's range and repeat the run; what was cut off cannot be had back"
    return [Problem("error", run.file, f"channel {name}", what, cure, run.id)]
