"""Angles of the sensors' axes, as far as the manifest states their uncertainty: one number a sensor."""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State
from tpjb_ident.estimate.term import Additive, Parameter


class Axis(Additive):
    """A sensor turned by an angle reads its share of the motion across its stated axis."""

    name = "axis"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._rows = [j for j, sensor in enumerate(rig.sensors) if sensor.axis_uncertainty]
        self.parameters = tuple(
            Parameter(rig.sensors[j].name, "rad", rig.sensors[j].axis_uncertainty) for j in self._rows
        )

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """(-sin, cos) times the vector that the sensor measures."""
        columns = self.no_columns(blocks)
        force = state.cell_force(self.rig, blocks)
        vectors = {"displacement": state.u[:, :2], "force": force, "acceleration": state.u[:, 2:]}
        for k, j in enumerate(self._rows):
            across = np.stack([-blocks.along[:, j, 1], blocks.along[:, j, 0]], axis=1)
            measured = vectors[self.rig.sensors[j].quantity]
            columns[:, j, k] = state.factor[:, j] * np.einsum("na,na->n", across, measured) * blocks.present[:, j]
        return columns
