"""Low corner of charge amplifiers and capacitor-coupled inputs: what leaks away leads the truth by corner over f.

Data sheets put it at some tenths of a hertz up to a few (charge amplifiers 0.001 to 1 Hz, inputs coupled by a capacitor
0.5 to 3.4 Hz). Cells that show no static force have one: K times their lead goes into C. Accelerometers are asked for
theirs where they lead what the springs make of the cells' force; over frequencies it falls, as no delay does. Cells
never lag by a corner: where they seem to, the accelerometers lead. Probes that show no mean in any run have one too.
"""

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.term import OUT_OF_STEP, Factor, Fitted, Parameter

#: Standard errors from which a corner is negative.
_CLEAR = 2.5


class Corner(Factor):
    """One corner f_c of all sensors of a quantity whose filter is not stated: they read 1 / (1 - i f_c / f) of it."""

    name = "corner"
    sentence = "the {p.name}' low corner is {value:.2g} Hz (standard error {error:.2g} Hz)"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self.sensors = np.zeros((len(rig), 0))
        asked = {"cells": ("force", not rig.static), "accelerometers": ("acceleration", rig.out_of_step)}
        asked["probes"] = ("displacement", True)  # some are doubted
        for name, (quantity, applies) in asked.items():
            uncertain = np.array([s.corner_uncertainty * (s.quantity == quantity) for s in rig.channels])
            if uncertain.any() and applies:
                self.sensors = np.column_stack([self.sensors, uncertain > 0])
                self.parameters += (Parameter(name, "Hz", float(uncertain[uncertain > 0][0])),)

    def rate(self, blocks: Blocks) -> ComplexArray:
        """I / f, per Hz."""
        return np.asarray(2j * np.pi / blocks.omega)

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """The high pass itself: its gain falls by half the square of the lead."""
        state.factor /= 1 - self.exponent(blocks) @ value

    def learnt(self, rig: Rig, solution: Solution) -> Rig:
        """Accelerometers asked for theirs where the cells' is negative."""
        if rig.out_of_step or [p.name for p in self.parameters] != ["cells"] or not rig.pick("acceleration"):
            return rig
        fitted = solution.fitted[self.name]
        return replace(rig, out_of_step=True) if fitted.value[0] < -fitted.deviation[0] else rig

    def conditions(self, fitted: Fitted) -> Conditions:
        """Accelerometers whose corner would have to be negative: something else turns them, no filter does."""
        text = "the accelerometers lag the more the lower the frequency, as no filter lets them: other sensors are late"
        for parameter, value, error in zip(self.parameters, fitted.value, fitted.deviation):
            if parameter.name == "accelerometers" and value < -_CLEAR * error:
                return (Condition(OUT_OF_STEP, text),)
        return ()
