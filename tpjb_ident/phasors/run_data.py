"""What a run's devices record, each at its own times, and what is left of it: phasors by channel, line and window.

The beginning of a record is read once for all who look at it: phasors, channels, checks, temperatures. What is asked
for beyond it is read from the file as before, so that a short record is read once as a whole, and no sample of a long
one twice by those who look at its beginning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.device import Device
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import Directed
from tpjb_ident.conditions import Conditions
from tpjb_ident.phasors.line_fit import usual_scale
from tpjb_ident.phasors.lines import LineSet


@dataclass(frozen=True)
class DeviceReader:
    """Channels of one device: one rate, one row of times."""

    run: Run
    device: Device
    channels: tuple[Channel, ...]  #: of displacement, force, acceleration, command in this order
    rate: float
    length: int

    def read(self, start: int, stop: int) -> tuple[FloatArray | None, FloatArray]:
        """Times (n,) of samples start..stop-1 [s], None where they are counted from the rate; rows (n_channels, n)."""
        return self.run.read_device(self.device, [c.name for c in self.channels], start, stop)

    def first_samples(self, start: FloatArray) -> IntArray:
        """First sample at or after each of some times (n,) [s]."""
        if self.device.counted:
            return np.ceil(start * self.rate - 1e-6).astype(int)
        time, _ = self.run.read_device(self.device, [self.channels[0].name], 0, self.length)
        return np.searchsorted(np.asarray(time), start - 1e-6 / self.rate)


def device_readers(run: Run, command: bool = False) -> tuple[DeviceReader, ...]:
    """Devices of a run that have channels with a direction, or a command if asked; that of the first probe first."""
    directed = []
    for quantity in VECTOR_QUANTITIES:
        if quantity != "acceleration" or run.of(quantity):
            directed += run.vector_channels(quantity)
    if command:
        directed += run.of("command")
    for channel in directed:
        if not any(channel.name in device.channels for device in run.devices):
            run.record(channel.name, 0, 0)  # says that the file lacks it
    readers = []
    for device in run.devices:
        channels = tuple(c for c in directed if c.name in device.channels)
        rate = device.rate if np.isfinite(device.rate) else run.sample_rate
        # of a run that ends early all devices do
        length = min(device.length, int(np.ceil(run.length / run.sample_rate * rate)))
        if channels:
            readers.append(DeviceReader(run, device, channels, rate, length))
    return tuple(readers)


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted."""

    mains: float = 50.0
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()


@dataclass(frozen=True)
class RunPhasors(Directed):
    """One run: a phasor per window, line and channel, each fitted at the channel's own sample times."""

    run: str
    point: OperatingPoint
    direction: float | None
    lines: LineSet
    start: FloatArray  #: (n_windows,), s: start of every window
    length: float
    channels: tuple[Channel, ...]  #: of displacement, force, acceleration, in this order
    z: ComplexArray  #: (n_windows, n_lines, n_channels) complex, SI, exp(+i omega t); NaN where a window gives none
    mean: FloatArray  #: (n_windows, n_channels), SI
    scale: FloatArray  #: (n_windows, n_channels): robust standard deviation of the residual
    lost: FloatArray  #: (n_windows, n_channels): share of the samples left out
    housing_mass: float
    conditions: Conditions = ()
    shaft_phase: ComplexArray = field(default_factory=lambda: np.empty(0, complex))  #: (n_lines,) complex
    span: tuple[float, float] | None = None  #: s: part of the record with one excitation; None: all of it
    device: tuple[str, ...] = ()  #: (n_channels,): clock terms exist between devices only
    #: (n_whole_lines, n_channels) complex, SI: phasors of the whole record's lines, those of the windows first
    record: ComplexArray = field(default_factory=lambda: np.empty((0, 1), complex))
    #: by line of the whole record, (n_bins, n_channels) complex: residual in the bins around it
    residual: tuple[ComplexArray, ...] = ()
    rounding: FloatArray = field(default_factory=lambda: np.empty(0))  #: (n_channels,), SI^2: by it on a line, at most
    temperatures: dict[int, float] = field(default_factory=dict)  #: K: mean by pad
    temperature: float = np.nan  #: K: at the probes, as stated, else the mean of the thermometers
    sample_rate: float = 0.0

    @property
    def noise(self) -> FloatArray:
        """Standard deviation of a window's phasor by what its lines leave, channel by channel (n_channels,)."""
        samples = self.length * self.sample_rate
        return np.maximum(2 * usual_scale(self.scale) / np.sqrt(samples), np.finfo(float).tiny)

    @property
    def film_temperature(self) -> float:
        """Mean over the pads [K]; NaN without their thermometers."""
        return float(np.mean([*self.temperatures.values()])) if self.temperatures else np.nan

    @cached_property
    def displacement(self) -> ComplexArray:
        """X and Y of the probes, (n_windows, n_lines, 2) [m]; NaN where a window gave none."""
        return self.plane("displacement", self.z)

    def means(self, quantity: str) -> FloatArray:
        """X and Y of a quantity's mean in every window, (n_windows, 2)."""
        return self.plane(quantity, self.mean).real

    def film_force(self, values: ComplexArray) -> ComplexArray:
        """X and Y (.., 2) of the oil force [N] by values (.., n_channels) of all channels.

        Housing balance: F_oil = F_cell + m_h a_h, with F_cell the force with which the housing pushes the cells and a_h
        the absolute acceleration of the housing.
        """
        force = self.plane("force", values)
        if self.pick("acceleration"):
            force += self.housing_mass * self.plane("acceleration", values)
        return force

    @cached_property
    def force(self) -> ComplexArray:
        """X and Y of the oil force, (n_windows, n_lines, 2) [N]."""
        return self.film_force(self.z)


