"""Angles of the sensors' axes, as far as the manifest states their uncertainty: one number a sensor."""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import Additive, Parameter


class Axis(Additive):
    """A sensor turned by an angle reads its share of the motion across its stated axis."""

    name = "axis"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._rows = [j for j, sensor in enumerate(rig.channels) if sensor.axis_uncertainty]
        self.parameters = tuple(
            Parameter(rig.channels[j].name, "rad", rig.channels[j].axis_uncertainty) for j in self._rows
        )

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """What the sensors would read across their axes, (-sin, cos) times the vector that they measure."""
        columns = self.no_columns(blocks)
        across = np.stack([-blocks.along[:, :, 1], blocks.along[:, :, 0]], axis=2)
        turned = state.reading(self.rig, replace(blocks, along=across))
        columns[:, self._rows, np.arange(self.width)] = turned[:, self._rows]
        return columns
