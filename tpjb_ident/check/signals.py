"""Problems that a run's time and one channel's readings show by themselves: gaps, jitter; dead, stuck, clipped."""

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Severity
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter
from tpjb_ident.phasors.slow_samples import converter_step, is_spare, stands_still

#: Quantities without which no run says anything.
ALWAYS_NEEDED = ("displacement", "force")
_CELSIUS = 273.15
#: Film and housing temperatures of a rig that is not on fire [degC].
_COLDEST, _HOTTEST = -50.0, 300.0
_MIN_CYCLES = 5.0
#: Steps of the converter within which a channel's readings show no limit.
_FEW_STEPS = 8
#: Readings of a hold, and how many times longer it stands than what is beside it.
_LEAST_HELD, _HELD_OVER_BESIDE = 20, 4


def needed(run: Run, channel: Channel) -> bool:
    """Whether `run` says nothing without `channel`."""
    return channel.quantity in ALWAYS_NEEDED or (channel.quantity == "acceleration" and run.kind == "dynamic")


def check_signal(
    report: Reporter, channel: Channel, statistics: ChannelStatistics, noise_free: bool, alive: Sequence[Channel]
) -> None:
    """Judge one channel of one run; `alive` are those of the run that show something."""
    name, is_dynamic = channel.name, report.run.kind == "dynamic"
    grave: Severity = "error" if needed(report.run, channel) and not is_spare(channel, alive) else "warning"
    words = vars(statistics) | {"unit": channel.unit, "grave": grave}
    if statistics.values == 0:
        report.ask("empty", 1.0, name, **words)
        return
    report.ask("missing", statistics.missing / statistics.samples, name, **words)
    if channel.quantity == "command":  # rests where its actuator does
        return
    if statistics.constant:
        alone = all(c.quantity != channel.quantity or c.name == name for c in alive)
        is_slow = alone and channel.quantity in {"temperature", "pressure"}
        # a channel of what does not move in this kind of run may well read one value throughout
        still = channel.quantity == "speed" or (channel.quantity == "acceleration" and not is_dynamic)
        if not noise_free and not still:
            report.ask("constant" if is_slow else "dead", 1.0, name, **words)
        return
    if not noise_free and stands_still(statistics):
        report.ask("stuck", statistics.longest_flat / statistics.samples, name, **words)
    clipped = statistics.clipped_share()
    # of a keyphasor its edges count alone
    if clipped > 0 and channel.quantity != "keyphasor" and (is_dynamic or not _is_held(statistics)):
        report.ask("clipped", clipped, name, **words)
    if channel.quantity == "temperature":
        cold, hot = np.sort(channel.to_si(np.array([statistics.low, statistics.high]))) - _CELSIUS
        report.ask("temperature", float(cold < _COLDEST or hot > _HOTTEST), name, cold=cold, hot=hot)


def _is_held(statistics: ChannelStatistics) -> bool:
    """Whether readings stand still also where no limit is: a load that is held, or a channel of what does not move.

    A hold stays on one step of the converter, or between two, much longer than just before and after it.
    """
    readings = np.concatenate(statistics.blocks)
    steps = np.round((readings - statistics.low) / converter_step(readings)[0])
    for pairs in (np.floor(steps / 2.0), np.floor((steps + 1.0) / 2.0)):
        starts = np.r_[0, np.flatnonzero(np.diff(pairs)) + 1]
        length, pair = np.diff(np.r_[starts, len(pairs)]), pairs[starts][1:-1]
        neighbours = np.maximum(length[:-2], length[2:])
        still = length[1:-1] > np.maximum(_HELD_OVER_BESIDE * neighbours, max(_LEAST_HELD, 0.002 * len(pairs)))
        if np.any(still & (pair > 1) & (pair < pairs.max() - 1)):
            return True
    return bool(steps.max() < _FEW_STEPS)


def check_clock(report: Reporter, time: FloatArray) -> None:
    """Judge the times at which a run begins; `time` (n,)."""
    rate, samples, excitation = report.run.sample_rate, len(time), report.run.point.excitation_hz
    cycles = getattr(report.run.reader, "whole_length", report.run.length) * excitation / rate
    if samples < 3:
        report.ask("short", samples=samples)
        return
    if report.run.kind == "dynamic" and rate < 2.2 * excitation:
        report.ask("nyquist", rate=rate, excitation=excitation)
    elif report.run.kind == "dynamic" and cycles < _MIN_CYCLES:
        report.ask("short of cycles", float(excitation > 0), cycles=cycles)
    steps = np.diff(time) * rate
    gaps = np.flatnonzero(steps > 1.9)  # a late sample of a jittering clock is no gap: there the next step is short
    if len(gaps):
        longest, lost = int(gaps[np.argmax(steps[gaps])]), np.sum(steps[gaps] - 1)
        words = {"gaps": len(gaps), "longest": steps[longest] / rate, "sample": longest}
        report.ask("gap", lost / len(steps), lost=lost, **words)
    report.ask("jitter", float(np.std(np.append(1.0, steps[steps <= 1.9]))))
