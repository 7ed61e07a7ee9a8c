"""What the channels' electronics did to the phasors, taken out: filters, delays, slower sampling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.run import Run
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.channel_times import device_readers
from tpjb_ident.phasors.filled import SlowerChannel, slower_condition
from tpjb_ident.phasors.lines import LineSet
from tpjb_ident.phasors.run_data import RunPhasors

#: Samples that are looked at.
_RHYTHM_LOOK = 2**13
#: Share of the samples that must be straight (or flat), at least.
_STRAIGHT = 0.15
#: A bend is none below this share of the usual one.
_NO_BEND = 0.01
#: How much of the bends must come in one rhythm, of what a strict one has,
_RHYTHM = 0.8
#: and how far their number may be off.
_COUNT_OFF = 0.25
#: Samples from the start that are looked at.
_LOOK = 2**14
#: A channel with more of its samples at a limit than this is of no use.
_CLIPPED = 0.05


def compensated(result: RunPhasors, run: Run, slower: Mapping[str, SlowerChannel]) -> RunPhasors:
    """The run's phasors as channels without filters and delays would have given them."""
    gains = channel_gains(run, result.channels, slower, result.lines)
    return result if gains is None else result.divided(gains)


def channel_gains(
    run: Run, channels: Sequence[Channel], slower: Mapping[str, SlowerChannel], lines: LineSet
) -> ComplexArray | None:
    """What channels made of a sine of size one at every line, (n_whole_lines, n_channels); None where nothing."""
    if not any(c.response or c.name in slower for c in channels):
        return None
    frequencies = np.array([line.frequency for line in lines.whole])
    gains = np.ones((len(frequencies), len(channels)), dtype=complex)
    for k, channel in enumerate(channels):
        if channel.response:
            gain = channel.response.at(frequencies)
            gains[:, k] *= _reached(gain, frequencies, len(lines.excitation), run, channel.name)
        if channel.name in slower:
            gains[:, k] *= slower[channel.name].at(frequencies)
    return gains


def _reached(gain: ComplexArray, frequencies: FloatArray, driven: int, run: Run, name: str) -> ComplexArray:
    """The gain, 1 at disturbing lines that a table does not reach."""
    valid = np.isfinite(gain) & (np.abs(gain) > 1e-6)
    if not valid[:driven].all():
        text = f"its response at the excitation of {frequencies[~valid][0]:g} Hz is not known, or nothing comes through"
        cure = "Extend filter_table, or check filter"
        raise refuse(run.file, f"channel {name}", text, cure, run.id)
    return np.where(valid, gain, 1.0)


def slower_channel(readings: FloatArray, export_rate: float) -> SlowerChannel | None:
    """Tell whether a channel was filled up, from the beginning of its readings; `readings` (n,).

    Logger programs write groups of different rates into one table by interpolation. A sine comes out of that smaller
    (and late, where values are held), by a factor that the two rates alone determine: it is taken out of the phasors as
    a filter is. What gives such a channel away is that its bends (or steps) come in a strict rhythm.
    """
    values = readings[:_RHYTHM_LOOK]
    if len(values) < 200 or not np.isfinite(values).all():
        return None
    for held, changes in ((True, np.abs(np.diff(values))), (False, np.abs(np.diff(values, 2)))):
        usual = 2 * float(changes.mean())
        bent = changes > _NO_BEND * usual
        if not usual > 0 or bent.mean() > 1 - _STRAIGHT:
            continue
        rate = _rhythm(bent.astype(float), export_rate, held)
        if rate is not None:
            return SlowerChannel(rate, export_rate, 1 if held else 2)
    return None


def _rhythm(bent: FloatArray, export_rate: float, held: bool) -> float | None:
    """Rate at which the bends come [Hz]; None where they do not come in a rhythm."""
    n = len(bent)
    padded = 8 * n
    spectrum = np.abs(np.fft.rfft(bent - bent.mean(), padded))
    step = export_rate / padded
    low, top = int(8 * padded / n), int(0.505 * export_rate / step)
    peaks = spectrum[low : top + 1]
    if not len(peaks) or not peaks.max() > 0:
        return None
    # the first line of a rhythm is the rate, the others are its multiples
    peak = low + int(np.flatnonzero(peaks > 0.7 * peaks.max())[0])
    while peak + 1 < len(spectrum) and spectrum[peak + 1] > spectrum[peak]:
        peak += 1
    ratio = 1 / (peak * step / export_rate)
    # a corner between two samples of the export bends the line at both
    each = 1 if held or bent.mean() < 1.5 / ratio else 2
    expected = each / ratio
    strict = abs(bent.mean() / expected - 1) < _COUNT_OFF and spectrum[peak] > _RHYTHM * np.sinc(expected) * bent.sum()
    return _sharpened(bent, peak * step, export_rate) if strict and expected < 1 - _STRAIGHT else None


def _sharpened(bent: FloatArray, rate: float, export_rate: float) -> float:
    """The rate to a part in a million: the even ratio next to it, or the phase advance between the halves."""
    ratio = export_rate / rate
    n = len(bent)
    if abs(ratio - round(ratio)) * n / ratio**2 < 0.5:
        return export_rate / round(ratio)
    place = np.arange(n) * rate / export_rate
    wave = bent * np.exp(-2j * np.pi * place)
    turn = np.angle(wave[n // 2 :].sum() * wave[: n // 2].sum().conj()) / (2 * np.pi)
    return rate + turn * export_rate / (n / 2)


def inspect_readings(run: Run) -> tuple[dict[str, SlowerChannel], tuple[Condition, ...]]:
    """Channels that were sampled slower than the export, by name, and what to say of them.

    What a single channel's device did is lost once two channels are turned into a vector: that it was driven into its
    limits, or sampled slower than the others.
    """
    slower = {name: slower_channel(values, run.sample_rate) for name, values in unclipped_readings(run).items()}
    named = {name: channel for name, channel in slower.items() if channel is not None}
    return named, slower_condition(named)


def unclipped_readings(run: Run) -> dict[str, FloatArray]:
    """Readings of a run's beginning by channel; refused is one driven into its limits: what was cut off is lost."""
    readings: dict[str, FloatArray] = {}
    clipped: list[Problem] = []
    for reader in device_readers(run):
        rows = reader.read(0, min(reader.length, _LOOK)).rows
        for channel, values in zip(reader.channels, rows):
            readings[channel.name] = values
            if channel.quantity != "acceleration":
                clipped += _clipped(run, channel.name, (values - channel.zero) / channel.slope)
    if clipped:
        raise RigDataError(clipped)
    return readings


def _clipped(run: Run, name: str, values: np.ndarray) -> list[Problem]:
    statistics = ChannelStatistics()
    statistics.add(values)
    share = 0.0 if statistics.constant else statistics.clipped_share()
    if share <= _CLIPPED:
        return []
    unit = run.channels[name].unit
    text = f"{share:.1%} of the samples sit at a limit (from {statistics.low:g} to {statistics.high:g} {unit}): clipped"
    cure = "Widen the channel's range and repeat the run; what was cut off cannot be had back"
    return [Problem("error", run.file, f"channel {name}", text, cure, run.id)]
