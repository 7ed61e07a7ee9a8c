"""Delays of devices against one another, as far as the manifest states them: one number a device.

Sensors of one clock share a device; without a clock each has a delay of its own, as behind a multiplexer. The housing's
equations tell cells from accelerometers (a spring knows no phase); probes against cells only a film of known form would
tell.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Conditions
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import NO_GAIN, OUT_OF_STEP, Factor, Fitted, Parameter

_MILLISECOND = 1e-3
#: Deviation of a delay that nobody doubts, where others tell it [s], and of one that does no harm [ms].
_SURE, _HARMLESS = 1e-6, 0.01
#: Standard errors and phase [rad] from which cells come late, and not the accelerometers early.
_CLEAR, _NOTABLE = 2.0, 0.02


class Delay(Factor):
    """A sensor that comes later by tau reads exp(-i omega tau) times the truth."""

    name = "delay"
    contradiction = OUT_OF_STEP
    sentence = "{p.name} late by {value:.3g} ms (standard error {error:.2g} ms)"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._omega = blocks.usual_omega
        devices = np.array([sensor.clock or sensor.name for sensor in rig.channels])
        deviation = np.maximum([sensor.delay_uncertainty for sensor in rig.channels], _SURE * rig.spare)
        names = list(dict.fromkeys(devices[deviation > 0].tolist()))
        self.sensors = ((devices[:, None] == np.array(names, dtype=str)) & (deviation[:, None] > 0)).astype(float)
        largest = (self.sensors * deviation[:, None]).max(axis=0) / _MILLISECOND
        sizes = zip(names, largest.tolist())
        self.parameters = tuple(Parameter(name, "ms", size, harmless=_HARMLESS) for name, size in sizes)
        among = np.asarray(self.sensors[rig.pick("displacement")].any(axis=0))
        self._wide = wide = np.array([(self.name, name) in rig.widened for name in names], dtype=bool)
        if wide.any() and among[wide].all():  # probes against probes
            self.contradiction, self.gross = "probe-gains-differ", NO_GAIN / self._omega / _MILLISECOND

    def rate(self, blocks: Blocks) -> ComplexArray:
        """-i omega, per ms."""
        return np.asarray(-1j * _MILLISECOND * blocks.omega)

    def conditions(self, fitted: Fitted) -> Conditions:
        """Devices that are later than stated; cells that come late where accelerometers showed them out of step."""
        said = super().conditions(fitted)
        if self.rig.out_of_step:
            late = np.abs(fitted.value) > np.maximum(_CLEAR * fitted.deviation, _NOTABLE / _MILLISECOND / self._omega)
            known = (condition for conditions in self.rig.contradicted.values() for condition in conditions)
            out_of_step = (condition for condition in known if condition == OUT_OF_STEP)
            return (*(out_of_step if np.any(late & ~self._wide) else ()), *said)
        return said
