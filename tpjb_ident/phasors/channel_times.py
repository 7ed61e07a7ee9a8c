"""The channels of a run by the devices that recorded them, read stretch by stretch at each device's own times."""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.calibration import Channel
from rigdata.device import Device
from rigdata.run import Run
from tpjb_ident.phasors.run_data import QUANTITIES


@dataclass(frozen=True)
class Samples:
    """Consecutive samples of a device."""

    rows: FloatArray  #: (n_channels, n), SI; NaN where there is no value
    time: FloatArray | None  #: (n,), s; None where times are counted from the rate


@dataclass(frozen=True)
class DeviceReader:
    """Channels of one device: one rate, one row of times."""

    run: Run
    device: Device
    channels: tuple[Channel, ...]  #: of displacement, force, acceleration, command in this order
    rate: float
    length: int

    def read(self, start: int, stop: int) -> Samples:
        """Samples start..stop-1."""
        time, rows = self.run.read_device(self.device, [c.name for c in self.channels], start, stop)
        return Samples(rows, time)

    def first_samples(self, start: FloatArray) -> IntArray:
        """First sample at or after each of some times (n,) [s]."""
        if self.device.counted:
            return np.ceil(start * self.rate - 1e-6).astype(int)
        time, _ = self.run.read_device(self.device, [self.channels[0].name], 0, self.length)
        return np.searchsorted(np.asarray(time), start - 1e-6 / self.rate)


def device_readers(run: Run, command: bool = False) -> tuple[DeviceReader, ...]:
    """Devices of a run that have channels with a direction, or a command if asked; that of the first probe first."""
    _check_directions(run)
    directed = {c.name: c for q in QUANTITIES for c in run.channels.values() if c.quantity == q and c.axis is not None}
    if command:
        directed |= {c.name: c for c in run.channels.values() if c.quantity == "command"}
    devices = run.devices
    for name in directed.keys() - {name for device in devices for name in device.channels}:
        run.record(name, 0, 0)  # says that the file lacks it
    readers = []
    for device in devices:
        channels = tuple(c for name, c in directed.items() if name in device.channels)
        rate = device.rate if np.isfinite(device.rate) else run.sample_rate
        # of a run that ends early all devices do
        length = min(device.length, int(np.ceil(run.length / run.sample_rate * rate)))
        if channels:
            readers.append(DeviceReader(run, device, channels, rate, length))
    return tuple(readers)


def _check_directions(run: Run) -> None:
    """Refuse a run whose channels of a quantity do not span the plane."""
    for quantity in QUANTITIES:
        if quantity != "acceleration" or run.of(quantity):
            run.vector_channels(quantity)
