"""Delays of devices against one another, as far as the manifest states them: one number a device.

Sensors of one clock share a device; without a clock each has a delay of its own, as behind a multiplexer. The housing's
equations tell cells from accelerometers (a spring knows no phase); probes against cells only a film of known form would
tell.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import NO_GAIN, OUT_OF_STEP, Factor, Fitted, Parameter

_MILLISECOND = 1e-3
#: Deviation of a delay that nobody doubts, where others tell it [s], and of one that does no harm [ms].
_SURE, _HARMLESS = 1e-6, 0.01
#: Stated deviations beyond which a device is later than stated.
_BEYOND = 3.0
#: Standard errors and phase [rad] from which cells come late, and not the accelerometers early.
_CLEAR, _NOTABLE = 2.0, 0.02


class Delay(Factor):
    """A sensor that comes later by tau reads exp(-i omega tau) times the truth."""

    name = "delay"
    contradiction = "probe-gains-differ"
    sentence = "{p.name} late by {value:.3g} ms (standard error {error:.2g} ms)"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._omega = blocks.usual_omega
        self.gross = NO_GAIN / self._omega / _MILLISECOND
        devices = np.array([sensor.clock or sensor.name for sensor in rig.channels])
        deviation = np.maximum([sensor.delay_uncertainty for sensor in rig.channels], _SURE * rig.spare)
        names = list(dict.fromkeys(devices[deviation > 0].tolist()))
        self.sensors = ((devices[:, None] == np.array(names, dtype=str)) & (deviation[:, None] > 0)).astype(float)
        largest = (self.sensors * deviation[:, None]).max(axis=0) / _MILLISECOND
        # the housing's equations tell of cells and accelerometers only what its own test makes of them
        self._among = self.sensors[rig.spare].any(axis=0)
        harmless = np.where(self._among, _HARMLESS, np.inf).tolist()
        rows = zip(names, largest.tolist(), harmless)
        self.parameters = tuple(Parameter(name, "ms", size, harmless=least) for name, size, least in rows)

    def rate(self, blocks: Blocks) -> ComplexArray:
        """-i omega, per ms."""
        return np.asarray(-1j * _MILLISECOND * blocks.omega)

    def conditions(self, fitted: Fitted) -> Conditions:
        """Devices that are later than stated; cells that come late where accelerometers showed them out of step."""
        said = super().conditions(fitted)
        stated = np.array([parameter.deviation for parameter in self.parameters])
        clear = _CLEAR * fitted.deviation if self.rig.out_of_step else _BEYOND * stated
        late = np.abs(fitted.value) > np.maximum(clear, _NOTABLE / _MILLISECOND / self._omega)
        if not np.any(late & ~self._among):
            return said
        if not self.rig.out_of_step:
            return (*said, Condition(OUT_OF_STEP, "; ".join(self.words(fitted))))
        shown = [c for c in sum(self.rig.contradicted.values(), ()) if c == OUT_OF_STEP]
        return (*shown, *said)
