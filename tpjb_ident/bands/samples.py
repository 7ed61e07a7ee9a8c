"""Samples of one broadband run, whole, channel by channel: its transform needs all of them on an even grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.problem import refuse
from rigdata.run import Run
from tpjb_ident.check.signals import is_spare
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.channel_times import DeviceReader, device_readers
from tpjb_ident.phasors.run_data import QUANTITIES

#: Share of a channel's samples that may be missing and bridged by straight lines,
_MAX_LOST = 0.01
#: and from which share on it is said.
_TOLD_LOST = 1e-4
#: Time stamps may stray this share of a sample from the even grid, beyond what their last digit rounds.
_MAX_JITTER = 0.05
#: Finest step of rounded time stamps that is looked for [s].
_FINEST = 1e-7
#: Half the length of the kernel [samples], and the shape of its Kaiser window: 1e-5 of a tone up to 0.4 of the rate.
_TAPS, _KAISER = 24, 9.0


@dataclass(frozen=True)
class Samples:
    """One run in memory, SI."""

    rate: float
    channels: tuple[Channel, ...]  #: probes, cells, accelerometers, in this order
    rows: FloatArray  #: (m, n)
    command: FloatArray | None  #: (2, n): along X and Y, in units of its own
    angle: FloatArray | None  #: (n,), rad: of the shaft, by its tachometer or keyphasor
    conditions: tuple[Condition, ...] = ()

    @property
    def length(self) -> int:
        """Samples per channel."""
        return int(self.rows.shape[1])

    def places(self, quantity: str) -> list[int]:
        """Rows of a quantity's channels."""
        return [j for j, channel in enumerate(self.channels) if channel.quantity == quantity]

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

    def each(self, rate: float, change: Callable[[FloatArray], FloatArray]) -> Samples:
        """The record on another grid; `change` takes rows (k, n)."""
        rows = change(self.rows)
        command = None if self.command is None else change(self.command)
        angle = None
        if self.angle is not None:
            at = np.arange(rows.shape[1]) * self.rate / rate
            angle = np.interp(at, np.arange(len(self.angle)), self.angle)
        return replace(self, rate=rate, rows=rows, command=command, angle=angle)


def read_samples(run: Run, seconds: float | None = None) -> Samples:
    """Read a run from its beginning."""
    rate = run.sample_rate
    n = run.length if seconds is None else min(run.length, round(seconds * rate))
    readers = device_readers(run)
    _refuse_unlike(run, readers)
    parts = [reader.read(0, n) for reader in readers]
    if parts[0].time is not None:
        _even(run, parts[0].time, rate)
    recorded = [pair for reader, part in zip(readers, parts) for pair in zip(reader.channels, part.rows)]
    recorded.sort(key=lambda pair: QUANTITIES.index(pair[0].quantity))
    channels, rows, lost = [], [], 0.0
    for channel, values in recorded:
        missing = float((~np.isfinite(values)).mean())
        if missing > _MAX_LOST and is_spare(channel, [c for c, _ in recorded]):
            continue
        bridged, share = _bridged(run, channel, values)
        channels.append(channel)
        rows.append(bridged)
        lost = max(lost, share)
    conditions = (
        (Condition("samples-lost", f"run {run.id}: {lost:.1%} of a channel's samples"),) if lost > _TOLD_LOST else ()
    )
    return Samples(rate, tuple(channels), np.array(rows), _command(run, n), _angle(run, n, rate), conditions)


def _refuse_unlike(run: Run, readers: tuple[DeviceReader, ...]) -> None:
    """Refuse devices of several rates or lengths: over a band, all channels share a transform."""
    first = readers[0]
    for reader in readers[1:]:
        if reader.length != first.length or abs(reader.rate / first.rate - 1) > 1e-3:
            listed = f"{first.rate:.6g} Hz and {reader.rate:.6g} Hz"
            text = f"are sampled at {listed}; over a band all channels need one rate"
            raise refuse(run.file, "channels", text, "Record them at one rate, or excite by sines", run.id)


def _even(run: Run, time: FloatArray, rate: float) -> None:
    finite = np.isfinite(time)
    if not finite.any():
        return
    place = np.flatnonzero(finite)
    off = (time[finite] - time[finite][0]) * rate - (place - place[0])
    drift = np.polyval(np.polyfit(place, off, 1), place) if len(place) > 2 else off
    if np.abs(off - drift).max() > _MAX_JITTER + 0.6 * rate * _rounding(time[finite]):
        text = "the samples are not evenly spaced; a transform over a band needs an even grid"
        raise refuse(run.file, "time", text, "Resample the record, or export it without gaps", run.id)


def _rounding(time: FloatArray) -> float:
    """Step [s] to which time stamps are rounded, a power of ten; zero where none is seen."""
    step = 0.1
    while step > _FINEST:
        if np.abs(time / step - np.round(time / step)).max() < 1e-4:
            return step
        step /= 10
    return 0.0


def _bridged(run: Run, channel: Channel, values: FloatArray) -> tuple[FloatArray, float]:
    """A channel (n,) with what is missing bridged by straight lines, and the share that was missing."""
    missing = ~np.isfinite(values)
    share = float(missing.mean())
    if share > _MAX_LOST:
        text = f"{share:.1%} of its samples are missing"
        raise refuse(run.file, f"channel {channel.name}", text, "Repeat the run", run.id)
    if not share:
        return values, 0.0
    at = np.arange(len(values))
    return np.interp(at, at[~missing], values[~missing]), share


def _command(run: Run, n: int) -> FloatArray | None:
    """Command along X and Y: every channel along its axis, a single one along the run's excitation where stated."""
    channels = [c for c in run.channels.values() if c.quantity == "command"]
    if not channels:
        return None
    total = np.zeros((2, n))
    for channel in channels:
        values, _ = _bridged(run, channel, np.asarray(run.record(channel.name, 0, n).values))
        angle = float(channel.axis or 0.0)
        if len(channels) == 1 and run.excitation_direction is not None:
            angle = run.excitation_direction
        total += np.outer([np.cos(angle), np.sin(angle)], values - values.mean())
    return total if np.abs(total).max() > 0 else None


def _angle(run: Run, n: int, rate: float) -> FloatArray | None:
    """Angle of the shaft over time from its measured speed [rad]; None where nothing believable measures it."""
    record = run.speed(0, n)
    if record is None or not np.isfinite(record.values).any():
        return None
    gap = ~np.isfinite(record.values)
    at = np.arange(len(gap))
    values = np.interp(at, at[~gap], record.values[~gap])
    nominal = run.point.shaft_speed
    if not nominal > 0 or abs(float(np.median(values)) - nominal) > 0.05 * nominal:
        return None
    return np.asarray(np.cumsum(values) / rate)


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
