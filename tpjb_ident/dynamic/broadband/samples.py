"""Samples of one broadband run, whole: its transform needs all of them on an even grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import Condition

_QUANTITIES = ("displacement", "force", "acceleration")
#: Share of a channel's samples that may be missing and bridged by straight lines,
_MAX_LOST = 0.01
#: and from which share on it is said.
_TOLD_LOST = 1e-4
#: Time stamps may stray this share of a sample from the even grid.
_MAX_JITTER = 0.05
#: Half the length of the kernel [samples], and the shape of its Kaiser window: 1e-5 of a tone up to 0.4 of the rate.
_TAPS, _KAISER = 24, 9.0


@dataclass(frozen=True)
class Samples:
    """One run in memory, SI."""

    rate: float
    values: dict[str, FloatArray]  #: (2, n): X and Y by quantity; acceleration only where it is measured
    command: FloatArray | None  #: (2, n): along X and Y, in units of its own
    angle: FloatArray | None  #: (n,), rad: of the shaft, by its tachometer or keyphasor
    conditions: tuple[Condition, ...] = ()

    @property
    def length(self) -> int:
        """Samples per channel."""
        return int(self.values["displacement"].shape[1])


def read_samples(run: Run, seconds: float | None = None) -> Samples:
    """Read a run from its beginning."""
    rate = run.sample_rate
    n = run.length if seconds is None else min(run.length, round(seconds * rate))
    present = {c.quantity for c in run.channels.values()}
    quantities = [q for q in _QUANTITIES if q in present or q != "acceleration"]
    found = run.row_reader(quantities).read(0, n)
    if found.time is not None:
        _even(run, found.time, rate)
    values, lost = {}, 0.0
    for quantity, rows in found.rows.items():
        values[quantity], share = _bridged(run, quantity, rows)
        lost = max(lost, share)
    conditions = (
        (Condition("samples-lost", f"run {run.id}: {lost:.1%} of a channel's samples"),) if lost > _TOLD_LOST else ()
    )
    return Samples(rate, values, _command(run, n), _angle(run, n, rate), conditions)


def _error(run: Run, place: str, what: str, cure: str) -> RigDataError:
    return RigDataError(Problem("error", run.file, place, what, cure, run.id))


def _even(run: Run, time: FloatArray, rate: float) -> None:
    finite = np.isfinite(time)
    if not finite.any():
        return
    place = np.flatnonzero(finite)
    off = (time[finite] - time[finite][0]) * rate - (place - place[0])
    drift = np.polyval(np.polyfit(place, off, 1), place) if len(place) > 2 else off
    if np.abs(off - drift).max() > _MAX_JITTER:
        text = "the samples are not evenly spaced; a transform over a band needs an even grid"
        raise _error(run, "time", text, "Resample the record, or export it without gaps")


def _bridged(run: Run, place: str, rows: FloatArray) -> tuple[FloatArray, float]:
    """Rows with what is missing bridged by straight lines, and the share that was missing."""
    missing = ~np.isfinite(rows)
    if not missing.any():
        return rows, 0.0
    share = float(missing.mean(axis=1).max())
    if share > _MAX_LOST:
        raise _error(run, place, f"{share:.1%} of its samples are missing", "Repeat the run")
    out = rows.copy()
    at = np.arange(rows.shape[1])
    for row, gap in zip(out, missing):
        row[gap] = np.interp(at[gap], at[~gap], row[~gap])
    return out, share


def _command(run: Run, n: int) -> FloatArray | None:
    """Command along X and Y: every channel along its axis, a single one along the run's excitation where stated."""
    channels = [c for c in run.channels.values() if c.quantity == "command"]
    if not channels:
        return None
    total = np.zeros((2, n))
    for channel in channels:
        values, _ = _bridged(run, f"channel {channel.name}", run.record(channel.name, 0, n).values[None])
        angle = float(channel.axis or 0.0)
        if len(channels) == 1 and run.excitation_direction is not None:
            angle = run.excitation_direction
        total += np.outer([np.cos(angle), np.sin(angle)], values[0] - values[0].mean())
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
