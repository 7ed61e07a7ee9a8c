"""The housing's mass, as far as the manifest states its uncertainty: it weighs the inertia in the cells' force."""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, force_rows, with_factor
from tpjb_ident.estimate.term import Additive, Parameter


class Mass(Additive):
    """Relative error of the housing's mass."""

    name = "mass"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        if rig.mass_uncertainty and rig.mass:
            self.parameters = (Parameter("housing", "1", rig.mass_uncertainty / rig.mass),)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """-m a in the cells."""
        inertia = -self.rig.mass * state.u[:, 2:]
        return np.asarray(with_factor(state.factor, force_rows(self.rig, blocks, inertia[:, :, None])))
