"""What turns with the shaft where the drive does so too: runout in the probes, unbalance in the cells.

Such a vector has the drive's frequency and is the same in all runs of a point but for the shaft's phase. Runs whose
drive stands otherwise against the shaft tell it from the motion.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import Additive, Parameter

#: Name of the condition where it was told apart.
SHAFT_FITTED = "shaft lines fitted"
#: Runs that tell H and what turns with the shaft: three unknowns for each force.
_MIN_RUNS = 3
#: Condition number of the motions, without what follows the shaft, from which errors are strongly amplified.
_ILL_CONDITIONED = 30.0
#: A priori a sensor's own vector may be so many times its reading: nothing is known of it.
_WIDE = 10.0


class Shaft(Additive):
    """Real and imaginary part of one vector a sensor and point, in units of the sensor's usual reading there."""

    name = "shaft"
    always_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        on_line = np.isfinite(blocks.shaft)
        self.points = tuple(np.unique(blocks.point[on_line]).tolist())
        self._size = np.zeros((len(blocks.points), len(rig)))
        parameters = []
        for point in self.points:
            self._size[point] = np.median(np.abs(blocks.z[blocks.point == point]), axis=0) + 1e-300
            for sensor in rig.channels:
                names = f"{sensor.name} at {blocks.points[point].excitation_hz:g} Hz"
                parameters += [Parameter(f"{names}, {part}", "1", _WIDE) for part in ("re", "im")]
        self.parameters = tuple(parameters)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """The shaft's unit phasor, in the sensor's own row."""
        columns = self.no_columns(blocks)
        sensors = np.arange(len(self.rig))
        vector = np.nan_to_num(blocks.shaft)[:, None] * self._size[blocks.point] * blocks.present
        columns[:, sensors, 2 * sensors], columns[:, sensors, 2 * sensors + 1] = vector, 1j * vector
        return columns


def not_told(order: int, phasors: ComplexArray, motion: ComplexArray) -> str:
    """Why runs do not tell what turns with the shaft from the motion; "" where they do.

    `phasors` (g,): the shaft's unit phasor in every run, NaN where not known; `motion` (g, 2) [m].
    """
    if not np.isfinite(phasors).all():
        if order == 1:
            return "no keyphasor tells the shaft's phase, or the drive is not locked to it. Record one"
        return "neither a keyphasor nor a steady 1X line tells the shaft's phase. Record a keyphasor"
    if len(phasors) < _MIN_RUNS:
        return f"{len(phasors)} runs; excite in {_MIN_RUNS} directions at least"
    if not np.isfinite(motion).all():
        return "a run has no usable window"
    combine = np.linalg.svd(phasors[None, :])[2][1:].conj()
    condition = np.linalg.cond(combine @ motion)
    if condition < _ILL_CONDITIONED:
        return ""
    return (
        f"the runs' motions follow the shaft's phase alike (condition number {condition:.0f}). Repeat them with the "
        "drive half a turn later against the shaft, or with another amplitude, or in directions over the whole turn"
    )
