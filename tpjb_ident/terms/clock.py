"""Clocks of further devices: their rates against the first device's, told by how phases turn within the records.

A clock exists between devices only. Whatever phases do within one device, its clock is one.
"""

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Fitted, Parameter

#: Devices with clocks of their own start together to half a sample at best; as a standard deviation of samples.
START = 1 / np.sqrt(12)
#: 100 ppm, the unit of a rate in the solve.
_UNIT = 1e-4
#: Rates of quartz clocks against one another, one standard deviation [100 ppm]; worse ones are estimated all the same.
_QUARTZ = 5.0
#: A rate is worth saying from so many standard errors on.
_CLEAR = 6.0


class Clock(Factor):
    """A clock that runs fast by e reads exp(-i omega e t) times the truth, t from the start of the record."""

    name = "clock"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        devices = list(dict.fromkeys(sensor.clock for sensor in rig.channels))[1:]
        self._devices = devices
        self._taken_off = np.array([rig.rates.get(device, 0.0) for device in devices])
        self.parameters = tuple(Parameter(device or "records", "100 ppm", _QUARTZ) for device in devices)
        turns = []
        for sensor in rig.channels:
            turns.append([sensor.clock == device for device in devices])
        self.sensors = np.array(turns, dtype=float)

    def rates(self, value: FloatArray) -> dict[str, float]:
        """Rates by device, relative."""
        return {device: _UNIT * float(rate) for device, rate in zip(self._devices, value)}

    def rate(self, blocks: Blocks) -> ComplexArray:
        """-i omega t, per 100 ppm."""
        return np.asarray(-1j * _UNIT * blocks.omega * blocks.time)

    def slope_columns(self, blocks: Blocks, reading: ComplexArray) -> ComplexArray:
        """-i omega times the reading, per 100 ppm."""
        turned = -1j * _UNIT * blocks.omega[:, None] * reading
        return turned[:, :, None] * self.sensors

    def conditions(self, fitted: Fitted) -> Conditions:
        """Rates that stand clear of their errors."""
        clear = np.abs(self._total(fitted)) > _CLEAR * fitted.deviation
        rates = ", ".join(self.words(fitted))
        text = f"against the first device's clock: {rates}; put right from the start of each record"
        return holding((clear.any(), "clocks-differ", text))

    def words(self, fitted: Fitted) -> tuple[str, ...]:
        """Rates in ppm."""
        rates = self._total(fitted)
        return tuple(
            f"{p.name} {100 * rates[k]:+.1f} ppm (standard error {100 * fitted.deviation[k]:.1f})"
            for k, p in enumerate(self.parameters)
        )

    def _total(self, fitted: Fitted) -> FloatArray:
        return fitted.value + self._taken_off / _UNIT
