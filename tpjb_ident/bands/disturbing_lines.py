"""Lines that turn with the shaft or come from the mains: fitted over the whole record, taken off, their bins left out.

The amplitude of each may change slowly over the record, as a polynomial of time; so a frequency that is a little off,
or creeps, is taken along. A periodic excitation is fitted together with them, period by period, and stays as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import zoom_fft

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.bands.samples import Samples
from tpjb_ident.phasors.found_lines import vertex
from tpjb_ident.phasors.lines import MAINS_DRIFT, SPEED_DRIFT, Line, LineSettings, strong_lines

#: Highest harmonics of shaft and mains that are looked for.
_SHAFT_HARMONICS, _MAINS_HARMONICS = 8, 5
#: Highest power of time in a line's amplitude.
_CREEP = 3
#: Bins next to a line that are left out, in whole-record bins.
LEFT_OUT = 4.0
#: The same of a period, in its own bins: lines between its bins are told from it by all its repeats.
LEFT_OUT_OF_PERIOD = 0.6


def find_disturbances(samples: Samples, speed: float, mains: float, top: float) -> tuple[Line, ...]:
    """Shaft harmonics and mains up to above the band, at the frequencies at which the record shows them."""
    reach = min(0.45 * samples.rate, 1.5 * top)
    shaft = _shown(samples, speed, SPEED_DRIFT) if speed > 0 else 0.0
    supply = _shown(samples, mains, MAINS_DRIFT) if mains > 0 else 0.0
    harmonics = _SHAFT_HARMONICS if samples.length / samples.rate * speed > 2 else 0
    settings = LineSettings(supply, harmonics, mains_harmonics=_MAINS_HARMONICS)
    resolved: list[Line] = []
    for line in strong_lines((), shaft, settings):
        apart = all(abs(line.frequency - other.frequency) > samples.rate / samples.length for other in resolved)
        if line.frequency < reach and apart:
            resolved.append(line)
    return tuple(resolved)


def _shown(samples: Samples, nominal: float, wander: float) -> float:
    """Frequency of the highest peak near `nominal` [Hz], where one stands clear of what is around it."""
    n, rate = samples.length, samples.rate
    window = np.hanning(n)
    step = 0.25 * rate / n
    reach = int(wander / step) + 1
    ends = [nominal - reach * step, nominal + reach * step]
    power = np.zeros(2 * reach + 1)
    for q in ("displacement", "force"):
        rows = samples.rows[samples.places(q)]
        rows = rows - rows.mean(axis=1, keepdims=True)
        each = np.sum(np.abs(zoom_fft(rows * window, ends, len(power), fs=rate, endpoint=True)) ** 2, axis=0)
        power += each / max(float(np.sum(rows**2)) * float(np.sum(window**2)), 1e-300)
    k = int(np.argmax(power))
    if not 0 < k < 2 * reach or power[k] < 20.0:
        return nominal
    return float(ends[0] + step * (k + vertex(power[k - 1 : k + 2])))


def without_disturbances(samples: Samples, lines: tuple[Line, ...], period: int | None = None) -> Samples:
    """The record without the lines and without its mean."""
    stack = samples.rows - samples.rows.mean(axis=1, keepdims=True)
    if not lines:
        return replace(samples, rows=stack)
    scale = np.sqrt(np.mean(stack**2, axis=1, keepdims=True))
    scale[scale == 0] = 1.0
    columns = _columns(samples, lines)
    basis = columns if period is None else _without_periodic(columns, period)
    target = stack / scale if period is None else _without_periodic(stack / scale, period)
    gram = basis @ basis.T
    values, vectors = np.linalg.eigh(gram)
    # a line that the excitation's own period holds cannot be told from it: it is left where it is
    significant = values > 1e-6 * max(float(np.max(np.sum(columns**2, axis=1))), 1e-300)
    inverse = (vectors[:, significant] / values[significant]) @ vectors[:, significant].T
    cleaned = stack - scale * (((target @ basis.T) @ inverse) @ columns)
    return replace(samples, rows=cleaned)


def _columns(samples: Samples, lines: tuple[Line, ...]) -> FloatArray:
    """Cosine and sine of every line times powers of time, (n_columns, n)."""
    n = samples.length
    t = np.arange(n) / samples.rate
    legendre = np.polynomial.legendre.legvander(np.linspace(-1, 1, n), _CREEP).T
    rows = []
    for line in lines:
        angle = 2 * np.pi * line.frequency * t
        if line.order and samples.angle is not None:
            angle = line.order * samples.angle[:n]
        rows += [legendre * np.cos(angle), legendre * np.sin(angle)]
    return np.concatenate(rows)


def _without_periodic(rows: FloatArray, period: int) -> FloatArray:
    folded = rows.reshape(len(rows), -1, period)
    return np.asarray((folded - folded.mean(axis=1, keepdims=True)).reshape(len(rows), -1))


def bins_taken(frequencies: FloatArray, lines: tuple[Line, ...], seconds: float, width: float = LEFT_OUT) -> BoolArray:
    """Bins that a line may have spoiled, (n,)."""
    disturbed = np.zeros(len(frequencies), dtype=bool)
    for line in lines:
        disturbed |= np.abs(frequencies - line.frequency) <= max(width / seconds, line.wander)
    return disturbed
