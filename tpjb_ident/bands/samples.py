"""Samples of one broadband run, whole, channel by channel: its transform needs all of them on an even grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.problem import refuse
from rigdata.run import Run
from rigdata.vector import inverse_directions
from tpjb_ident.check.signals import is_spare
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.channel_times import DeviceReader, device_readers
from tpjb_ident.phasors.run_data import QUANTITIES

#: Share of a channel's samples that may be missing and bridged by straight lines,
_MAX_LOST = 0.01
#: and from which share on it is said.
_TOLD_LOST = 1e-4
#: Time stamps may stray this part of a sample from the even grid: more is a gap, and no rounding.
_MAX_JITTER = 0.6
#: Half the length of the kernel [samples], and the shape of its Kaiser window: 1e-5 of a tone up to 0.4 of the rate.
_TAPS, _KAISER = 24, 9.0


@dataclass(frozen=True)
class Samples:
    """One run in memory, SI."""

    rate: float
    channels: tuple[Channel, ...]  #: probes, cells, accelerometers, in this order
    rows: FloatArray  #: (m, n)
    command: FloatArray | None  #: (2, n): along X and Y, in units of its own
    conditions: tuple[Condition, ...] = ()

    @property
    def length(self) -> int:
        """Samples per channel."""
        return int(self.rows.shape[1])

    def places(self, quantity: str) -> list[int]:
        """Rows of a quantity's channels."""
        return [j for j, channel in enumerate(self.channels) if channel.quantity == quantity]

    def vector(self, quantity: str) -> FloatArray:
        """X and Y of a quantity, (2, n)."""
        places = self.places(quantity)
        return inverse_directions(tuple(float(self.channels[j].axis or 0.0) for j in places)) @ self.rows[places]

    def signals(self) -> FloatArray:
        """Rows (k, n) about their means, each quantity of unit power: an idle channel weighs nothing beside others.

        The command comes alone where there is one: what was meant to move the shaft tells the period best.
        """
        groups = [self.rows[self.places(q)] for q in ("displacement", "force")]
        if self.command is not None:
            groups = [self.command]
        centred = [rows - rows.mean(axis=1, keepdims=True) for rows in groups]
        sizes = [float(np.sqrt(np.mean(rows**2))) if rows.size else 0.0 for rows in centred]
        return np.concatenate([rows / size for rows, size in zip(centred, sizes) if size > 0])

    def each(self, change: Callable[[FloatArray], FloatArray], rate: float | None = None) -> Samples:
        """The record with all rows (k, n) changed alike, command too; at another rate where one is given."""
        command = None if self.command is None else change(self.command)
        return replace(self, rate=rate or self.rate, rows=change(self.rows), command=command)


def read_samples(run: Run, seconds: float | None = None, fast: Mapping[str, float] | None = None) -> Samples:
    """Read a run from its beginning; `fast`: channels by whose clock time runs faster than the first's, relative."""
    rate = run.sample_rate
    n = run.length if seconds is None else min(run.length, round(seconds * rate))
    readers = device_readers(run)
    _refuse_unlike(run, readers)
    parts = [reader.read(0, n) for reader in readers]
    if parts[0].time is not None:
        _refuse_uneven(run, parts[0].time, rate)
    recorded = [pair for reader, part in zip(readers, parts) for pair in zip(reader.channels, part.rows)]
    recorded.sort(key=lambda pair: QUANTITIES.index(pair[0].quantity))
    channels, rows, lost = [], [], 0.0
    for channel, values in recorded:
        missing = float((~np.isfinite(values)).mean())
        if missing > _MAX_LOST and is_spare(channel, [c for c, _ in recorded]):
            continue
        channels.append(channel)
        rows.append(_by_first_clock(_bridged(run, channel, values), (fast or {}).get(channel.name, 0.0)))
        lost = max(lost, missing)
    told = (Condition("samples-lost", f"run {run.id}: {lost:.1%} of a channel's samples"),)
    return Samples(rate, tuple(channels), np.array(rows), _command(run, n), told if lost > _TOLD_LOST else ())


def _refuse_unlike(run: Run, readers: tuple[DeviceReader, ...]) -> None:
    """Refuse devices of several rates or lengths: over a band, all channels share a transform."""
    first = readers[0]
    for reader in readers[1:]:
        if reader.length != first.length or abs(reader.rate / first.rate - 1) > 1e-3:
            listed = f"{first.rate:.6g} Hz and {reader.rate:.6g} Hz"
            text = f"are sampled at {listed}; over a band all channels need one rate"
            raise refuse(run.file, "channels", text, "Record them at one rate, or excite by sines", run.id)


def _refuse_uneven(run: Run, time: FloatArray, rate: float) -> None:
    """Refuse time stamps with gaps."""
    place = np.flatnonzero(np.isfinite(time))
    off = time[place] * rate - place
    if len(place) > 2 and np.abs(off - np.polyval(np.polyfit(place, off, 1), place)).max() > _MAX_JITTER:
        text = "the samples are not evenly spaced; a transform over a band needs an even grid"
        raise refuse(run.file, "time", text, "Resample the record, or export it without gaps", run.id)


def _bridged(run: Run, channel: Channel, values: FloatArray) -> FloatArray:
    """A channel (n,) with what is missing bridged by straight lines."""
    missing = ~np.isfinite(values)
    if missing.mean() > _MAX_LOST:
        text = f"{missing.mean():.1%} of its samples are missing"
        raise refuse(run.file, f"channel {channel.name}", text, "Repeat the run", run.id)
    at = np.arange(len(values))
    return np.interp(at, at[~missing], values[~missing]) if missing.any() else values


def _by_first_clock(values: FloatArray, rate: float) -> FloatArray:
    """A channel (n,) of a clock that is fast by `rate` as if the first clock had sampled it."""
    if not rate:
        return values
    mean, at = values.mean(), np.arange(float(len(values)))
    return interpolated((values - mean)[None], at * (1 + rate))[0] + mean


def _command(run: Run, n: int) -> FloatArray | None:
    """Command along X and Y: every channel along its axis, a single one along the run's excitation where stated."""
    channels = [c for c in run.channels.values() if c.quantity == "command"]
    total = np.zeros((2, n))
    for channel in channels:
        values = _bridged(run, channel, np.asarray(run.record(channel.name, 0, n).values))
        angle = float(channel.axis or 0.0)
        if len(channels) == 1 and run.excitation_direction is not None:
            angle = run.excitation_direction
        total += np.outer([np.cos(angle), np.sin(angle)], values - values.mean())
    return total if total.any() else None


def interpolated(rows: FloatArray, at: FloatArray) -> FloatArray:
    """Rows (k, n) at the places `at` [samples]; `at` (m,)."""
    base = np.floor(at).astype(int)
    share = at - base
    out = np.zeros((len(rows), len(at)))
    last = rows.shape[1] - 1
    norm = np.i0(_KAISER)
    for tap in range(-_TAPS + 1, _TAPS + 1):
        distance = share - tap
        window = np.i0(_KAISER * np.sqrt(np.maximum(1 - (distance / _TAPS) ** 2, 0.0))) / norm
        out += rows[:, np.clip(base + tap, 0, last)] * (np.sinc(distance) * window)
    return out
