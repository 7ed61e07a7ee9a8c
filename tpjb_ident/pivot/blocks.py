"""Short averages of a dry-pivot record on the axes of its pad: what the curve is fitted to.

Averaging 0.1 s keeps all that a slow test can tell, takes the mains out (5 or 6 whole periods), and leaves some hundred
numbers whose covariance can be written down in full.

No set points are needed for holds: they are where the load changes much more slowly than it does on average over
the record. A record without holds (one continuous ramp) simply has none.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.phasors.line_fit import robust_deviation, white_noise
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import piece_means

BLOCK = 0.1  # [s]
MOST_BLOCKS = 220  # the covariance is a full matrix: keep it small
_STILL = 0.2  # share of the mean rate of change below which the load counts as held
_SETTLED = 4.0  # noise standard deviations within which the load must lie of the hold's own level
_ALIKE = 6.0  # noise standard deviations between two runs of one hold
_FEWEST = 4  # bins of a hold: 0.16 s, longer in long records
_FEWEST_SAMPLES = 3  # of a piece
_MAINS_PERIOD = 0.02  # [s]: averages over whole periods carry no pickup
_LEVEL = 0.3  # of that, within which a load stands where it was
_UNDECIDED = 8.0  # noise standard deviations by which a load seems to come back and does not
_TURN = 0.02  # of the load range: a smaller way back is noise


class Hold(NamedTuple):
    """One stretch of constant load."""

    start: float  #: [s]
    stop: float  #: [s]
    level: float  #: [N]

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.stop - self.start


class LoadCourse(NamedTuple):
    """Load along the pad over time, in short medians."""

    time: FloatArray  #: (n,) [s]
    load: FloatArray  #: (n,) [N]
    width: float  #: [s]


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
    branch: FloatArray  #: +1 loading, -1 unloading, their mean within a block

    def __len__(self) -> int:
        return len(self.time)

    def take(self, chosen: BoolArray) -> Blocks:
        """The blocks where `chosen` (m,) is true."""
        return Blocks(*(column[chosen] for column in vars(self).values()))

    def covariance(self, noise: NoiseModel, quantisation: float = 0.0) -> FloatArray:
        """Covariance (m, m) [m^2] of a displacement, whose level may stand between two steps of a converter [m]."""
        return noise.covariance(self.time, self.duration) + quantisation**2 * np.eye(len(self))


def time_bins(time: FloatArray, width: float) -> tuple[IntArray, IntArray]:
    """Number (n,) of the bin of `width` [s] of each moment (n,) [s], and the bins that are not half empty."""
    label = np.floor((time - time[0]) / width + 1e-9).astype(int)
    count = np.bincount(label)
    return label, np.flatnonzero(count >= 0.5 * np.median(count[count > 0]))


def load_course(time: FloatArray, load: FloatArray, width: float, most: int) -> LoadCourse:
    """Course of a load programme, `most` medians over `width` [s]: time (n,) [s], load along the pad (n,) [N]."""
    width *= max(1.0, np.ceil((time[-1] - time[0]) / width / most))
    label, whole = time_bins(time, width)
    moment, level = ndimage.mean(time, label, whole), ndimage.median(load, label, whole)
    return LoadCourse(moment, level, width)


def find_holds(time: FloatArray, load: FloatArray) -> tuple[Hold, ...]:
    """Find the holds of a load programme: time (n,) [s], load along the pad (n,) [N]."""
    moment, level, width = load_course(time, load, 2.0 * _MAINS_PERIOD, 1000)
    if len(level) < 8:
        return ()
    noise = white_noise(level)
    # noise adds to the way, but at most a tenth of what the second limit is above it
    mean_rate = np.sum(np.abs(np.diff(level))) / (moment[-1] - moment[0])
    still = np.abs(np.gradient(level, moment)) < max(_STILL * mean_rate, 3.0 * noise / (np.sqrt(2.0) * width))
    holds = []
    for run in _still_runs(still, level, noise):
        start, stop = _settled(level, noise, *run)
        if stop - start >= _FEWEST:
            begin, end = moment[start] - 0.5 * width, moment[stop - 1] + 0.5 * width
            holds.append(Hold(begin, end, np.median(level[start:stop])))
    return tuple(holds)


def _still_runs(still: BoolArray, level: FloatArray, noise: float) -> list[list[int]]:
    """Half-open ranges of bins that are still; those that a noisy bin split and that stand on one level are one."""
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    runs: list[list[int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if runs and start - runs[-1][1] <= 2:
            step = np.median(level[start:stop]) - np.median(level[slice(*runs[-1])])
            if abs(step) < _ALIKE * noise:
                runs[-1][1] = stop
                continue
        runs.append([start, stop])
    return runs


def _settled(level: FloatArray, noise: float, start: int, stop: int) -> tuple[int, int]:
    """Cut the overshoot off the front of a range of bins and the first moving bin off either end."""
    while stop - start >= _FEWEST:
        middle = np.median(level[start:stop])
        off = np.abs(level[start:stop] - middle)
        limit = _SETTLED * max(noise, robust_deviation(off), 1e-9 * abs(middle))
        if off[0] > limit:
            start += 1
        elif off[-1] > limit:
            stop -= 1
        else:
            break
    return start, stop


def cut_blocks(time: FloatArray, vectors: FloatArray, holds: tuple[Hold, ...], length: float = BLOCK) -> Blocks:
    """Average a record piece by piece of `length` [s], or of a multiple where it is long or its samples are few.

    `vectors` (n, 4): load along and across the pad [N], displacement along and across [m].
    """
    span = time[-1] - time[0]
    period = span / max(len(time) - 1, 1)
    length *= math.ceil(max(span / MOST_BLOCKS, _FEWEST_SAMPLES * period) / length - 1e-6)
    bounds = np.r_[time[0], np.ravel([hold[:2] for hold in holds]), time[-1]]
    pieces: list[tuple[float, float, int]] = []  # start, stop and number of the hold
    for k, (start, stop) in enumerate(itertools.pairwise(bounds)):
        if stop - start >= 0.4 * length:
            count, piece = int((stop - start) / length + 1e-6), length
            if k % 2 and count < 4:  # the rest of a short hold is too much to lose
                count = max(1, round((stop - start) / length))
                piece = (stop - start) / count
            of_hold = k // 2 if k % 2 else -1
            for i in range(count):
                pieces.append((start + i * piece, start + (i + 1) * piece, of_hold))
    table = np.array(pieces).reshape(-1, 3)
    edges, number = table[:, :2], table[:, 2].astype(int)
    first, last = np.searchsorted(time, edges.T - 0.5 * period)
    # a piece that lost most of its samples to a glitch or a gap would carry a false weight
    whole = last - first >= np.maximum(_FEWEST_SAMPLES, 0.5 * np.diff(edges)[:, 0] / period)
    first, last, number = first[whole], last[whole], number[whole]
    moment, load, across_load, deflection, across = piece_means(np.column_stack([time, vectors]), first, last).T
    count = last - first
    rate = np.gradient(load, moment) if len(load) > 1 else np.zeros(len(load))
    levels = np.array([hold.level for hold in holds] + [0.0])
    spread, rate = white_noise(vectors[:, 0]) / np.sqrt(count), np.where(number >= 0, 0.0, rate)
    branch = _directions(np.where(number >= 0, levels[number], load))
    return Blocks(moment, count * period, load, across_load, deflection, across, spread, rate, number, branch)


def _directions(load: FloatArray) -> FloatArray:
    """Sense of the load's way (m,): it turns only when the load has come back by `_TURN` of its range."""
    if not len(load):  # a logger too slow for a single piece
        return load
    turn, travel = _TURN * np.ptp(load), load - load[0]
    way = 1.0 if travel[np.argmax(np.abs(travel) > turn)] >= 0.0 else -1.0
    farthest, sense = _play(load, way, 0.0, turn)
    for k in np.flatnonzero(farthest[:-1] != load[:-1])[::-1]:
        sense[k] = sense[k + 1]
    return sense


