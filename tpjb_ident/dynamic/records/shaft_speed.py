"""Shaft speed of a run: as a whole and window by window from its tachometer, and its course as the records show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.run_data import MeasuredRun

#: Samples from which the speed of the run is taken.
FIRST_LOOK = 2**17
#: A tachometer this far from the set point is not believed.
MAX_DEPARTURE = 0.05


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


def shaft_speed(run: MeasuredRun) -> tuple[float, tuple[Condition, ...]]:
    """Shaft speed of a run [Hz]: the tachometer's, or the set point where it gives nothing usable.

    Parameters
    ----------
    run : MeasuredRun
    """
    nominal = run.point.shaft_speed_hz
    record = run.speed(0, FIRST_LOOK)
    if record is None:
        return nominal, ()
    values = record.values[np.isfinite(record.values)]
    measured = float(values.mean()) / (2 * np.pi) if len(values) else np.nan
    if abs(measured - nominal) <= MAX_DEPARTURE * max(nominal, 1.0):
        return measured, ()
    return nominal, (
        Condition("tach off set point", f"tachometer says {measured:.4g} Hz, set point {nominal:g} Hz; set point used"),
    )


def window_speeds(speed: FloatArray | None, count: int, nominal: float) -> FloatArray:
    """Mean speed in `count` equal windows [Hz]; NaN where the tachometer gives nothing usable.

    Parameters
    ----------
    speed : (n,) ndarray or None
        Samples of the tachometer [rad/s], n a multiple of `count`.
    count : int
    nominal : float
        Set point [Hz].
    """
    if speed is None:
        return np.full(count, np.nan)
    # the mean of a window with a missing value is NaN, which is what it shall be
    speeds = speed.reshape(count, -1).mean(axis=1) / (2 * np.pi)
    believable = np.abs(np.nan_to_num(speeds) - nominal) <= MAX_DEPARTURE * max(nominal, 1.0)
    return np.where(believable, speeds, np.nan)
