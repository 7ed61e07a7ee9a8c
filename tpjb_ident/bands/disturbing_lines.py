"""Lines that turn with the shaft or come from the mains: fitted over the whole record, taken off, their bins left out.

The amplitude of each may change slowly over the record, as a polynomial of time; so a frequency that is a little off,
or creeps, is taken along. A periodic excitation is fitted together with them, period by period, and stays as it is.
"""

from dataclasses import replace

import numpy as np
from scipy.signal import zoom_fft

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.bands.samples import Samples
from tpjb_ident.phasors.found_lines import vertex
from tpjb_ident.phasors.line_fit import even_design
from tpjb_ident.phasors.lines import HIGHEST, MAINS_DRIFT, SPEED_DRIFT, Line, LineSettings, strong_lines

#: Highest harmonics of shaft and mains that are looked for.
_SHAFT_HARMONICS, _MAINS_HARMONICS = 8, 5
#: Highest power of time in a line's amplitude.
_CREEP = 3
#: Power of a line, over that of noise of the record's size, from which its frequency is believed.
_SHOWN = 20.0
#: Part of a line's power that the excitation's period must leave: one that it holds stays where it is.
_NOTHING = 1e-6
#: Bins next to a line that are left out, in whole-record bins.
LEFT_OUT = 4.0
#: The same of a period, in its own bins: lines between its bins are told from it by all its repeats.
LEFT_OUT_OF_PERIOD = 0.6


def find_disturbances(samples: Samples, speed: float, mains: float, top: float) -> tuple[Line, ...]:
    """Shaft harmonics and mains up to above the band, at the frequencies at which the record shows them."""
    reach = min(HIGHEST * samples.rate, 1.5 * top)
    shaft = _shown(samples, speed, SPEED_DRIFT) if samples.length / samples.rate * speed > 2 else 0.0
    supply = _shown(samples, mains, MAINS_DRIFT) if mains > 0 else 0.0
    settings = LineSettings(supply, _SHAFT_HARMONICS, _MAINS_HARMONICS)
    resolved: list[Line] = []
    for line in strong_lines((), shaft, settings):
        is_resolved = all(abs(line.frequency - near.frequency) > samples.rate / samples.length for near in resolved)
        if line.frequency < reach and is_resolved:
            resolved.append(line)
    return tuple(resolved)


def _shown(samples: Samples, nominal: float, wander: float) -> float:
    """Frequency of the highest peak near `nominal` [Hz], where one stands clear of what is around it."""
    n, window = samples.length, np.hanning(samples.length)
    step = 0.25 * samples.rate / n
    reach = int(wander / step) + 1
    ends = [nominal - reach * step, nominal + reach * step]
    power = np.zeros(2 * reach + 1)
    for quantity in ("displacement", "force"):
        rows = samples.rows[samples.pick(quantity)]
        rows = rows - rows.mean(axis=1, keepdims=True)
        spectra = zoom_fft(rows * window, ends, len(power), fs=samples.rate, endpoint=True)
        size = max(float(np.sum(rows**2)) * float(np.sum(window**2)), 1e-300)
        power += np.sum(np.abs(spectra) ** 2, axis=0) / size
    k = int(np.argmax(power))
    if not 0 < k < 2 * reach or power[k] < _SHOWN:
        return nominal
    return float(ends[0] + step * (k + vertex(power[k - 1 : k + 2])))


def without_disturbances(samples: Samples, lines: tuple[Line, ...], period: int | None = None) -> Samples:
    """The record without the lines and without its mean."""
    stack = samples.rows - samples.rows.mean(axis=1, keepdims=True)
    if not lines:
        return replace(samples, rows=stack)
    n = samples.length
    waves = even_design(n, samples.rate, np.array([line.frequency for line in lines]))[:, : 2 * len(lines)]
    creep = np.polynomial.legendre.legvander(np.linspace(-1, 1, n), _CREEP)
    columns = (creep[:, :, None] * waves[:, None, :]).reshape(n, -1).T
    basis, target = (_without_periodic(rows, period) for rows in (columns, stack))
    gram = basis @ basis.T + _NOTHING * n * np.eye(len(basis))
    return replace(samples, rows=stack - np.linalg.solve(gram, basis @ target.T).T @ columns)


def _without_periodic(rows: FloatArray, period: int | None) -> FloatArray:
    """What changes (k, n) from period to period."""
    if period is None:
        return rows
    folded = rows.reshape(len(rows), -1, period)
    return np.asarray((folded - folded.mean(axis=1, keepdims=True)).reshape(len(rows), -1))


def bins_taken(frequencies: FloatArray, lines: tuple[Line, ...], seconds: float, width: float = LEFT_OUT) -> BoolArray:
    """Bins that a line may have spoiled, (n,)."""
    disturbed = np.zeros(len(frequencies), dtype=bool)
    for line in lines:
        disturbed |= np.abs(frequencies - line.frequency) <= max(width / seconds, line.wander)
    return disturbed