def slid(blocks: Blocks, course: LoadCourse, friction: float) -> Blocks:
    """The blocks at the loads at which the pivot last slid, and the sense in which it did.

    Friction holds back a share of the load: until the load has come back by twice that, the pivot stays where it was.
    """
    noise = white_noise(course.load)
    last, sense = _play(course.load, blocks.branch[0], friction, _UNDECIDED * noise)
    last = np.where(np.abs(course.load - last) < _UNDECIDED * _LEVEL * noise, course.load, last)
    first, stop = np.searchsorted(course.time, blocks.time + np.multiply.outer([-0.5, 0.5], blocks.duration))
    first = np.minimum(first, len(last) - 1)
    columns = np.column_stack([last, last * sense, last != course.load])
    load, held_back, stuck = piece_means(columns, first, np.maximum(stop, first + 1)).T
    return replace(blocks, load=np.where(stuck > 0.0, load, blocks.load), branch=held_back / np.where(load, load, 1.0))


def _play(load: FloatArray, way: float, friction: float, noise: float) -> tuple[FloatArray, FloatArray]:
    """Loads (n,) at which a pivot last slid, and the sense in which it did, at first `way`.

    It slides back where the load has come back by more than `noise`, and by the share `friction` of both loads.
    """
    last, sense = np.empty(len(load)), np.empty(len(load))
    start = 0
    while start < len(load):
        later = load[start:]
        turn = way * np.maximum.accumulate(way * later)
        follows = way * (turn - later) > friction * (np.abs(turn) + np.abs(later)) + noise
        stop = start + int(np.argmax(follows)) if follows.any() else len(load)
        last[start:stop], sense[start:stop] = turn[: stop - start], way
        start, way = stop, -way
    return last, sense