def places_of(wanted: Sequence[Channel], channels: Sequence[Channel]) -> list[int]:
    """Place of every channel that is wanted among some, -1 of one that is missing."""
    places = {(channel.name, channel.quantity): k for k, channel in enumerate(channels)}
    return [places.get((channel.name, channel.quantity), -1) for channel in wanted]


def by_channel(values: np.ndarray, channels: Sequence[Channel], wanted: Sequence[Channel]) -> np.ndarray:
    """Values (.., n) of some channels in the order of those that are wanted, (.., m); NaN of those that are missing."""
    padded = np.concatenate([values, np.full((*values.shape[:-1], 1), np.nan)], axis=-1)
    return padded[..., places_of(wanted, channels)]


def complex_median(z: ComplexArray) -> ComplexArray:
    """Median of real and imaginary parts over the first axis; `z` (n, ...)."""
    return np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0)


#: Lines nearer than this are one [Hz].
_SAME_LINE = 1e-3


@dataclass(frozen=True)
class FilmLine:
    """What a run holds at a line that a film which is not linear makes of the motion."""

    ratio: float  #: its frequency over that of the excitation
    displacement: ComplexArray  #: (2,) complex, m
    force: ComplexArray  #: (2,) complex, N: oil force
    displacement_noise: float  #: m^2: mean square of the residual around the line, X and Y together
    force_noise: float  #: N^2


#: What the film makes of one excitation line of a run: "2f", "3f", "2X-f"; those that stand alone.
FilmLines = dict[str, FilmLine]


def film_lines(run: RunPhasors) -> tuple[FilmLines | None, ...]:
    """What the film makes of every excitation line of a run, None of one at rest; () without the whole record's."""
    if not len(run.record) or len(run.residual) < len(run.record):
        return ()
    displacement, force = run.plane("displacement", run.record), run.film_force(run.record)
    # the square that rounding puts on a line is the sum over the channels
    steps = np.diag(np.sqrt(len(run.rounding) * run.rounding)).astype(complex)

    def noise(rows: ComplexArray) -> FloatArray:
        return np.array([_mean_square(run.plane("displacement", rows)), _mean_square(run.film_force(rows))])

    result: list[FilmLines | None] = []
    for i, driven in enumerate(run.lines.excitation):
        size = np.linalg.norm(force[i])
        if not size > 0:
            result.append(None)
            continue
        crossed = abs(2 * run.lines.speed - driven.frequency)
        wanted = {"2f": 2 * driven.frequency, "3f": 3 * driven.frequency, "2X-f": crossed}
        lines = {}
        for name, frequency in wanted.items():
            place = _alone(run, frequency, name)
            if place is not None:
                noises = (noise(run.residual[place]) + noise(steps)) / size**2
                vectors = displacement[place] / size, force[place] / size
                lines[name] = FilmLine(frequency / driven.frequency, *vectors, *noises)
        result.append(lines)
    return tuple(result)


