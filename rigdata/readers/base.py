"""What every reader of one run's record offers to `rigdata.campaign.Run`, and which file names which reader takes."""

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import DIMENSIONS, Channel, Channels, reading_gain, reading_zero
from rigdata.device import Device, Grid, by_clock, planned
from rigdata.manifest.manifest import CsvSpec
from rigdata.near_names import nearest_name
from rigdata.problem import Problem, RigDataError, Severity, refuse, tables_beside
from rigdata.units import UnitError, is_signal, parse_unit

#: A channel longer than this is rejected: slices of it would be asked for by mistake [samples].
MAX_SAMPLES = 2**31
#: One request for more samples of one channel than this is rejected (it would be 4 GB) [samples].
MAX_REQUEST = 2**29
#: What a file may claim to hold, unpacked and as numbers of eight bytes: so much in any case [bytes], and so many times
#: its size; a program that needs more sets them before it loads a campaign.
CLAIM_FREE, CLAIM_MULTIPLES = 2**28, 64
#: Bytes of a sample as it is read.
SAMPLE = 8
#: Sample rates beyond these are none [Hz]: times counted from them overflow.
LEAST_RATE, MOST_RATE = 1e-6, 1e12
#: Text in any national spelling.
TEXT = (".csv", ".txt", ".asc", ".dat", ".tsv")
#: Module of `rigdata.readers`, its function, and the extra that brings its library, by suffix.
FORMATS: dict[str, list[str]] = tables_beside(__file__, "formats.toml")
#: Columns cached by a campaign before the run that was not asked for longest is let go [bytes].
_CACHE_BYTES = 96 * 2**20
#: Factors that differ by less are rounded ones of one unit.
_SAME = 1e-3


@dataclass(frozen=True)
class RecordFile:
    """A record and what the manifest says of it; without a manifest there are no channels, and all columns count."""

    path: Path
    file: str
    run: str | None = None
    channels: Channels = field(default_factory=dict, repr=False)
    stated_rate: float | None = None
    spec: CsvSpec = field(default_factory=CsvSpec)

    def refuse(self, place: str, fault: str, remedy: str) -> RigDataError:
        """The error that stops the reading of the file."""
        return refuse(self.file, place, fault, remedy, self.run)

    def problem(self, severity: Severity, place: str, fault: str, remedy: str) -> Problem:
        """Something wrong with the file that does not stop its reading by itself."""
        return Problem(severity, self.file, place, fault, remedy, self.run)


def refuse_claim(claimed: int, path: Path) -> None:
    """Refuse a file whose headers claim far more bytes than it can hold, before any of it is read."""
    size = path.stat().st_size
    if claimed > CLAIM_FREE + CLAIM_MULTIPLES * size:
        fault = f"claims {claimed / 1e6:.0f} MB of samples in a file of {size / 1e6:.3g} MB"
        raise refuse(path.name, "", fault, "Copy it again from the logger, or split the run")


@dataclass(frozen=True)
class Layout:
    """What is sampled together in a record."""

    grids: tuple[Grid, ...]  #: the run's own device first
    faults: dict[str, RigDataError]  #: of channels without usable times


