"""The shaft's tilt: probes beside the bearing's middle plane read its rotation times their distance from there.

Every block has a tilt of its own, about X and about Y: a random effect, wide beside what two planes of probes tell.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import Term

#: Rotation over displacement [1/m], one standard deviation: a shaft that turns about a point 0.3 m from the bearing.
_USUAL = 3.0


class Tilt(Term):
    """Two complex numbers a block, where the manifest states two planes of probes."""

    name = "tilt"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._plane = rig.levers

    def random_effects(self, blocks: Blocks, state: State) -> ComplexArray | None:
        """Plane times axis, in the probes."""
        if not self._plane.any():
            return None
        m = blocks.z.shape[1]
        size = _USUAL * np.linalg.norm(state.u[:, :2], axis=1)
        effects = np.zeros((*state.shift.shape, 2), complex)
        effects[:, :m] = size[:, None, None] * self._plane[:, None] * blocks.along * blocks.present[:, :, None]
        return effects
