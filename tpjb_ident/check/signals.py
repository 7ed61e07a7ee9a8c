"""Problems that one channel's readings show by themselves: dead, stuck, clipped, full of gaps."""

from __future__ import annotations

from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Severity
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter

#: Quantities without which a run of that kind says nothing.
NEEDED = {
    "dynamic": ("displacement", "force", "acceleration"),
    "dry_pivot": ("displacement", "force"),
    "locus": ("displacement", "force"),
    "clearance": ("displacement", "force"),
    "baseline": ("displacement", "force"),
}
_CELSIUS = 273.15
#: Film and housing temperatures of a rig that is not on fire [K].
_TEMPERATURES = (_CELSIUS - 50.0, _CELSIUS + 300.0)


def needed(run: Run, channel: Channel) -> bool:
    """Whether `run` cannot be used without `channel`.

    Parameters
    ----------
    run : Run
    channel : Channel
    """
    return channel.quantity in NEEDED[run.kind]


def check_signal(report: Reporter, channel: Channel, seen: ChannelStatistics, noise_free: bool, alone: bool) -> None:
    """Judge one channel of one run.

    Parameters
    ----------
    report : Reporter
        Receives the findings.
    channel : Channel
    seen : ChannelStatistics
        Of its raw readings.
    noise_free : bool
        The run's other channels show no noise above the converter's steps: then a constant reading is
        no dead channel.
    alone : bool
        No other channel of this quantity lives in this run.
    """
    grave: Severity = "error" if needed(report.run, channel) else "warning"
    place = f"channel {channel.name}"
    if seen.values == 0:
        what = "holds no values at all"
        report.say(f"empty {channel.name}", grave, place, what, "Check the channel's wiring and logger settings")
        return
    _missing(report, channel, seen, grave)
    if seen.constant and not noise_free:
        _dead(report, channel, seen, grave, alone)
    if seen.constant:
        return
    if not noise_free:
        _stuck(report, channel, seen, grave)
    clipped = seen.clipped_share()
    if clipped > 0:
        limits = f"{seen.low:g} and {seen.high:g} {channel.unit}"
        what = f"{clipped:.1%} of the samples sit flat at an extreme reading (limits {limits}): clipped"
        severity: Severity = grave if clipped > 0.05 else "warning"
        report.say(f"clipped {channel.name}", severity, place, what, "Widen the logger's range and repeat the run")
    if channel.quantity == "temperature":
        _temperature(report, channel, seen)


def _missing(report: Reporter, channel: Channel, seen: ChannelStatistics, grave: Severity) -> None:
    share = seen.missing / seen.samples
    if share == 0:
        return
    severity: Severity = grave if share > 0.5 else ("warning" if share > 0.01 else "note")
    what = f"{seen.missing} of {seen.samples} samples have no value ({share:.1%})"
    cure = "Repeat the run" if share > 0.5 else "They are left out"
    report.say(f"missing {channel.name}", severity, f"channel {channel.name}", what, cure)


def _dead(report: Reporter, channel: Channel, seen: ChannelStatistics, grave: Severity, alone: bool) -> None:
    """A channel of what does not move in this kind of run may well read one value throughout."""
    place, value = f"channel {channel.name}", f"{seen.low:g} {channel.unit}"
    still = channel.quantity == "speed" or (alone and channel.quantity in {"temperature", "pressure"})
    still = still or (channel.quantity == "acceleration" and report.run.kind != "dynamic")
    if not still:
        what = f"is dead: it reads {value} throughout"
        cure = "Check sensor, cable and amplifier; repeat the run, or set the channel to ignore"
        report.say(f"dead {channel.name}", grave, place, what, cure)
    elif channel.quantity in {"temperature", "pressure"}:
        what = f"reads {value} throughout"
        report.say(f"constant {channel.name}", "note", place, what, "Check that it is alive")


def _stuck(report: Reporter, channel: Channel, seen: ChannelStatistics, grave: Severity) -> None:
    if seen.longest_flat < max(50, 10 * seen.expected_flat()):
        return
    share = seen.longest_flat / seen.samples
    severity: Severity = grave if share > 0.25 else ("warning" if share > 0.05 else "note")
    what = f"stands still for {seen.longest_flat} samples from sample {seen.flat_start} on ({share:.0%} of the run)"
    cure = "Check sensor and logger; repeat the run if much of it is lost"
    report.say(f"stuck {channel.name}", severity, f"channel {channel.name}", what, cure)


def _temperature(report: Reporter, channel: Channel, seen: ChannelStatistics) -> None:
    ends = sorted((channel.slope * seen.low + channel.zero, channel.slope * seen.high + channel.zero))
    if ends[0] < _TEMPERATURES[0] or ends[1] > _TEMPERATURES[1]:
        what = f"reads from {ends[0] - _CELSIUS:.0f} to {ends[1] - _CELSIUS:.0f} degC"
        cure = "Check sensitivity, zero and wiring"
        report.say(f"temperature {channel.name}", "warning", f"channel {channel.name}", what, cure)
