"""One run of a campaign: lazy, calibrated access, channel by channel."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel, Channels
from rigdata.device import Device
from rigdata.manifest.manifest import RunDescription
from rigdata.problem import RigDataError, refuse
from rigdata.readers.base import RunReader
from rigdata.record import Record, VectorRecord
from rigdata.vector import inverse_directions, vector_rows


@dataclass(frozen=True, kw_only=True)
class Run(RunDescription):
    """One test run; its samples are read when they are asked for.

    Attributes
    ----------
    id, kind : str
        Kind is ``"dynamic"``, ``"dry_pivot"``, ``"locus"``, ``"clearance"`` or ``"baseline"``.
    point : OperatingPoint
        Set points, SI, with the sense of turning.
    excitation_direction : float or None
        [rad]
    pad : int or None
        Pad loaded in a dry run, from 1.
    branch : str
        ``"up"``, ``"down"`` or ``"cycle"``.
    channels : mapping of str to Channel
        Those with a quantity (not ``ignore``).
    stated : frozenset of str
        Keys that the manifest gives for this run.
    excitation_kind : str
        ``"sine"``, ``"multisine"``, ``"sweep"``, ``"random"`` or ``"impact"``.
    band : (float, float) or None
        Lowest and highest frequency excited [Hz].
    temperature : float or None
        At the probes, as stated [K]; `mean_temperature` also asks the thermometers.
    housing_mass : float
        Of the campaign's rig [kg].

    Examples
    --------
    >>> run = ti.load_campaign(demo).run("d-05000-25-01")
    >>> run
    <Run d-05000-25-01: dynamic, 5000 N at -90 deg, shaft 22 Hz, excited at 25 Hz>
    >>> len(run.vector("force"))
    2000
    """

    channels: Channels
    reader: RunReader = field(compare=False)
    housing_mass: float = 0.0

    def __repr__(self) -> str:
        towards = "" if self.pad is None else f", pad #{self.pad}"
        return f"<Run {self.id}: {self.kind}{towards}, {self.point}>"

    @property
    def rotation(self) -> str:
        """Sense of turning, ``"counter-clockwise"`` or ``"clockwise"``."""
        return self.point.rotation

    @property
    def file(self) -> str:
        """Name of the file, as the user knows it."""
        return self.reader.file

    def _refuse(self, place: str, fault: str, remedy: str) -> RigDataError:
        return refuse(self.file, place, fault, remedy, self.id)

    @property
    def devices(self) -> tuple[Device, ...]:
        """Channels that are sampled together; the run's own device, that of the first displacement channel, first."""
        return self.reader.devices()

    def _are_separate(self, names: Sequence[str]) -> bool:
        """Whether channels are sampled apart from the run's own device; refused where only some of them are."""
        separate_names = self.reader.apart()
        if not separate_names.intersection(names):
            return False
        devices = {}
        for device in self.devices:
            devices.update(dict.fromkeys(device.channels, device))
        rates = {(devices[name].rate, devices[name].length) for name in names if name in devices}
        if not separate_names.issuperset(names) or len(rates) > 1:
            listed = ", ".join(f"{name} ({devices[name].rate:.6g} Hz)" for name in names if name in devices)
            fault = f"are not sampled at the same times: {listed}"
            raise self._refuse("channels", fault, "Read them device by device, see Run.devices")
        return True

    def read_device(
        self, device: Device, names: Sequence[str], start: int | None = None, stop: int | None = None
    ) -> tuple[FloatArray | None, FloatArray]:
        """Read channels of one device at their own times.

        Parameters
        ----------
        device : Device
            One of `devices`.
        names : sequence of str
            Of its channels.
        start, stop : int, optional
            Samples of the device, as in a Python slice; default all.

        Returns
        -------
        time : (n,) ndarray or None
            Seconds; None where they are counted from the device's rate.
        values : (len(names), n) ndarray
            SI.

        Examples
        --------
        >>> run = ti.load_campaign(demo).run("d-05000-25-01")
        >>> time, values = run.read_device(run.devices[0], ["X1A", "X1B"], 0, 100)
        >>> values.shape
        (2, 100)
        """
        for name in names:
            if name not in device.channels:
                listed = f"It has {', '.join(device.channels)}"[:200]
                raise self._refuse(f"channel {name}", f"is none of device {device.name!r}", listed)
        first, last = _limits(start, stop, device.length)
        is_apart = self._are_separate(names)
        reader = self.reader
        readings = (reader.read_device if is_apart else reader.read)(names, first, last) if names else []
        values = np.empty((len(names), last - first))
        for row, name, reading in zip(values, names, readings, strict=True):
            row[:] = self.channels[name].to_si(reading)
        if device.counted:
            return None, values
        time = reader.device_time(device.channels[0], first, last) if is_apart else reader.time(first, last)
        back = np.flatnonzero(np.diff(time) < 0)
        if len(back):
            place = f"device {device.name!r}, sample {first + int(back[0]) + 2}"
            raise self._refuse(place, "time runs backwards", "Sort or split the run")
        return time, values

    @property
    def length(self) -> int:
        """Samples per channel of the run's own device."""
        return self.reader.length()

    @property
    def sample_rate(self) -> float:
        """Nominal sample rate [Hz]: time column or HDF5 attribute, else the run's, else the campaign's."""
        return self.reader.rate()

    def time(self, start: int | None = None, stop: int | None = None) -> FloatArray:
        """Read or count the times of some samples [s].

        Parameters
        ----------
        start : int or None, optional
            First sample; default the first of all.
        stop : int or None, optional
            Sample after the last; default the end.
        """
        return self.reader.time(*_limits(start, stop, self.length))

    def record(self, name: str, start: int | None = None, stop: int | None = None) -> Record:
        """One channel, calibrated.

        Parameters
        ----------
        name : str
            Channel name of the manifest.
        start, stop : int, optional
            Samples, as in a Python slice; default all.

        Returns
        -------
        Record
            SI values (stop - start,).

        Raises
        ------
        RigDataError
            The manifest has no such channel, or the file cannot give it.

        Examples
        --------
        >>> ti.load_campaign(demo).run("d-05000-25-01").record("X1A", 0, 100)
        <Record X1A: displacement at 45 deg, 100 samples at 1000 Hz>
        """
        channel = self.channels.get(name)
        if channel is None:
            remedy = f"Described: {', '.join(self.channels)}"
            raise self._refuse(f"channel {name}", "is not described in the manifest", remedy)
        (reading,), time, rate = self._stretch([name], start, stop)
        if len(reading) != len(time):  # a time column of another device
            fault = f"has {len(reading)} samples in place of {len(time)}"
            raise self._refuse(f"channel {name}", fault, "Its times come with the records of its device's channels")
        return Record(name, channel.quantity, channel.to_si(reading), time, rate, channel.axis)

    def _stretch(
        self, names: Sequence[str], start: int | None, stop: int | None
    ) -> tuple[list[FloatArray], FloatArray, float]:
        """Readings (n,) of channels that are sampled together, their times (n,) and their rate."""
        if not self._are_separate(names):
            first, last = _limits(start, stop, self.length)
            return self.reader.read(names, first, last), self.reader.time(first, last), self.sample_rate
        reader = self.reader
        device = next(device for device in self.devices if names[0] in device.channels)
        first, last = _limits(start, stop, device.length)
        return reader.read_device(names, first, last), reader.device_time(names[0], first, last), device.rate

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        """X and Y of `quantity`, from its channels at any two different angles.

        Parameters
        ----------
        quantity : str
            ``"displacement"``, ``"force"`` or ``"acceleration"``.
        start, stop : int, optional
            Samples, as in a Python slice; default all.

        Returns
        -------
        VectorRecord
            values (n, 2): solves ``[cos a_i, sin a_i] . (X, Y) = reading_i``; by least squares where there
            are more than two channels. NaN where fewer than two directions have a value.

        Raises
        ------
        RigDataError
            Fewer than two channels, all of them along one line, or the file cannot give them.

        Examples
        --------
        >>> ti.load_campaign(demo).run("d-05000-25-01").vector("displacement", 0, 100).values.shape
        (100, 2)
        """
        channels = self.vector_channels(quantity)
        names = tuple(c.name for c in channels)
        readings, time, rate = self._stretch(names, start, stop)
        return VectorRecord(quantity, np.ascontiguousarray(vector_rows(channels, readings).T), time, rate, names)

    def of(self, quantity: str) -> list[Channel]:
        """Channels that measure a quantity."""
        return [channel for channel in self.channels.values() if channel.quantity == quantity]

    def vector_channels(self, quantity: str) -> list[Channel]:
        """Channels that X and Y of a quantity come from; refused where they do not span the plane."""
        chosen = [c for c in self.of(quantity) if c.axis is not None]
        if len(chosen) < 2:
            fault = f"has {len(chosen)} channels, two are needed"
            remedy = f"Describe two {quantity} channels with different axes in the manifest"
            raise self._refuse(f"quantity {quantity}", fault, remedy)
        if np.isnan(inverse_directions(chosen)).any():
            names = ", ".join(c.name for c in chosen)
            remedy = "Two channels at different angles (3 deg apart or more) are needed; check their axis"
            raise self._refuse(f"channels {names}", "all measure along one line", remedy)
        return chosen

    def opened(self) -> AbstractContextManager[None]:
        """Keep the file open while the block runs, where its reader can do that; nested blocks share it."""
        return self.reader.opened()

    def mean_temperature(self) -> float | None:
        """Temperature of the run [K]: as stated, else the mean of its thermometers; None where there is neither."""
        if self.temperature is not None:
            return self.temperature
        means = []
        with suppress(RigDataError), self.opened():
            for channel in self.temperatures():
                with suppress(RigDataError):  # `check` tells
                    values = self.record(channel.name).values
                    means += [np.nanmean(values)] if np.isfinite(values).any() else []
        return float(np.mean(means)) if means else None

    def temperatures(self) -> tuple[Channel, ...]:
        """Temperature channels of this run, by pad and position."""
        return tuple(sorted(self.of("temperature"), key=lambda c: (c.pad or 0, c.position or 0.0, c.name)))

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None:
        """Read the shaft speed [rad/s], from pulses if need be; None where no channel measures it.

        Parameters
        ----------
        start : int or None, optional
            First sample; default the first of all.
        stop : int or None, optional
            Sample after the last; default the end.
        """
        tachometers, keyphasors = self.of("speed"), self.of("keyphasor")
        if tachometers:
            return self.record(tachometers[0].name, start, stop)
        if not keyphasors:
            return None
        pulses = self.record(keyphasors[0].name, start, stop)
        return replace(pulses, quantity="speed", values=speed_from_pulses(pulses.values, pulses.time))


