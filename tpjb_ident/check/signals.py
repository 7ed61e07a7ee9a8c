"""Problems that a run's time and one channel's readings show by themselves: gaps, jitter; dead, stuck, clipped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Severity
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter
from tpjb_ident.phasors.slow_samples import converter_step, is_spare, stands_still

#: Quantities without which a run of that kind says nothing.
_NEEDED = {
    "dynamic": ("displacement", "force", "acceleration"),
    "dry_pivot": ("displacement", "force"),
    "locus": ("displacement", "force"),
    "clearance": ("displacement", "force"),
    "baseline": ("displacement", "force"),
}
_CELSIUS = 273.15
#: Film and housing temperatures of a rig that is not on fire [K].
_TEMPERATURES = (_CELSIUS - 50.0, _CELSIUS + 300.0)
_MIN_CYCLES = 5.0
#: Steps of the converter within which a channel's readings show no limit.
_FEW_STEPS = 8
#: Readings of a hold, and how many times longer it stands than what is beside it.
_LEAST_HELD, _HELD_OVER_BESIDE = 20, 4


def needed(run: Run, channel: Channel) -> bool:
    """Whether `run` cannot be used without `channel`."""
    return channel.quantity in _NEEDED[run.kind]


def check_signal(
    report: Reporter, channel: Channel, statistics: ChannelStatistics, noise_free: bool, alive: Sequence[Channel]
) -> None:
    """Judge one channel of one run; `alive` are those of the run that show something."""
    spare = is_spare(channel, alive)
    grave: Severity = "error" if needed(report.run, channel) and not spare else "warning"
    alone = all(c.quantity != channel.quantity or c.name == channel.name for c in alive)
    place = f"channel {channel.name}"
    if statistics.values == 0:
        text = "holds no values at all"
        report.say(f"empty {channel.name}", grave, place, text, "Check the channel's wiring and logger settings")
        return
    _missing(report, channel, statistics, grave)
    if statistics.constant and not noise_free:
        _dead(report, channel, statistics, grave, alone)
    if statistics.constant:
        return
    if not noise_free:
        _stuck(report, channel, statistics, grave)
    clipped = statistics.clipped_share()
    if clipped > 0 and not (report.run.kind != "dynamic" and _held(statistics)):
        limits = f"{statistics.low:g} and {statistics.high:g} {channel.unit}"
        text = f"{clipped:.1%} of the samples sit flat at an extreme reading (limits {limits}): clipped"
        severity: Severity = grave if clipped > 0.05 else "warning"
        report.say(f"clipped {channel.name}", severity, place, text, "Widen the logger's range and repeat the run")
    if channel.quantity == "temperature":
        _temperature(report, channel, statistics)


def _held(statistics: ChannelStatistics) -> bool:
    """Whether readings stand still also where no limit is: a load that is held, or a channel of what does not move.

    A hold stays on one step of the converter, or between two, much longer than just before and after it.
    """
    readings = np.concatenate(statistics.blocks)
    steps = np.round((readings - statistics.low) / converter_step(readings)[0])
    for pairs in (np.floor(steps / 2.0), np.floor((steps + 1.0) / 2.0)):
        starts = np.r_[0, np.flatnonzero(np.diff(pairs)) + 1]
        length, pair = np.diff(np.r_[starts, len(pairs)]), pairs[starts][1:-1]
        beside = np.maximum(length[:-2], length[2:])
        still = length[1:-1] > np.maximum(_HELD_OVER_BESIDE * beside, max(_LEAST_HELD, 0.002 * len(pairs)))
        if np.any(still & (pair > 1) & (pair < pairs.max() - 1)):
            return True
    return bool(steps.max() < _FEW_STEPS)


def _missing(report: Reporter, channel: Channel, statistics: ChannelStatistics, grave: Severity) -> None:
    share = statistics.missing / statistics.samples
    if share == 0:
        return
    severity: Severity = grave if share > 0.5 else ("warning" if share > 0.01 else "note")
    text = f"{statistics.missing} of {statistics.samples} samples have no value ({share:.1%})"
    cure = "Repeat the run" if share > 0.5 else "They are left out"
    report.say(f"missing {channel.name}", severity, f"channel {channel.name}", text, cure)


def _dead(report: Reporter, channel: Channel, seen: ChannelStatistics, grave: Severity, alone: bool) -> None:
    """A channel of what does not move in this kind of run may well read one value throughout."""
    place, value = f"channel {channel.name}", f"{seen.low:g} {channel.unit}"
    still = channel.quantity == "speed" or (alone and channel.quantity in {"temperature", "pressure"})
    still = still or (channel.quantity == "acceleration" and report.run.kind != "dynamic")
    if not still:
        text = f"is dead: it reads {value} throughout"
        cure = "Check sensor, cable and amplifier; repeat the run, or set the channel to ignore"
        report.say(f"dead {channel.name}", grave, place, text, cure)
    elif channel.quantity in {"temperature", "pressure"}:
        text = f"reads {value} throughout"
        report.say(f"constant {channel.name}", "note", place, text, "Check that it is alive")


def _stuck(report: Reporter, channel: Channel, statistics: ChannelStatistics, grave: Severity) -> None:
    if not stands_still(statistics):
        return
    share = statistics.longest_flat / statistics.samples
    severity: Severity = grave if share > 0.25 else ("warning" if share > 0.05 else "note")
    span = f"{statistics.longest_flat} samples from sample {statistics.flat_start} on"
    text = f"stands still for {span} ({share:.0%} of the run)"
    cure = "Check sensor and logger; repeat the run if much of it is lost"
    report.say(f"stuck {channel.name}", severity, f"channel {channel.name}", text, cure)


def _temperature(report: Reporter, channel: Channel, statistics: ChannelStatistics) -> None:
    ends = sorted((channel.slope * statistics.low + channel.zero, channel.slope * statistics.high + channel.zero))
    if ends[0] < _TEMPERATURES[0] or ends[1] > _TEMPERATURES[1]:
        text = f"reads from {ends[0] - _CELSIUS:.0f} to {ends[1] - _CELSIUS:.0f} degC"
        cure = "Check sensitivity, zero and wiring"
        report.say(f"temperature {channel.name}", "warning", f"channel {channel.name}", text, cure)


def check_clock(report: Reporter, time: FloatArray) -> None:
    """Judge the times of a run; `time` (n,)."""
    rate = report.run.sample_rate
    _check_length(report, len(time), rate)
    if len(time) < 3:
        return
    steps = np.diff(time)
    step = 1.0 / rate
    _check_gaps(report, steps, step)
    usual = steps[steps < 1.5 * step]
    if len(usual) < len(steps) / 2:
        return
    scatter = float(np.std(usual)) / step
    resolution = float(np.min(steps[steps > 0], initial=step))
    rounded = resolution > 0.3 * step and float(np.max(np.abs(usual - step))) <= resolution
    if scatter > 0.02:
        cause = "the time column is rounded" if rounded else "the clock jitters"
        severity: Severity = "warning" if scatter > 0.2 and not rounded else "note"
        text = f"{cause}: steps scatter by {scatter:.0%} of a sample"
        cure = "Times are used as they are; export more digits if you can"
        report.say("jitter", severity, "time", text, cure)


def _check_length(report: Reporter, samples: int, rate: float) -> None:
    excitation = report.run.point.excitation_hz
    if samples < 3:
        text = f"the record holds only {samples} samples"
        report.say("short", "error", "time", text, "Export the run again")
    elif report.run.kind == "dynamic" and rate < 2.2 * excitation:
        text = f"{rate:g} samples per second cannot show an excitation of {excitation:g} Hz"
        cure = "Check sample_rate, the unit of the time column (ms called s?) and excitation_frequency"
        report.say("nyquist", "error", "time", text, cure)
    elif report.run.kind == "dynamic" and excitation > 0 and samples < _MIN_CYCLES * rate / excitation:
        text = f"the record holds only {samples * excitation / rate:.1f} cycles of the excitation"
        report.say("short", "warning", "time", text, f"Record at least {_MIN_CYCLES:g} cycles")


def _check_gaps(report: Reporter, steps: FloatArray, step: float) -> None:
    """A late sample of a jittering clock is no gap: there the next step is short."""
    gaps = np.flatnonzero(steps > 1.9 * step)
    if len(gaps) == 0:
        return
    longest = int(gaps[np.argmax(steps[gaps])])
    lost = float(np.sum(steps[gaps] - step)) / step
    severity: Severity = "warning" if lost > 0.005 * len(steps) else "note"
    text = (
        f"{len(gaps)} gaps, about {lost:.0f} samples lost, the longest of {steps[longest]:.6g} s after sample {longest}"
    )
    report.say("gap", severity, "time", text, "Times are used as they are; check the logger's buffer")
