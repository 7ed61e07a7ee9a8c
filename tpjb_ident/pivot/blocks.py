"""Short averages of a dry-pivot record: what the curve is fitted to.

Averaging 0.1 s keeps all that a slow test can tell, takes the mains out, and leaves some hundred numbers
whose covariance can be written down in full. Averages on ramps are shorter, so that the curve is straight
within each.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.steps import Hold
from tpjb_ident.slow_records.bad_samples import piece_means

LAW_NAMES: tuple[str, ...] = ("hertz-line", "hertz-point", "power", "linear", "point-in-series", "bilinear", "spline")


@dataclass(frozen=True)
class PivotSettings:
    """Settings of `fit_pivots`; the defaults suit staircase tests of some seconds to minutes."""

    laws: tuple[str, ...] = LAW_NAMES
    block: float = 0.1
    longest_glitch: int = 60
    load_angle_limit: float = math.radians(8.0)
    displacement_angle_limit: float = math.radians(30.0)
    angle_warning: float = math.radians(4.0)
    friction_share: float = 0.003
    friction_share_se: float = 0.003
    lag_allowance: float = 0.002
    contact_tolerance: float = 0.05
    drift_rate: float = 1.0e-8
    bad_hold_limit: float = 5.0
    on_refusal: Literal["raise", "few", "skip"] = "raise"

    def __post_init__(self) -> None:
        unknown = [name for name in self.laws if name not in LAW_NAMES]
        if unknown or not self.laws:
            raise ArgumentError(f"laws must name some of {', '.join(LAW_NAMES)}, got {unknown or 'none'}")
        for name in ("block", "longest_glitch", "lag_allowance", "contact_tolerance", "drift_rate"):
            if not getattr(self, name) > 0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")


TURN = 0.02  # of the load range: a smaller way back is noise
MOST_BLOCKS = 220  # the covariance is a full matrix: keep it small


@dataclass(frozen=True)
class Blocks:
    """Averages over m pieces of record, in order of time."""

    time: FloatArray
    duration: FloatArray
    load: FloatArray
    displacement: FloatArray
    load_spread: FloatArray
    rate: FloatArray
    hold: IntArray
    branch: IntArray

    def __len__(self) -> int:
        return len(self.time)

    def take(self, keep: BoolArray) -> Blocks:
        """The blocks where `keep` (m,) is true."""
        return Blocks(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Samples:
    """One dry record on one time base, missing values and glitches left out."""

    time: FloatArray
    load: FloatArray
    displacement: FloatArray
    along: FloatArray
    lost: float


def cut_blocks(samples: Samples, holds: tuple[Hold, ...], length: float) -> Blocks:
    """Average a record piece by piece."""
    span = float(samples.time[-1] - samples.time[0])
    held = sum(hold.duration for hold in holds)
    length = length * max(1.0, (held + 2.0 * (span - held)) / length / MOST_BLOCKS)
    edges, number = _edges(samples, holds, length)
    first = np.searchsorted(samples.time, edges[:, 0], side="left")
    last = np.searchsorted(samples.time, edges[:, 1], side="left")
    count = last - first
    # a piece that lost most of its samples to a glitch or a gap would carry a false weight
    period = span / max(len(samples.time) - 1, 1)
    whole = count >= np.maximum(3, 0.5 * (edges[:, 1] - edges[:, 0]) / period)
    first, last, count, number = first[whole], last[whole], count[whole], number[whole]
    time = piece_means(samples.time[:, None], first, last)[:, 0]
    along = piece_means(samples.along[:, None], first, last)[:, 0]
    rate = np.where(number >= 0, 0.0, np.gradient(along, time) if len(time) > 1 else 0.0)
    return Blocks(
        time=time,
        duration=np.asarray(count * period),
        load=piece_means(samples.load, first, last),
        displacement=piece_means(samples.displacement, first, last),
        load_spread=_sample_noise(samples.along) / np.sqrt(count),
        rate=np.asarray(rate),
        hold=number,
        branch=_branches(number, along, holds),
    )


def _edges(samples: Samples, holds: tuple[Hold, ...], length: float) -> tuple[FloatArray, IntArray]:
    """Start and stop of every piece (m, 2) [s] and its hold number (m,)."""
    pieces: list[tuple[float, float, int]] = []
    position = float(samples.time[0])
    end = float(samples.time[-1])
    for number, hold in enumerate(holds):
        pieces += _split(position, hold.start, 0.5 * length, -1)
        pieces += _split(hold.start, hold.stop, length, number)
        position = hold.stop
    pieces += _split(position, end, 0.5 * length, -1)
    table = np.array(pieces, dtype=float).reshape(-1, 3)
    return table[:, :2], table[:, 2].astype(int)


def _split(start: float, stop: float, length: float, number: int) -> list[tuple[float, float, int]]:
    """Equal pieces of about `length` between two moments."""
    if stop - start < 0.4 * length:
        return []
    n = max(1, round((stop - start) / length))
    cuts = np.linspace(start, stop, n + 1)
    return [(float(a), float(b), number) for a, b in itertools.pairwise(cuts)]


def _branches(number: IntArray, along: FloatArray, holds: tuple[Hold, ...]) -> IntArray:
    """+1 loading, -1 unloading."""
    of_hold = np.array([hold.branch for hold in holds] + [0], dtype=int)
    return np.asarray(np.where(number >= 0, of_hold[number], _directions(along)))


def _directions(load: FloatArray) -> IntArray:
    """Sense of the load's way (m,): it turns only when the load has come back by `TURN` of its range."""
    if not len(load):  # a logger too slow for a single piece
        return np.zeros(0, dtype=int)
    turn = TURN * float(np.ptp(load))
    off = load - load[0]
    now = 1 if off[int(np.argmax(np.abs(off) > turn))] >= 0.0 else -1
    sense = np.full(len(load), now)
    farthest = 0
    for k in range(len(load)):
        if now * (load[k] - load[farthest]) >= 0.0:
            farthest = k
        elif now * (load[farthest] - load[k]) > turn:
            now = -now
            sense[farthest + 1 :] = now
            farthest = k
    return sense


def _sample_noise(load: FloatArray) -> float:
    """White noise of single load samples [N], from differences: ramps and levels drop out."""
    second = np.diff(load, 2)
    return 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6.0)
