"""Angles of the sensors' axes: one number a sensor whose angle is uncertain, or that others can be held against."""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import NO_GAIN, Additive, Parameter

#: Deviation of an axis that nobody doubts, where others tell it, and of one that does no harm [rad].
_SURE, _HARMLESS = 2e-4, 2e-3


class Axis(Additive):
    """A sensor turned by an angle reads its share of the motion across its stated axis."""

    name = "axis"
    contradiction = "probe-gains-differ"
    gross = NO_GAIN
    sentence = "{p.name} stands {value:+.2f} deg from its axis (standard error {error:.2f} deg)"
    scale = 180 / np.pi

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        stated = np.array([sensor.axis_uncertainty for sensor in rig.channels])
        deviations = np.maximum(stated, _SURE * rig.spare)
        self._rows = np.flatnonzero(deviations)
        harmless = np.where(rig.spare, _HARMLESS, np.inf).tolist()
        self.parameters = tuple(
            Parameter(rig.channels[j].name, "rad", float(deviations[j]), harmless=harmless[j]) for j in self._rows
        )

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """What the sensors would read across their axes, (-sin, cos) times the vector that they measure."""
        columns = self.no_columns(blocks)
        across = np.stack([-blocks.along[:, :, 1], blocks.along[:, :, 0]], axis=2)
        turned = state.reading(self.rig, replace(blocks, along=across))
        columns[:, self._rows, np.arange(self.width)] = turned[:, self._rows]
        return columns
