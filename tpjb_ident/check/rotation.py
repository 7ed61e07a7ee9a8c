"""How fast the shaft really turned: set points are missed by a little, and a line looked for beside its place leaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray

#: The speed is looked for within this share of the stated one; the check of the speed channel warns from there on.
_WITHIN = 0.03
#: Nearer to another line than this, a speed cannot be found [1 / record length].
_APART = 3.0
#: A line must stand this many times over the median amplitude around it.
_CLEAR = 8.0
#: Longest stretch looked at: its resolution is fine enough for any record [samples].
_LONGEST = 2**16


def turning_frequency(time: FloatArray, values: FloatArray, stated: float, lines: Sequence[float]) -> float:
    """Frequency of the 1X line [Hz], from the peak of a Hann spectrum summed over the channels.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, nearly equidistant.
    values : (n, m) ndarray
        Displacements; NaN where missing.
    stated : float
        Set point [Hz].
    lines : sequence of float
        Other lines [Hz].

    Returns
    -------
    float
        The set point where no line stands out beside it, or another one hides it.
    """
    count = min(len(time), _LONGEST)
    span = float(time[count - 1] - time[0])
    known = np.isfinite(values[:count]).all(axis=0)
    if stated <= 0 or count < 64 or span <= 0 or not known.any() or stated * span < _APART:
        return stated
    padded = 4 * count
    step = (count - 1) / span / padded
    reach = max(_WITHIN * stated, 2.0 / span)
    reach = min([reach, *(abs(line - stated) - _APART / span for line in lines)])
    low, high = int(np.ceil((stated - reach) / step)), int((stated + reach) / step)
    if reach <= 0 or low < 1 or high - low < 4:
        return stated
    columns = values[:count, known]
    spectrum = np.abs(np.fft.rfft((columns - columns.mean(axis=0)) * np.hanning(count)[:, None], padded, axis=0))
    wide = slice(max(1, low - 40), min(high + 40, len(spectrum)))
    level = np.median(spectrum[wide], axis=0)
    power = np.mean((spectrum / np.maximum(level, 1e-300)) ** 2, axis=1)
    peak = low + int(np.argmax(power[low : high + 1]))
    if not low < peak < high or power[peak] < _CLEAR**2:
        return stated
    before, top, after = np.log(power[peak - 1 : peak + 2])
    return float((peak + 0.5 * (before - after) / (before - 2 * top + after)) * step)
