"""Devices of a run: channels that are sampled together, each device at its own times."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.calibration import UNDESCRIBED, Channels

#: Share by which a stated rate may miss that of the samples.
RATE_MISS = 0.01
_NO_DATA = ("time", "ignore")


@dataclass(frozen=True)
class Device:
    """Channels of one clock and one rate.

    Attributes
    ----------
    name : str
        Letter of the clock; without one "" of the run's own device, else its time column or its rate.
    channels : tuple of str
    rate : float
        Nominal [Hz]; NaN where neither file nor manifest tells it.
    length : int
        Samples of each channel.
    counted : bool
        Times are counted from the rate, from 0 on; there is no time column.

    Examples
    --------
    >>> [(device.name, device.rate, device.length) for device in ti.load_campaign(demo).run("d-05000-25-01").devices]
    [('', 1000.0, 2000)]
    """

    name: str
    channels: tuple[str, ...]
    rate: float
    length: int
    counted: bool


@dataclass(frozen=True)
class Grid:
    """Channels of one file at the same times; to begin with, what the file says of the samples of one channel."""

    length: int
    clock: str = ""  #: names the times; "" where they are counted, or there are none
    rate: float = np.nan  #: of the times [Hz]
    label: str = ""
    begin: float = 0.0  #: first time [s]; NaN where it is missing
    times: int | None = None  #: of a time column that should serve it but has not its length
    places: IntArray | None = None  #: of its rows, where a logger left rows out: readings without a value
    even: bool = False  #: times are counted from the first one and the rate: the file's are rounded
    channels: list[str] = field(default_factory=list)


#: Steps this many times longer than nearly all are gaps.
_GAP = 3.0
#: Times whose steps are even within this are as good as even, jittering ones are on a grid within that share of a step,
#: rounded ones within that share of their resolution.
_FINE, _EVEN, _WITHIN = 0.05, 0.2, 0.6
#: Share by which `rate_of_time` may miss the rate: 990 Hz in milliseconds look like 1000 Hz with every hundredth lost.
_RATE_DOUBT = 2e-3


def rate_of_time(time: FloatArray) -> float:
    """Nominal sample rate of a time column (n,) [Hz].

    The median step over many samples is free of gaps, of jitter and of the rounding of the column
    (0.000, 0.001, 0.001, 0.002 at 2 kHz); NaN where no two times are finite or time does not advance.
    """
    finite = _without_gaps(time[np.isfinite(time)])
    span = min(1000, len(finite) // 4) or len(finite) - 1
    if span < 1:
        return np.nan
    step = np.median(finite[span:] - finite[:-span]) / span
    # Ten digits: as much as a column of rounded times holds; keeps 1000 Hz from being 999.9999999999.
    return float(f"{1.0 / step:.10g}") if step > 0 else np.nan


def _without_gaps(time: FloatArray) -> FloatArray:
    """Times (n,) as if no rows had been left out between them: in a short record most spans hold a gap."""
    steps = np.diff(time)
    if not len(steps) or not steps.max() > max(_GAP * steps.mean(), 0.0):  # of most columns nothing else is asked
        return time
    gaps = steps > _GAP * np.quantile(steps[steps > 0], 0.9)
    return np.append(0.0, np.cumsum(np.where(gaps, steps[~gaps].mean(), steps)))


def timed_grid(length: int, clock: str, time: FloatArray, label: str, nominal_rate: float | None) -> Grid:
    """The grid of a time column, by its first times (n,) [s] or all; of a stated rate where these tell none."""
    rate, begin = rate_of_time(time), float(time[0]) if len(time) else 0.0
    grid = Grid(length, clock, rate if rate > 0 else nominal_rate or rate, label, begin)
    steps = np.diff(time) * rate
    is_uneven = len(time) == length and np.abs(steps - 1.0).max(initial=0.0) > _FINE
    return _placed(grid, (time - begin) * rate, steps) if is_uneven else grid


def _placed(grid: Grid, time: FloatArray, steps: FloatArray) -> Grid:
    """The grid of rounded stamps, and of rows that a logger left out: readings without a value; else as it is.

    Rows between gaps share an offset, of which their mean tells more than a rounded gap. `time` (n,) from the first
    and its steps (n - 1,), over a step of the grid.
    """
    spaces = np.diff(np.unique(steps[steps <= _GAP * np.median(steps[steps > 0.0])]))
    resolution = np.min(spaces, where=spaces > _FINE * spaces.max(initial=0.0), initial=np.inf)
    counts = np.rint(steps)
    is_whole = np.all((counts > 0) & (np.abs(steps - counts) < _EVEN))
    is_whole &= abs(time[-1] / counts.sum() - 1.0) < _RATE_DOUBT
    stretch = np.append(0, np.cumsum(steps > (1.5 if is_whole else 1.0 + 1.1 * resolution)))
    rows = np.arange(len(time))
    row, moment = (np.bincount(stretch, values) / np.bincount(stretch) for values in (rows, time))
    within = rows - row[stretch]
    offsets = moment * (within @ within) / (within @ time) - row
    places = rows + np.rint(offsets - offsets[0]).astype(int)[stretch]
    step, begin = np.polyfit(places, time, 1).tolist()
    is_even = np.abs(time - step * places - begin).max() < _WITHIN * resolution < np.inf
    if not (is_even or is_whole) or places[-1] >= 2 * len(time):
        return grid
    if is_even:
        grid = replace(grid, rate=grid.rate / step, begin=grid.begin + begin / grid.rate, even=True)
    return replace(grid, length=int(places[-1]) + 1, places=places if places[-1] >= len(time) else None)


def planned(
    timings: Mapping[str, Grid], channels: Channels, run_rate: float | None
) -> tuple[tuple[Grid, ...], dict[str, str]]:
    """What is sampled together, the run's own device first; and why a channel has no usable times.

    A time column wins over the channel's stated rate, that over the run's.
    """
    grids: dict[tuple[int, str | float], Grid] = {}
    shared = []  # whose times are those of channels without a clock
    untimed = {}
    rates = {}
    faults = {}
    for name, timing in timings.items():
        channel = channels.get(name, UNDESCRIBED)
        if timing.clock:
            grid = grids.setdefault((timing.length, timing.clock), timing)
            grid.channels.append(name)
            if grid not in shared and (not channel.clock or run_rate is None):
                shared.append(grid)
        elif channel.sample_rate:
            rates[name] = channel.sample_rate
        else:
            untimed[name] = timing
    counts = Counter(timing.length for timing in untimed.values())
    usual = max(counts, key=lambda length: (counts[length], length), default=0)
    for name, timing in untimed.items():
        matches = [grid for grid in shared if grid.length == timing.length]
        if timing.times is not None:
            faults[name] = f"has {timing.length} samples, its time column {timing.times}"
        elif matches:
            max(matches, key=lambda grid: grid.rate).channels.append(name)
        elif shared or timing.length != usual:
            samples = max((grid.length for grid in shared), default=usual)
            faults[name] = f"has {timing.length} samples and no times, the others have {samples}"
        else:
            grids.setdefault((usual, ""), Grid(usual, "", run_rate or np.nan)).channels.append(name)
    for name, rate in rates.items():
        faults[name] = _add_stated(grids, channels, name, timings[name].length, rate)
    return tuple(_own_first(grids.values(), channels)), {name: text for name, text in faults.items() if text}


def _add_stated(
    grids: dict[tuple[int, str | float], Grid],
    channels: Channels,
    name: str,
    length: int,
    rate: float,
) -> str:
    """Put a channel of a stated rate where it belongs; or say what is wrong with that rate."""
    for grid in grids.values():
        if grid.length == length and not grid.clock and abs(rate / grid.rate - 1.0) <= RATE_MISS:
            grid.channels.append(name)
            return ""
    begin = 0.0
    if grids:
        first = _own_first(grids.values(), channels)[0]
        expected = rate * first.length / first.rate
        if abs(length - expected) > 1.0 + RATE_MISS * expected:
            return f"has {length} samples; at its sample_rate of {rate:.6g} Hz the run holds {expected:.0f}"
        begin = first.begin if math.isfinite(first.begin) else 0.0
    grids[length, rate] = Grid(length, "", rate, f"{rate:.6g} Hz", begin, channels=[name])
    return ""


def first_probe_first(channels: Channels) -> list[str]:
    """Names of channels, displacements first: the first of those there is belongs to the run's own device."""
    used = {name: c.quantity for name, c in channels.items() if c.quantity not in _NO_DATA}
    return sorted(used, key=lambda name: used[name] != "displacement")


