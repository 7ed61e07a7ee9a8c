"""Drift of probes' gains with temperature, as far as the manifest states how well their coefficients are known."""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Parameter

#: Parts in a thousand per kelvin, the unit of a coefficient in the solve.
_UNIT = 1e-3


class Temperature(Factor):
    """A sensor reads more by its coefficient for every kelvin away from its reference, or from the runs' mean."""

    name = "temperature"
    contradiction = "probes-drift"
    sentence = "{p.name} reads {value:+.3f} % more per K (standard error {error:.3f} %)"
    scale = 0.1

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        measured = np.isfinite(blocks.temperature)
        mean = float(blocks.temperature[measured].mean()) if measured.any() else 0.0
        uncertain = [j for j, sensor in enumerate(rig.channels) if sensor.temperature_coefficient_uncertainty]
        rows = uncertain if measured.any() else []
        stated = [rig.channels[j].temperature_reference for j in rows]
        self._reference = np.array([mean if kelvins is None else kelvins for kelvins in stated])
        self.sensors = np.eye(len(rig))[:, rows]
        self.parameters = tuple(
            Parameter(rig.channels[j].name, "1e-3/K", rig.channels[j].temperature_coefficient_uncertainty / _UNIT)
            for j in rows
        )

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """Thousandths per kelvin away from the reference."""
        away = np.nan_to_num(blocks.temperature[:, None] - self._reference)
        return np.asarray(_UNIT * away[:, None] * self.sensors, complex)
