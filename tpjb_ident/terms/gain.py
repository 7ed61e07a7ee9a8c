"""Gains of single sensors, as far as the manifest states their uncertainty: one number a sensor for the campaign."""

import itertools

import numpy as np

from rigdata.arrays import ComplexArray, IntArray
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import NO_GAIN, Factor, Parameter


class Gain(Factor):
    """Logarithm of a sensor's gain; two probes and two cells tell nothing of it, a third probe the differences."""

    name = "calibration"
    contradiction = "probe-gains-differ"
    gross = NO_GAIN
    sentence = "{p.name} reads {value:+.2f} % (standard error {error:.2f} %)"
    scale = 100.0

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        table = [rig.off.get((run, sensor.name), 0.0) for run, sensor in itertools.product(blocks.runs, rig.channels)]
        #: (runs, m): deviation of a gain that is another one in a run
        self._off = np.reshape(table, (len(blocks.runs), len(rig)))
        self._places: list[tuple[int, int, int]] = []
        parameters, never = [], []
        for j, sensor in enumerate(rig.channels):
            calibrations = np.unique(blocks.calibration[:, j]).tolist() or [0]
            points, off = self._point(blocks, j), self._off[blocks.run, j]
            deviations = {-1: 0.0} | {p: float(off[points == p].max()) for p in dict.fromkeys(points.tolist())}
            for k in calibrations:
                name = sensor.name if len(calibrations) == 1 else f"{sensor.name}, calibration {k + 1}"
                for point, deviation in deviations.items():
                    if sensor.uncertainty or deviation:
                        self._places.append((j, k, point))
                        words = name if point < 0 else f"{name}, at {blocks.points[point]}"
                        size = float(np.hypot(sensor.uncertainty or 0.0, deviation))
                        # what the housing's equations leave out is no evidence: gains are held against gains
                        parameters.append(Parameter(words, "1", size, harmless=0.0 if rig.spare[j] else np.inf))
                        never.append(not rig.spare[j] and name == words == sensor.name)
        self.parameters, self.never_estimated = tuple(parameters), np.array(never, dtype=bool)

    def _point(self, blocks: Blocks, j: int) -> IntArray:
        """Of every block the point, if a sensor's gain is another one in its run; -1: it is not, (n,)."""
        return np.where(self._off[blocks.run, j] > 0, blocks.point, -1)

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """One in the sensor's own row, in the runs of that calibration."""
        exponent = np.zeros((*blocks.z.shape, len(self._places)), complex)
        for q, (j, k, point) in enumerate(self._places):
            exponent[:, j, q] = (blocks.calibration[:, j] == k) & (self._point(blocks, j) == point)
        return exponent