def _own_first(grids: Iterable[Grid], channels: Channels) -> list[Grid]:
    """The grid of the first displacement channel first; without any described channel the fastest."""
    places = {name: i for i, name in enumerate(first_probe_first(channels))}

    def rank(grid: Grid) -> tuple[int, float, int]:
        first = min((places.get(name, len(places)) for name in grid.channels), default=len(places))
        return first, -grid.rate if grid.rate > 0 else 0.0, -grid.length

    return sorted(grids, key=rank)


def by_clock(grids: Iterable[Grid], channels: Channels) -> tuple[Device, ...]:
    """Devices of a run: grids split by clock, that of the first probe first."""
    grid_of = {}
    for grid in grids:
        grid_of.update(dict.fromkeys(grid.channels, grid))
    groups = defaultdict(list)
    for name in first_probe_first(channels):
        if name in grid_of:
            groups[id(grid_of[name]), channels[name].clock].append(name)
    devices: dict[str, Device] = {}
    for (_, letter), names in groups.items():
        grid = grid_of[names[0]]
        name = letter or (grid.label if devices else "")
        if name in devices:
            name = f"{name}, {grid.rate:.6g} Hz".removeprefix(", ")
        while name in devices:
            name += "'"
        counted = not grid.clock and grid.begin == 0.0
        devices[name] = Device(name, tuple(names), grid.rate, grid.length, counted)
    return tuple(devices.values())
