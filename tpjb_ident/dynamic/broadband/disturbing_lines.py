"""Lines that turn with the shaft or come from the mains: fitted over the whole record, taken off, their bins left out.

The amplitude of each may change slowly over the record, as a polynomial of time; so a frequency that is a little off,
or creeps, is taken along. A periodic excitation is fitted together with them, period by period, and stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.dynamic.broadband.samples import Samples

#: Highest harmonics of shaft and mains that are looked for.
_SHAFT_HARMONICS, _MAINS_HARMONICS = 8, 5
#: Highest power of time in a line's amplitude.
_CREEP = 3
#: How far shaft (per harmonic) and mains may be from where they are expected [Hz].
_SHAFT_WANDER, _MAINS_WANDER = 0.08, 0.15
#: Bins next to a line that are left out, in whole-record bins.
LEFT_OUT = 4.0
#: The same of a period, in its own bins: lines between its bins are told from it by all its repeats.
LEFT_OUT_OF_PERIOD = 0.6


@dataclass(frozen=True)
class Disturbance:
    """One line."""

    name: str
    frequency: float
    order: int = 0


def find_disturbances(samples: Samples, speed: float, mains: float, top: float) -> tuple[Disturbance, ...]:
    """Shaft harmonics and mains up to above the band, at the frequencies at which the record shows them."""
    reach = min(0.45 * samples.rate, 1.5 * top)
    candidates = []
    if speed > 0:
        shaft = _shown(samples, speed, _SHAFT_WANDER)
        turns = _SHAFT_HARMONICS if samples.length / samples.rate * speed > 2 else 0
        candidates += [Disturbance(f"{k}X", k * shaft, k) for k in range(1, turns + 1) if k * shaft < reach]
    if mains > 0:
        shaft = _shown(samples, mains, _MAINS_WANDER)
        names = ["mains", *(f"mains {k}" for k in range(2, _MAINS_HARMONICS + 1))]
        candidates += [Disturbance(name, k * shaft) for k, name in enumerate(names, 1) if k * shaft < reach]
    resolved: list[Disturbance] = []
    for line in candidates:
        if all(abs(line.frequency - other.frequency) > samples.rate / samples.length for other in resolved):
            resolved.append(line)
    return tuple(resolved)


def _shown(samples: Samples, nominal: float, wander: float) -> float:
    """Frequency of the highest peak near `nominal` [Hz], where one stands clear of what is around it."""
    n, rate = samples.length, samples.rate
    window = np.hanning(n)
    t = np.arange(n) / rate
    step = 0.25 * rate / n
    grid = nominal + step * np.arange(-int(wander / step) - 1, int(wander / step) + 2)
    waves = [window * np.exp(-2j * np.pi * f * t) for f in grid]
    power = np.zeros(len(grid))
    for q in ("displacement", "force"):
        rows = samples.rows[samples.places(q)]
        rows = rows - rows.mean(axis=1, keepdims=True)
        each = np.array([np.sum(np.abs(rows @ wave) ** 2) for wave in waves])
        power += each / max(float(np.sum(rows**2)) * float(np.sum(window**2)), 1e-300)
    k = int(np.argmax(power))
    if not 0 < k < len(grid) - 1 or power[k] < 20.0:
        return nominal
    a, b, c = np.log(power[k - 1 : k + 2])
    return float(grid[k] + step * 0.5 * (a - c) / (a - 2 * b + c))


def without_disturbances(samples: Samples, lines: tuple[Disturbance, ...], period: int | None = None) -> Samples:
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


def _columns(samples: Samples, lines: tuple[Disturbance, ...]) -> FloatArray:
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


def bins_taken(
    frequencies: FloatArray, lines: tuple[Disturbance, ...], seconds: float, width: float = LEFT_OUT
) -> BoolArray:
    """Bins that a line may have spoiled, (n,)."""
    disturbed = np.zeros(len(frequencies), dtype=bool)
    for line in lines:
        wander = _SHAFT_WANDER * line.order if line.order else _MAINS_WANDER
        disturbed |= np.abs(frequencies - line.frequency) <= max(width / seconds, wander)
    return disturbed
