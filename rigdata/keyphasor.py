"""Shaft speed from once-per-revolution pulses."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import FloatArray


def pulse_times(readings: FloatArray, time: FloatArray) -> FloatArray:
    """Times of the rising edges of once-per-revolution pulses [s], (m,).

    Parameters
    ----------
    readings : (n,) ndarray
        Of the pulse channel; its level is half way between its usual extremes.
    time : (n,) ndarray
        [s]
    """
    known = readings[np.isfinite(readings)]
    if len(known) < 4:
        return np.empty(0)
    low, high = (float(q) for q in np.quantile(known, (0.001, 0.999)))
    level = 0.5 * (low + high)
    above = np.nan_to_num(readings, nan=low) > level
    # short dips in a pulse are none: the reading must have been low again
    armed = np.nan_to_num(readings, nan=low) < low + 0.25 * (high - low)
    rising = np.flatnonzero(above[1:] & ~above[:-1])
    kept, last = [], -1
    for k in rising:
        if last < 0 or armed[last : k + 1].any():
            kept.append(int(k))
            last = int(k) + 1
    at = np.array(kept, dtype=int)
    share = (level - readings[at]) / (readings[at + 1] - readings[at])
    return np.asarray(time[at] + share * (time[at + 1] - time[at]))


def speed_from_pulses(readings: FloatArray, time: FloatArray) -> FloatArray:
    """Shaft speed at every sample [rad/s]; NaN where fewer than two pulses tell it.

    Parameters
    ----------
    readings : (n,) ndarray
        Of the pulse channel.
    time : (n,) ndarray
        [s]
    """
    pulses = pulse_times(readings, time)
    if len(pulses) < 2:
        return np.full(len(readings), np.nan)
    speeds = 2 * np.pi / np.diff(pulses)
    return np.asarray(np.interp(time, 0.5 * (pulses[1:] + pulses[:-1]), speeds))