def _mean_square(rows: ComplexArray) -> float:
    """Mean over rows (n, 2) of their squared size, those without a value left out; zero where there is none."""
    sizes = np.sum(np.abs(rows) ** 2, axis=1)
    return float(np.mean(sizes, where=np.isfinite(sizes))) if np.isfinite(sizes).any() else 0.0


def _alone(run: RunPhasors, frequency: float, name: str) -> int | None:
    """Place of a line of the whole record that nothing else shares; None where there is none."""
    kind = "2X-f" if name == "2X-f" else "harmonic"
    places = np.flatnonzero(np.abs(run.lines.whole_frequencies - frequency) < _SAME_LINE).tolist()
    return places[0] if len(places) == 1 and run.lines.whole[places[0]].name.startswith(kind) else None


def mains_lines(run: RunPhasors) -> tuple[ComplexArray | None, ComplexArray | None]:
    """Typical displacement [m] and oil force [N] (2,) at a run's mains line.

    None where a drive harmonic was merged into it, where it is not fitted, or where no window has them.
    """
    place = run.lines.place("mains")
    if place is None:
        return None, None
    mains = run.lines.whole[place]
    for excited in run.lines.excitation:
        for n in (2, 3):
            if abs(n * excited.frequency - mains.frequency) <= mains.wander:
                return None, None
    typical = []
    for z in (run.displacement[:, place], run.force[:, place]):
        complete = z[np.isfinite(z).all(axis=1)]
        typical.append(complex_median(complete) if len(complete) else None)
    return typical[0], typical[1]


#: What the checks look at: so many samples, or so many seconds if that is more, of those that are kept.
_LOOK, SECONDS = 2**14, 2.0
#: Samples per channel up to which a run is kept, and that are looked at of a longer one.
SHORT = 2**17


class _ReadingCache:
    """A run's reader that keeps the first samples of all channels."""

    def __init__(self, reader: Any, channels: Sequence[str], samples: int = SHORT) -> None:
        self._reader, self._channels = reader, channels
        self.samples = min(samples, reader.length())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def read(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        """Raw readings of `names`, (stop - start,) each; not to be written to."""
        if stop <= self.samples and all(name in self._beginning for name in names):
            return [self._beginning[name][start:stop] for name in names]
        return list(self._reader.read(names, start, stop))

    def time(self, start: int, stop: int) -> FloatArray:
        """Seconds of samples start..stop-1."""
        return np.array(self._times[start:stop] if stop <= self.samples else self._reader.time(start, stop))

    @cached_property
    def _times(self) -> FloatArray:
        return np.asarray(self._reader.time(0, self.samples))

    @cached_property
    def _beginning(self) -> dict[str, FloatArray]:
        try:
            values = self._reader.read(self._channels, 0, self.samples)
        except RigDataError:  # told by whoever needs the channel that cannot be read
            return {}
        for readings in values:
            readings.flags.writeable = False
        return dict(zip(self._channels, values))


class _Beginning:
    """A run's reader that ends after the first samples."""

    def __init__(self, reader: Any, samples: int) -> None:
        self._reader, self.whole_length = reader, reader.length()
        self._length = min(samples, getattr(reader, "samples", self.whole_length))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def length(self) -> int:
        """Samples per channel."""
        return self._length


def with_kept_beginning(run: Run) -> Run:
    """The run with its beginning kept."""
    if isinstance(run.reader, _ReadingCache | _Beginning):
        return run
    apart = run.reader.apart()
    names = [name for name, c in run.channels.items() if c.quantity != "time" and name not in apart]
    reader: Any = _ReadingCache(run.reader, names)
    return replace(run, reader=reader)


def beginning_of(run: Run, samples: int | None = None) -> Run:
    """The first samples of a run whose readings are kept, as a run of its own; by default what the checks look at."""
    looked_at = max(_LOOK, round(SECONDS * run.sample_rate))
    beginning: Any = _Beginning(run.reader, samples or looked_at)
    return replace(run, reader=beginning)
