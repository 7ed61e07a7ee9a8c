"""Tilt: sensors beside the bearing's middle plane read a rotation times their distance from there.

Every block has tilts of its own, about X and about Y, one of the shaft beside the housing in the probes, others in
cells and accelerometers where more than two of these tell it: random effects, wide beside what two planes tell.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.calibration import VECTOR_QUANTITIES
from rigdata.vector import levers
from tpjb_ident.estimate.equation import Blocks, State, vector
from tpjb_ident.estimate.term import Term

#: Rotation over displacement [1/m], one standard deviation: a shaft that turns about a point 0.3 m from the bearing.
_USUAL = 3.0


class Tilt(Term):
    """Two complex numbers a block and quantity, where the manifest states two planes of sensors."""

    name = "tilt"

    def random_effects(self, blocks: Blocks, state: State) -> ComplexArray | None:
        """Plane times axis, in the sensors of each quantity."""
        patterns = []
        for quantity in VECTOR_QUANTITIES:
            rows = self.rig.pick(quantity)
            planes = levers([self.rig.channels[j] for j in rows])
            if planes.any() and (len(rows) > 2 or quantity == "displacement"):
                size = _USUAL * np.linalg.norm(np.nan_to_num(vector(self.rig, blocks, quantity)), axis=1)
                lever = size[:, None] * planes * blocks.present[:, rows]
                pattern = np.zeros((*state.shift.shape, 2), complex)
                pattern[:, rows] = lever[:, :, None] * blocks.along[:, rows]
                patterns.append(pattern)
        return np.concatenate(patterns, axis=-1) if patterns else None
