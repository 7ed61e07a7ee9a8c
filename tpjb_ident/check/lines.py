"""Means and phasors of the known lines of a record, by one least-squares fit that leaves glitches out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.arrays import BoolArray, ComplexArray, FloatArray

_GLITCH = 6.0
#: A line whose amplitude may change needs this distance from all others [1 / record length].
_PARTED = 2.5


@dataclass(frozen=True)
class Lines:
    """What the fit found, for m channels.

    Attributes
    ----------
    mean : (m,) ndarray
    phasor : (m,) complex ndarray
        At the first of the frequencies; ``Re(phasor exp(i omega t))``.
    floor : (m,) ndarray
        Amplitude that lines beside it reach by noise alone.
    glitches : (m,) int ndarray
        Samples left out because they stand off the fit.
    scatter : (m,) ndarray
        Standard deviation of what is left.
    """

    mean: FloatArray
    phasor: ComplexArray
    floor: FloatArray
    glitches: NDArray[np.int64]
    scatter: FloatArray


def fit_lines(
    time: FloatArray, values: FloatArray, frequencies: Sequence[float], inexact: Sequence[float] = ()
) -> Lines:
    """Fit mean, drift and lines to every column.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds.
    values : (n, m) ndarray
        NaN where missing.
    frequencies : sequence of float
        [Hz]; the first is the one wanted, others nearer to it than the record can part are dropped.
    inexact : sequence of float
        Those of them known to a fraction of 1 / record length only [Hz]: their amplitude may change along the record,
        which is the first order of a wrong frequency, and no part of it leaks into the line wanted.

    Returns
    -------
    Lines
        NaN for columns with too few samples.
    """
    span = max(float(time[-1] - time[0]), 1e-300)
    kept: list[float] = []
    for frequency in frequencies:
        if frequency > 0 and all(abs(frequency - f) * span > 0.8 for f in kept):
            kept.append(frequency)
    growing = [f for f in inexact if f in kept[1:] and all(abs(f - k) * span > _PARTED for k in kept if k != f)]
    design = _design(time, kept, growing)
    good = np.isfinite(values)
    coefficients, rest, used = _robust(design, np.where(good, values, 0.0), good)
    counts = np.count_nonzero(used, axis=0)
    fit = np.where(counts >= 3 * design.shape[1], 1.0, np.nan)
    scatter = np.sqrt(np.sum(rest**2, axis=0) / np.maximum(counts, 1)) * fit
    missing = np.full(values.shape[1], np.nan)
    phasor = (coefficients[2] - 1j * coefficients[3]) * fit if kept else missing + 0j
    floor = _floor(time, rest, kept[0], span) * len(time) / np.maximum(counts, 1) * fit if kept else missing
    return Lines(coefficients[0] * fit, phasor, floor, np.count_nonzero(good, axis=0) - counts, scatter)


def _design(time: FloatArray, frequencies: Sequence[float], growing: Sequence[float]) -> FloatArray:
    middle, half = (time[0] + time[-1]) / 2, max((time[-1] - time[0]) / 2, 1e-300)
    place = (time - middle) / half
    columns = [np.ones_like(time), place]
    for frequency in frequencies:
        angle = 2 * math.pi * frequency * time
        columns += [np.cos(angle), np.sin(angle)]
    for frequency in growing:
        angle = 2 * math.pi * frequency * time
        columns += [place * np.cos(angle), place * np.sin(angle)]
    return np.stack(columns, axis=1)


def _robust(design: FloatArray, values: FloatArray, good: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Least squares per column, glitches left out; what is left is zero where nothing was used."""
    used = good
    for _ in range(4):
        coefficients = _solve(design, values, used)
        rest = np.where(good, values - np.einsum("nk,km->nm", design, coefficients), 0.0)
        scale = np.array([1.4826 * float(np.median(np.abs(r[u]))) if u.any() else 0.0 for r, u in zip(rest.T, used.T)])
        kept = good & (np.abs(rest) <= _GLITCH * scale)
        enough = (scale > 0) & (2 * np.count_nonzero(kept, axis=0) > np.count_nonzero(good, axis=0))
        following = np.where(enough, kept, used)
        if np.array_equal(following, used):
            break
        used = following
    return coefficients, np.where(used, rest, 0.0), used


def _solve(design: FloatArray, values: FloatArray, used: BoolArray) -> FloatArray:
    """Normal equations: sines of well parted lines are nearly orthogonal, and einsum starts no threads."""
    gram = np.einsum("nk,nl->kl", design, design)
    right = np.einsum("nk,nm->km", design, np.where(used, values, 0.0))
    result = np.zeros_like(right)
    for column in range(values.shape[1]):
        out = design[~used[:, column]]
        if len(out) <= len(design) - 3 * design.shape[1]:
            normal = gram - np.einsum("nk,nl->kl", out, out)
            # Lines beyond the reach of the record make it singular: the shortest answer is as good as any.
            result[:, column] = np.linalg.lstsq(normal, right[:, column], rcond=1e-12)[0]
    return result


def _floor(time: FloatArray, rest: FloatArray, frequency: float, span: float) -> FloatArray:
    """Median amplitude of what is left, at frequencies around the wanted one, per column."""
    offsets = np.array([-7.5, -5.5, -4.5, -3.5, -2.5, 2.5, 3.5, 4.5, 5.5, 7.5]) / span
    near = frequency + offsets
    angles = 2 * math.pi * np.outer(near[near > 0], time)
    real, imaginary = (np.einsum("fn,nm->fm", f(angles), rest) for f in (np.cos, np.sin))
    return np.asarray(np.median(np.hypot(real, imaginary), axis=0) * 2.0 / len(time))


def strongest_line(time: FloatArray, values: FloatArray, apart_from: Sequence[float]) -> float:
    """Frequency of the strongest line, leaving out some and the slowest [Hz]; NaN where there is none.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, nearly equidistant.
    values : (n,) ndarray
    apart_from : sequence of float
        Known lines [Hz].
    """
    if len(time) < 16:
        return float("nan")
    filled = np.where(np.isfinite(values), values, np.nanmedian(values)) if np.isfinite(values).any() else None
    if filled is None:
        return float("nan")
    window = np.hanning(len(filled))
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if step <= 0:
        return float("nan")
    power = np.abs(np.fft.rfft((filled - np.median(filled)) * window))
    frequency = np.fft.rfftfreq(len(filled), step)
    allowed = frequency > 4.0 / (step * len(filled))
    for known in apart_from:
        allowed &= np.abs(frequency - known) > 3.0 / (step * len(filled))
    return float(frequency[np.argmax(np.where(allowed, power, 0.0))]) if allowed.any() else float("nan")
