"""Drift of probes' gains with temperature, as far as the manifest states how well their coefficients are known."""

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Fitted, Parameter, exceeding

#: Parts in a thousand per kelvin, the unit of a coefficient in the solve.
_UNIT = 1e-3


class Temperature(Factor):
    """A sensor reads more by its coefficient for every kelvin away from the reference."""

    name = "temperature"
    sentence = "{p.name} reads {value:+.3f} % more per K (standard error {error:.3f} %)"
    scale = 0.1

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        measured = np.isfinite(blocks.temperature)
        self._reference = float(blocks.temperature[measured].mean()) if measured.any() else 0.0
        uncertain = [j for j, sensor in enumerate(rig.channels) if sensor.temperature_coefficient_uncertainty]
        rows = uncertain if measured.any() else []
        self.sensors = np.eye(len(rig))[:, rows]
        self.parameters = tuple(
            Parameter(rig.channels[j].name, "1e-3/K", rig.channels[j].temperature_coefficient_uncertainty / _UNIT)
            for j in rows
        )

    def rate(self, blocks: Blocks) -> FloatArray:
        """Thousandths per kelvin away from the reference."""
        return _UNIT * np.nan_to_num(blocks.temperature - self._reference)

    def conditions(self, fitted: Fitted) -> Conditions:
        """Drifts beyond what is stated."""
        return holding((exceeding(fitted, self.parameters), "probes-drift", "; ".join(self.words(fitted))))
