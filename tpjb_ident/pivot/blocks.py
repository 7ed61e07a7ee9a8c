"""Short averages of a dry-pivot record on the axes of its pad: what the curve is fitted to.

Averaging 0.1 s keeps all that a slow test can tell, takes the mains out, and leaves some hundred numbers
whose covariance can be written down in full. Averages on ramps are shorter, so that the curve is straight
within each.

No set points are needed for holds: they are where the load changes much more slowly than it does on average over
the record. A record without holds (one continuous ramp) simply has none.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.errors import ArgumentError
from tpjb_ident.phasors.bad_samples import robust_deviation, white_noise
from tpjb_ident.phasors.slow_samples import piece_means
from tpjb_ident.pivot.laws import LAWS

_STILL = 0.2  # share of the mean rate of change below which the load counts as held
_SETTLED = 4.0  # noise standard deviations within which the load must lie of the hold's own level
_FEWEST = 4  # bins of a hold: 0.16 s, longer in long records
_MAINS_PERIOD = 0.02  # [s]: averages over whole periods carry no pickup


@dataclass(frozen=True)
class Hold:
    """One stretch of constant load."""

    start: float  #: [s]
    stop: float  #: [s]
    level: float  #: [N]
    branch: int  #: +1 reached from below, -1 from above

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.stop - self.start


@dataclass(frozen=True)
class _Bins:
    """Medians over whole mains periods."""

    time: FloatArray  #: (m,) [s]
    load: FloatArray  #: (m,) [N]
    width: float  #: [s]
    noise: float  #: of one median [N]


def find_holds(time: FloatArray, load: FloatArray) -> tuple[Hold, ...]:
    """Find the holds of a load programme: time (n,) [s], load along the pad (n,) [N]."""
    bins = _bin(time, load)
    if len(bins.time) < 8:
        return ()
    rate = np.gradient(bins.load, bins.time)
    # noise adds to the way, but at most a tenth of what the second limit is above it
    mean_rate = float(np.sum(np.abs(np.diff(bins.load)))) / float(bins.time[-1] - bins.time[0])
    still_rate = max(_STILL * mean_rate, 3.0 * bins.noise / (np.sqrt(2.0) * bins.width))
    runs = _runs(np.abs(rate) < still_rate)
    holds = []
    for run in _merge(runs, bins):
        hold = _settle(run, bins)
        if hold is not None:
            holds.append(hold)
    return tuple(_with_branches(holds, float(bins.load[0]), _SETTLED * bins.noise))


def _bin(time: FloatArray, load: FloatArray) -> _Bins:
    """Load medians over bins of two mains periods (longer for long records)."""
    span = float(time[-1] - time[0])
    width = _MAINS_PERIOD * max(2.0, np.ceil(span / _MAINS_PERIOD / 2000.0))
    label = np.floor((time - time[0]) / width + 1e-9).astype(int)
    edges = np.flatnonzero(np.diff(label)) + 1
    starts, stops = np.r_[0, edges], np.r_[edges, len(time)]
    whole = (stops - starts) >= 0.5 * np.median(stops - starts)
    bounds = list(zip(starts[whole], stops[whole], strict=True))
    medians = np.array([np.median(load[a:b]) for a, b in bounds])
    times = np.array([np.mean(time[a:b]) for a, b in bounds])
    return _Bins(times, medians, width, white_noise(medians) if len(medians) > 2 else 0.0)


def _runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Half-open index ranges in which `mask` is true."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _merge(runs: list[tuple[int, int]], bins: _Bins) -> list[tuple[int, int]]:
    """Join runs that a single noisy bin split: the gap is short and the level the same on both sides."""
    merged: list[tuple[int, int]] = []
    for run in runs:
        if merged and run[0] - merged[-1][1] <= 2:
            level_before = np.median(bins.load[merged[-1][0] : merged[-1][1]])
            level = np.median(bins.load[run[0] : run[1]])
            if abs(level - level_before) < 6.0 * bins.noise:
                merged[-1] = (merged[-1][0], run[1])
                continue
        merged.append(run)
    return merged


def _settle(run: tuple[int, int], bins: _Bins) -> Hold | None:
    """Cut the overshoot off the front of a run and the first moving bin off either end."""
    a, b = run
    while b - a >= _FEWEST:
        level = float(np.median(bins.load[a:b]))
        noise = max(bins.noise, robust_deviation(bins.load[a:b] - level), 1e-9 * abs(level))
        if abs(bins.load[a] - level) > _SETTLED * noise:
            a += 1
        elif abs(bins.load[b - 1] - level) > _SETTLED * noise:
            b -= 1
        else:
            break
    if b - a < _FEWEST:
        return None
    start = float(bins.time[a]) - 0.5 * bins.width
    stop = float(bins.time[b - 1]) + 0.5 * bins.width
    return Hold(start, stop, float(np.median(bins.load[a:b])), 1)


def _with_branches(holds: list[Hold], first_load: float, noise: float) -> list[Hold]:
    """Mark each hold as reached from below or from above; `noise` is what a reading may be off a level it is on [N]."""
    previous = first_load
    marked = []
    for k, hold in enumerate(holds):
        branch = 1 if hold.level >= previous else -1
        if k == 0 and len(holds) > 1 and abs(hold.level - first_load) < max(noise, 1e-3 * abs(hold.level)):
            # the record starts on its first hold: it came the way the programme goes on
            branch = 1 if holds[1].level >= hold.level else -1
        marked.append(replace(hold, branch=branch))
        previous = hold.level
    return marked


_TURN = 0.02  # of the load range: a smaller way back is noise
MOST_BLOCKS = 220  # the covariance is a full matrix: keep it small


@dataclass(frozen=True)
class PivotSettings:
    """Settings of `fit_pivots`; the defaults suit staircase tests of some seconds to minutes."""

    laws: tuple[str, ...] = tuple(LAWS)
    block: float = 0.1  #: [s]
    longest_glitch: int = 60  #: samples
    load_angle_limit: float = math.radians(8.0)
    displacement_angle_limit: float = math.radians(30.0)
    angle_warning: float = math.radians(4.0)
    friction_share: float = 0.003
    friction_share_se: float = 0.003
    lag_allowance: float = 0.002  #: [s]
    contact_tolerance: float = 0.05
    drift_rate: float = 1.0e-8  #: [m/s]
    bad_hold_limit: float = 5.0  #: standard errors
    on_refusal: Literal["raise", "few", "skip"] = "raise"

    def __post_init__(self) -> None:
        unknown = [name for name in self.laws if name not in LAWS]
        if unknown or not self.laws:
            raise ArgumentError(f"laws must name some of {', '.join(LAWS)}, got {unknown or 'none'}")
        for name in ("block", "longest_glitch", "lag_allowance", "contact_tolerance", "drift_rate"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")


@dataclass(frozen=True)
class Blocks:
    """Averages over m pieces of record, (m,) each, in order of time, along and across the pad's direction."""

    time: FloatArray  #: [s]
    duration: FloatArray  #: [s]
    load: FloatArray  #: along the pad, outward positive [N]
    across_load: FloatArray  #: counter-clockwise positive [N]
    deflection: FloatArray  #: along the pad, from the probes' zero [m]
    across: FloatArray  #: [m]
    load_spread: FloatArray  #: standard error of the load [N]
    rate: FloatArray  #: of the load [N/s], zero within holds
    hold: IntArray  #: number of the hold, -1 on ramps
    branch: IntArray  #: +1 loading, -1 unloading

    def __len__(self) -> int:
        return len(self.time)

    def take(self, chosen: BoolArray) -> Blocks:
        """The blocks where `chosen` (m,) is true."""
        return Blocks(*(getattr(self, column.name)[chosen] for column in fields(self)))


