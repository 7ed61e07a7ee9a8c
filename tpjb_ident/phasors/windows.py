"""Cutting a run into windows: long enough to tell the lines apart, many enough to be robust.

The joint fit of the lines separates 22 Hz from 25 Hz in any window, in principle; what a short
window costs is variance. The variance inflation of the excitation line (against a fit of that line
alone) is the criterion: 1.0 for orthogonal lines, 1.3 is accepted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.errors import TpjbError
from tpjb_ident.phasors.lines import LineSet


@dataclass(frozen=True)
class WindowSettings:
    """How long windows are to be."""

    length: float | None = None
    target_count: int = 20
    max_inflation: float = 1.3
    min_cycles: float = 4.0


#: Samples per window, where a shorter one resolves the lines.
MAX_SAMPLES = 2**16


class RecordTooShortError(TpjbError):
    """The record cannot resolve its lines; `needed` [s] says how long it has to be."""

    def __init__(self, message: str, needed: float) -> None:
        super().__init__(message)
        self.needed = needed

    def __reduce__(self) -> tuple[type[RecordTooShortError], tuple[str, float]]:
        return RecordTooShortError, (str(self), self.needed)


def line_design(time: FloatArray, frequencies: FloatArray, drift_order: int = 1) -> FloatArray:
    """Columns of the joint least-squares problem, (n, 2 n_lines + drift_order + 1).

    `time` (n,), `frequencies` (n_lines,) [Hz].
    """
    phase = 2 * np.pi * np.multiply.outer(time, frequencies)
    middle, half = 0.5 * (time[0] + time[-1]), 0.5 * (time[-1] - time[0]) or 1.0
    slow = np.polynomial.legendre.legvander((time - middle) / half, drift_order)
    waves = np.empty((len(time), 2 * len(frequencies)))
    waves[:, 0::2] = np.cos(phase)
    waves[:, 1::2] = -np.sin(phase)
    return np.concatenate([waves, slow], axis=1)


def variance_inflation(frequencies: FloatArray, n_driven: int, length: float, rate: float) -> float:
    """Worst variance of an excitation phasor against a fit of that line alone; `frequencies` (n_lines,)."""
    # A few hundred samples carry the whole geometry as long as no line aliases.
    step = max(1, int(rate / (8.0 * frequencies.max())))
    design = line_design(np.arange(0, round(length * rate), step) / rate, frequencies)
    if design.shape[0] <= design.shape[1]:
        return math.inf
    r = np.linalg.qr(design, mode="r")
    if np.abs(np.diag(r)).min() < 1e-9 * np.abs(np.diag(r)).max():
        return math.inf
    inverse = np.linalg.inv(r)
    variance = np.einsum("ij,ij->i", inverse, inverse)[: 2 * n_driven]
    return float((variance * 0.5 * design.shape[0]).max())


def shortest_window(lines: LineSet, rate: float, settings: WindowSettings) -> float:
    """Shortest window [s] that keeps the excitation lines within the accepted inflation."""
    frequencies = lines.frequencies
    n_driven = len(lines.excitation)
    start = settings.min_cycles / min(lines.driven)
    length = start
    # A dozen beats between neighbours separate any two lines; what is not resolved then never is.
    longest = max(start, 12.0 / _gap(lines))
    while length <= longest:
        if variance_inflation(frequencies, n_driven, length, rate) <= settings.max_inflation:
            return length
        length *= 1.05
    raise RecordTooShortError(
        f"lines {np.array2string(frequencies, precision=4)} Hz cannot be told apart by any window", math.inf
    )


def plan_windows(n_samples: int, rate: float, lines: LineSet, settings: WindowSettings) -> tuple[int, int]:
    """Choose window length and count for one run."""
    shortest = shortest_window(lines, rate, settings)
    available = n_samples / rate
    # Very long records are cut into more windows, not into windows that fill the memory.
    wanted = settings.length or max(shortest, min(available / settings.target_count, MAX_SAMPLES / rate))
    limits = [("a window", settings.length or math.inf), ("the record", available)]
    for name, seconds in limits:
        if seconds < shortest * 0.999:
            raise RecordTooShortError(
                f"{name} of {seconds:.3g} s cannot tell the lines apart: the nearest to the excitation is "
                f"{_gap(lines):.3g} Hz away; it takes at least {shortest:.3g} s",
                shortest,
            )
    count = max(1, int(available / wanted + 1e-9))
    return n_samples // count if settings.length is None else round(wanted * rate), count


def _gap(lines: LineSet) -> float:
    f = lines.frequencies
    gaps = np.abs(np.subtract.outer(f[: len(lines.excitation)], f))
    return float(gaps[gaps > 0].min(initial=math.inf))