class ReadingCache:
    """What is known of a campaign's runs, the last used ones, up to a number of bytes."""

    def __init__(self, limit: int = _CACHE_BYTES) -> None:
        self._limit = limit
        self._entries: OrderedDict[tuple[object, ...], Any] = OrderedDict()
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadingCache, (self._limit,)  # a worker process starts with an empty one

    def get(self, key: tuple[object, ...], make: Callable[[], Any]) -> Any:
        """Give the value under `key`, made where it is not cached; the longest unused ones go."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
                return self._entries[key]
        value = make()
        with self._lock:
            self._entries[key] = value
            while self.nbytes > self._limit and len(self._entries) > 1:
                self._entries.popitem(last=False)
        return value

    @property
    def nbytes(self) -> int:
        """Memory taken by all columns [bytes]."""
        return sum(getattr(value, "nbytes", 0) for value in self._entries.values())


@dataclass(frozen=True)
class RunReader(RecordFile):
    """Lazy access to one run's record: channels of several devices, each at its own times."""

    cache: ReadingCache = field(default_factory=ReadingCache, repr=False, compare=False)

    def _layout(self) -> Any:
        """What is sampled together; the key changes when the file does, so that no old one is served."""
        try:
            state = self.path.stat()
        except OSError:  # whoever reads it tells
            return self._read_layout()
        return self.cache.get((self.path, self.run, state.st_size, state.st_mtime_ns), self._read_layout)

    def _read_layout(self) -> Layout:
        """What is sampled together, from the file."""
        raise NotImplementedError

    def _clock_times(self, clock: str, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,) of the times that the file holds under `clock`."""
        raise NotImplementedError

    def _stored(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of channels of one device as the file holds them, (stop - start,) each."""
        raise NotImplementedError

    def read_device(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of channels of one device, (stop - start,) each; NaN in rows that a logger left out."""
        places = self._grid(names[0]).places if names else None
        if places is None:
            return self._stored(names, start, stop)
        first, last = np.searchsorted(places, (start, stop))
        rows = np.full((len(names), stop - start), np.nan)
        rows[:, places[first:last] - start] = self._stored(names, first, last)
        return list(rows)

    def _grid(self, name: str = "") -> Grid:
        """Channels at the times of `name`, which may be their clock; without one those of the run's own device."""
        grids = self._layout().grids
        for grid in grids:
            if name and name in (grid.clock, *grid.channels):
                return grid
        return grids[0]

    def devices(self) -> tuple[Device, ...]:
        """Channels that are sampled together."""
        return by_clock(self._layout().grids, self.channels)

    def apart(self) -> frozenset[str]:
        """Channels that are not sampled with the run's own device."""
        return frozenset[str]().union(*(grid.channels for grid in self._layout().grids[1:]))

    def opened(self) -> AbstractContextManager[None]:
        """Keep the file open while the block runs, where that spares work; nested blocks share it."""
        return nullcontext()

    def problems(self) -> tuple[Problem, ...]:
        """Report what does not stop the run from being used."""
        raise NotImplementedError

    def length(self) -> int:
        """Count the samples per channel of the run's own device."""
        return self._grid().length

    def rate(self) -> float:
        """Give the sample rate [Hz]: of the file's times, else what the file or the manifest states."""
        rate = self._grid().rate
        if LEAST_RATE <= rate <= MOST_RATE:
            return rate
        if rate > 0:
            remedy = "Check the time column, and sample_rate in the manifest"
            raise self.refuse("sample rate", f"is {rate:g} Hz", remedy)
        clocks = [channel.name for channel in self.channels.values() if channel.quantity == "time"]
        self.read_device(clocks, 0, 0)  # names a time column that the file lacks
        fault = "there are neither usable times nor a sample rate"
        remedy = 'Add sample_rate to the run or to [acquisition], a channel with quantity = "time", or in HDF5 the '
        raise self.refuse("", fault, f"{remedy}group's attribute sample_rate_hz")

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names` along the run's own times, (stop - start,) each."""
        faults, separate_names = self._layout().faults, self.apart()
        for name in names:
            if name in faults:
                raise faults[name]
        main_names = [name for name in names if name not in separate_names]
        readings = dict(zip(main_names, self.read_device(main_names, start, stop), strict=True))
        for name in separate_names.intersection(names):
            readings[name] = self._along(name, start, stop)
        return [readings[name] for name in names]

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,): the file's, else counted from the rate."""
        self.rate()  # rejects one that times cannot be counted from
        return self.device_time("", start, stop)

    def device_time(self, name: str, start: int, stop: int) -> FloatArray:
        """Seconds (stop - start,) of a channel's samples: the file's, else counted from its device's rate."""
        grid = self._grid(name)
        if grid.even or not grid.clock:
            return grid.begin + np.arange(start, stop) / grid.rate
        if grid.places is None:
            return self._clock_times(grid.clock, start, stop)
        return np.interp(np.arange(start, stop), grid.places, self._clock_times(grid.clock, 0, len(grid.places)))

    def _along(self, name: str, start: int, stop: int) -> FloatArray:
        """Readings of another device along the run's own times, for those who look at all channels together.

        Straight lines, missing from a step before the first sample and after the last; no phasor may come from it.
        """
        grid = self._grid(name)
        (values,) = self.read_device([name], 0, grid.length)
        at = self.device_time(name, 0, grid.length)
        finite = np.isfinite(values)
        if not finite.any():
            return np.full(stop - start, np.nan)
        at, time = at[finite], self.time(start, stop)
        within = np.clip(time, at[0], at[-1])
        readings = np.interp(within, at, values[finite])
        readings[np.abs(time - within) > 1.0 / grid.rate] = np.nan
        return readings

    def _planned(
        self, timings: Mapping[str, Grid], run_rate: float | None, member: str, remedy: str
    ) -> tuple[tuple[Grid, ...], dict[str, RigDataError]]:
        """Put together what is sampled together; what has no usable times is a fault of that channel."""
        grids, texts = planned(timings, self.channels, run_rate)
        return grids, {name: self.refuse(f"{member} {name}", text, remedy) for name, text in texts.items()}

    def unit_problems(self, units: Mapping[str, str]) -> list[Problem]:
        """An error for every channel whose unit in the file is another than its unit in the manifest."""
        problems = []
        for name, unit in units.items():
            channel, file_unit = self.channels.get(name), unit.strip()
            if channel is not None and file_unit and _differ(file_unit, channel):
                fault = f"the file states {file_unit!r}, the manifest unit = {channel.unit!r}"
                remedy = "Correct unit in the manifest, or the units of the file if those are wrong"
                problems.append(self.problem("error", f"channel {name}", fault, remedy))
        return problems

    def _notes(self, members: str, names: Sequence[str], units: Mapping[str, str]) -> tuple[Problem, ...]:
        """Units other than the manifest's, channels that are sampled apart, and those that nobody describes."""
        problems = self.unit_problems(units)
        if self.apart():
            parts = [f"{', '.join(device.channels[:6])} ({device.rate:.6g} Hz)" for device in self.devices()]
            text = f"sampled apart: {'; '.join(parts[:6])}"
            problems.append(self.problem("note", "channels", text, "State delay_uncertainty if they may start late"))
        extra = [name for name in names if name not in self.channels]
        if extra:
            listed = ", ".join(name[:40] for name in extra[:6])
            listed += f", ... ({len(extra)} in all)" if len(extra) > 6 else ""
            text, remedy = f"{members} without a description: {listed}", "Nothing, or describe them in the manifest"
            problems.append(self.problem("note", members, text, remedy))
        return tuple(problems)


def suffix_hint(path: Path) -> str:
    """What to do about a suffix that no reader is known by; "" where it is known."""
    suffix, readable = path.suffix.lower(), (*TEXT, *FORMATS)
    if suffix in readable:
        return ""
    near = nearest_name(suffix, readable)
    question = f"did you mean {near}? " if near else ""
    return f"{suffix or 'no suffix'} is not read; {question}export it as {', '.join(readable)}"


def _meaning(unit: str, quantity: str) -> tuple[object, float]:
    """What a reading in a unit is, a signal's dimension or the quantity's value at zero, and the SI value of one."""
    if is_signal(unit):
        parsed = parse_unit(unit)
        return parsed.powers, parsed.factor
    return reading_zero(quantity, unit, None), reading_gain(quantity, unit, None)


def _differ(file_unit: str, channel: Channel) -> bool:
    """Whether the unit that a file states makes another number of a reading than the manifest's."""
    quantity = channel.quantity
    if quantity not in DIMENSIONS:
        return False
    try:
        (kind, factor), (other_kind, channel_factor) = _meaning(file_unit, quantity), _meaning(channel.unit, quantity)
    except UnitError:
        return False
    return kind != other_kind or not math.isclose(factor, channel_factor, rel_tol=_SAME)
