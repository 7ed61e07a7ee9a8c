"""Phasors of every channel at some strong lines of an excitation over a band.

What channels owe one another (two planes of probes, cells and accelerometers) holds at every line, so a few that stand
clear of the noise, away from shaft and mains, serve the checks as the one line of a sine does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigdata.run import Run
from tpjb_ident.arrays import ComplexArray, FloatArray

#: Lines that are looked at, the strongest of as many parts of the band.
LINES = 8
#: Bins to either side of a disturbing line that are left alone.
_BESIDE = 5
#: Noise is looked at from this many times the band's top on.
_ABOVE = 1.3


def band_lines(
    run: Run, values: FloatArray, force: Sequence[int], disturbing: Sequence[float]
) -> tuple[ComplexArray, FloatArray]:
    """Phasors (k, m) at the lines where the force is strongest, and what noise makes of a line (m,).

    Parameters
    ----------
    run : rigdata.run.Run
        Excited over a band.
    values : (n, m) ndarray
        Samples of its channels, SI; NaN where missing.
    force : sequence of int
        Columns that are forces.
    disturbing : sequence of float
        Other lines, with all their harmonics [Hz].
    """
    none = np.empty((0, values.shape[1]), complex), np.full(values.shape[1], np.nan)
    known = np.isfinite(values)
    if run.band is None or not len(force) or len(values) < 64 or not known.any(axis=0).all():
        return none
    middle = np.nanmedian(values, axis=0)
    window = np.hanning(len(values))
    spectrum = np.fft.rfft(np.where(known, values - middle, 0.0) * window[:, None], axis=0) * (2 / window.sum())
    frequency = np.fft.rfftfreq(len(values), 1 / run.sample_rate)
    free = np.ones(len(frequency), dtype=bool)
    for line in disturbing:
        free &= np.abs(frequency - line * np.maximum(np.round(frequency / line), 1)) > _BESIDE * frequency[1]
    inside = np.flatnonzero(free & (frequency >= run.band[0]) & (frequency <= run.band[1]))
    beyond = free & (frequency > _ABOVE * run.band[1]) & (frequency < 0.45 * run.sample_rate)
    if len(inside) < LINES or beyond.sum() < LINES:
        return none
    power = np.sum(np.abs(spectrum[:, list(force)]) ** 2, axis=1)
    chosen = [part[np.argmax(power[part])] for part in np.array_split(inside, LINES)]
    return np.asarray(spectrum[chosen]), np.median(np.abs(spectrum[beyond]), axis=0)
