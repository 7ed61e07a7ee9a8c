"""The channels of a run by the devices that recorded them, read stretch by stretch at each device's own times."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.run import Run
from tpjb_ident.phasors.run_data import QUANTITIES


@dataclass(frozen=True)
class DeviceChannels:
    """Channels of one device: one rate, one row of times."""

    name: str
    channels: tuple[Channel, ...]  #: with a direction, of displacement, force, acceleration in this order
    tachometer: Channel | None
    rate: float
    length: int

    @property
    def groups(self) -> list[slice]:
        """Channels of one quantity: so few stay in a core's cache while they are fitted."""
        quantities = [c.quantity for c in self.channels]
        groups, first = [], 0
        for _, members in itertools.groupby(quantities):
            count = len(list(members))
            groups.append(slice(first, first + count))
            first += count
        return groups


@dataclass(frozen=True)
class Samples:
    """Consecutive samples of a device."""

    rows: FloatArray  #: (n_channels, n), SI; NaN where there is no value
    time: FloatArray | None  #: (n,), s; None where times are counted from the rate
    speed: FloatArray | None  #: (n,), rad/s, by tachometer


def vector_channels_of(run: Run) -> tuple[Channel, ...]:
    """Channels with a direction; refused where a quantity's do not span the plane."""
    directed = [c for c in run.channels.values() if c.axis is not None]
    for quantity in QUANTITIES:
        if quantity != "acceleration" or any(c.quantity == quantity for c in run.channels.values()):
            run.vector(quantity, 0, 0)  # says what is missing
    return tuple(c for quantity in QUANTITIES for c in directed if c.quantity == quantity)


class ChannelReader:
    """Reads the channels of a run device by device."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.channels = vector_channels_of(run)
        tachometers = [c for c in run.channels.values() if c.quantity == "speed"]
        tachometer = tachometers[0] if tachometers else None
        self.devices = (DeviceChannels("", self.channels, tachometer, run.sample_rate, run.length),)
        counted = getattr(run.reader, "counted", None)
        self._counted = counted is not None and counted()

    def read(self, device: DeviceChannels, start: int, stop: int) -> Samples:
        """Samples start..stop-1 of a device."""
        wanted = [*device.channels, *([] if device.tachometer is None else [device.tachometer])]
        readings = self._run.reader.read([c.name for c in wanted], start, stop)
        values = [channel.to_si(reading) for channel, reading in zip(wanted, readings, strict=True)]
        speed = None if device.tachometer is None else values.pop()
        time = None if self._counted else self._run.reader.time(start, stop)
        return Samples(np.array(values), time, speed)
