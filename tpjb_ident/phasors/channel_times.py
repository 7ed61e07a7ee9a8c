"""The channels of a run by the devices that recorded them, read stretch by stretch at each device's own times."""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.calibration import Channel
from rigdata.device import Device
from rigdata.run import Run
from tpjb_ident.phasors.run_data import QUANTITIES


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
    for quantity in QUANTITIES:
        if quantity != "acceleration" or run.of(quantity):
            directed += run.vector_channels(quantity)
    if command:
        directed += run.of("command")
    recorded = {name for device in run.devices for name in device.channels}
    for channel in directed:
        if channel.name not in recorded:
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
