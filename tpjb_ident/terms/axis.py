"""Angles of the sensors' axes: one number a sensor whose angle is uncertain, or that others can be held against."""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Conditions
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import Additive, Fitted, Parameter, differing

#: Deviation of an axis that nobody doubts, where others tell it [rad].
_SURE = 2e-4


class Axis(Additive):
    """A sensor turned by an angle reads its share of the motion across its stated axis."""

    name = "axis"
    tested = True
    harmless = 2e-3

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        least = np.zeros(len(rig))
        least[rig.spare] = _SURE
        deviations = [sensor.axis_uncertainty or size for sensor, size in zip(rig.channels, least.tolist())]
        self._rows = [j for j, deviation in enumerate(deviations) if deviation]
        self.parameters = tuple(Parameter(rig.channels[j].name, "rad", deviations[j]) for j in self._rows)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """What the sensors would read across their axes, (-sin, cos) times the vector that they measure."""
        columns = self.no_columns(blocks)
        across = np.stack([-blocks.along[:, :, 1], blocks.along[:, :, 0]], axis=2)
        turned = state.reading(self.rig, replace(blocks, along=across))
        columns[:, self._rows, np.arange(self.width)] = turned[:, self._rows]
        return columns

    def conditions(self, fitted: Fitted) -> Conditions:
        """Sensors that others of their quantity contradict."""
        places = self.contradicted(fitted)
        turns = [f"{self.parameters[k].name} by {np.degrees(fitted.value[k]):+.1f} deg" for k in places]
        text = f"as if axes stood elsewhere than stated: {', '.join(turns)}"
        return differing(self.farthest(fitted, places), text) if places else ()
