"""The shaft's speed over a run, as the records show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray


@dataclass(frozen=True)
class ShaftCourse:
    """Shaft speed over a run, whatever windows it was found in: a second fit may cut the run otherwise.

    Attributes
    ----------
    time : (n,) ndarray
        Middle of the windows in which it was found [s].
    speed : (n,) ndarray
        [Hz]; finite.
    """

    time: FloatArray
    speed: FloatArray

    def at(self, time: FloatArray) -> FloatArray:
        """Speed at `time` (m,) [s], [Hz].

        Parameters
        ----------
        time : (n,) ndarray
            [s]
        """
        return np.interp(time, self.time, self.speed)
