"""Holds in a load programme: where the load stands still long enough to be averaged.

No set points are needed: a hold is where the load changes much more slowly than it does on average over the
record. A record without holds (one continuous ramp) simply has none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.phasors.bad_samples import robust_deviation, white_noise

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