def _limits(start: int | None, stop: int | None, length: int) -> tuple[int, int]:
    """First sample of a Python slice, and the one after its last."""
    first, last, _ = slice(start, stop).indices(length)
    return first, max(first, last)


def pulse_times(readings: FloatArray, time: FloatArray) -> FloatArray:
    """Times (m,) of the rising edges of once-per-revolution pulses [s], from readings and times (n,)."""
    finite = readings[np.isfinite(readings)]
    if len(finite) < 4:
        return np.empty(0)
    low, high = np.quantile(finite, (0.001, 0.999)).tolist()
    level = 0.5 * (low + high)
    # short dips in a pulse are none: the reading must have been low again
    filled = np.nan_to_num(readings, nan=low)
    side = (filled > level).astype(int) - (filled < low + 0.25 * (high - low))
    side = side[np.maximum.accumulate(np.where(side, np.arange(len(side)), 0))]
    at = np.flatnonzero((side[1:] > 0) & (side[:-1] <= 0))
    share = (level - readings[at]) / (readings[at + 1] - readings[at])
    return time[at] + share * (time[at + 1] - time[at])


def speed_from_pulses(readings: FloatArray, time: FloatArray) -> FloatArray:
    """Shaft speed at every sample (n,) [rad/s]; NaN where there are fewer than two pulses."""
    pulses = pulse_times(readings, time)
    if len(pulses) < 2:
        return np.full(len(readings), np.nan)
    return np.interp(time, 0.5 * (pulses[1:] + pulses[:-1]), 2 * np.pi / np.diff(pulses))