@dataclass(frozen=True)
class Samples:
    """One dry record on one time base, missing values and glitches left out."""

    time: FloatArray  #: (n,) [s]
    load: FloatArray  #: (n, 2) [N]
    displacement: FloatArray  #: (n, 2) [m]
    angle: float  #: of the pad [rad]

    @property
    def along(self) -> FloatArray:
        """Load along the pad (n,) [N]."""
        return np.asarray(self.load @ pad_axes(self.angle)[0])


def pad_axes(angle: float) -> FloatArray:
    """Rows: unit vectors along and across a pad direction [rad], (2, 2)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def cut_blocks(samples: Samples, holds: tuple[Hold, ...], length: float) -> Blocks:
    """Average a record piece by piece of `length` [s], half of it on ramps."""
    load_along = samples.along
    span = float(samples.time[-1] - samples.time[0])
    held = sum(hold.duration for hold in holds)
    length = length * max(1.0, (held + 2.0 * (span - held)) / length / MOST_BLOCKS)
    edges, number = _edges(samples.time, holds, length)
    first = np.searchsorted(samples.time, edges[:, 0], side="left")
    last = np.searchsorted(samples.time, edges[:, 1], side="left")
    count = last - first
    # a piece that lost most of its samples to a glitch or a gap would carry a false weight
    period = span / max(len(samples.time) - 1, 1)
    whole = count >= np.maximum(3, 0.5 * (edges[:, 1] - edges[:, 0]) / period)
    first, last, count, number = first[whole], last[whole], count[whole], number[whole]
    time = piece_means(samples.time[:, None], first, last)[:, 0]
    along = piece_means(load_along[:, None], first, last)[:, 0]
    rate = np.where(number >= 0, 0.0, np.gradient(along, time) if len(time) > 1 else 0.0)
    axes = pad_axes(samples.angle)
    load = piece_means(samples.load, first, last) @ axes.T
    displacement = piece_means(samples.displacement, first, last) @ axes.T
    of_hold = np.array([hold.branch for hold in holds] + [0], dtype=int)
    return Blocks(
        time=time,
        duration=np.asarray(count * period),
        load=load[:, 0],
        across_load=load[:, 1],
        deflection=displacement[:, 0],
        across=displacement[:, 1],
        load_spread=white_noise(load_along) / np.sqrt(count),
        rate=np.asarray(rate),
        hold=number,
        branch=np.asarray(np.where(number >= 0, of_hold[number], _directions(along))),
    )


def _edges(time: FloatArray, holds: tuple[Hold, ...], length: float) -> tuple[FloatArray, IntArray]:
    """Start and stop of every piece (m, 2) [s] and its hold number (m,)."""
    pieces: list[tuple[float, float, int]] = []
    position = float(time[0])
    for number, hold in enumerate(holds):
        pieces += _split(position, hold.start, 0.5 * length, -1)
        pieces += _split(hold.start, hold.stop, length, number)
        position = hold.stop
    pieces += _split(position, float(time[-1]), 0.5 * length, -1)
    table = np.array(pieces, dtype=float).reshape(-1, 3)
    return table[:, :2], table[:, 2].astype(int)


def _split(start: float, stop: float, length: float, number: int) -> list[tuple[float, float, int]]:
    """Equal pieces of about `length` between two moments."""
    if stop - start < 0.4 * length:
        return []
    cuts = np.linspace(start, stop, max(1, round((stop - start) / length)) + 1)
    return [(float(a), float(b), number) for a, b in itertools.pairwise(cuts)]


def _directions(load: FloatArray) -> IntArray:
    """Sense of the load's way (m,): it turns only when the load has come back by `_TURN` of its range."""
    if not len(load):  # a logger too slow for a single piece
        return np.zeros(0, dtype=int)
    turn = _TURN * float(np.ptp(load))
    travel = load - load[0]
    direction = 1 if travel[int(np.argmax(np.abs(travel) > turn))] >= 0.0 else -1
    sense = np.full(len(load), direction)
    farthest = 0
    for k in range(len(load)):
        if direction * (load[k] - load[farthest]) >= 0.0:
            farthest = k
        elif direction * (load[farthest] - load[k]) > turn:
            direction = -direction
            sense[farthest + 1 :] = direction
            farthest = k
    return sense
