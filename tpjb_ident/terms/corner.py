"""Low corner of cells that show no static force: charge leaks away, and what leaks leads the force by corner over f.

Data sheets put the corner at some tenths of a hertz (charge amplifiers 0.001 to 1 Hz, inputs coupled by a capacitor 0.5
to 0.7 Hz): K times that lead goes into C. The housing's equations tell it from a loss in the springs, which does not
fall with frequency.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State
from tpjb_ident.estimate.term import Factor, Parameter

#: Plausible corner where none is stated, one standard deviation [Hz].
_CORNER = 0.5


class Corner(Factor):
    """One corner f_c of all cells whose filter is not stated: they read 1 / (1 - i f_c / f) times the truth."""

    name = "corner"
    sentence = "the cells' low corner is {value:.2g} Hz (standard error {error:.2g} Hz)"

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        self._cells = [j for j in rig.of("force") if not rig.static and not rig.sensors[j].corner_stated]
        if self._cells:
            self.parameters = (Parameter("cells", "Hz", _CORNER),)

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """I / f in the cells' rows, per Hz."""
        exponent = np.zeros((*blocks.z.shape, 1), complex)
        exponent[:, self._cells, 0] = 2j * np.pi / blocks.omega[:, None]
        return exponent

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """The high pass itself: its gain falls by half the square of the lead."""
        state.factor /= 1 - self.exponent(blocks) @ value
