"""Pictures of records, over time and frequency, and of their windows: how far displacements explain the force."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.lib.stride_tricks import sliding_window_view

from rigdata.arrays import FloatArray
from rigdata.survey.spectrum import amplitude_spectrum
from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.picture import (
    BLUE,
    DASHED,
    FONT_SIZE,
    GREY,
    INK,
    LIGHT,
    PAPER,
    RULE,
    SHORT_DASHED,
    add_legend,
    label,
    new_picture,
    new_pictures,
)
from tpjb_ident.report.drawing.series import as_table, set_point_ticks

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.run import Run
    from tpjb_ident.estimators.stiffness import DynamicStiffness
    from tpjb_ident.results.identification import Identification
    from tpjb_ident.results.point_result import PointResult

#: More samples could not be told apart.
_MOST_SAMPLES = 4000


def orbit(run: Run, *, title: str | None = None) -> Figure:
    """Draw the shaft's path about its mean position, and the ellipse at the excitation frequency.

    Parameters
    ----------
    run : Run
        With two displacement channels.
    title : str, optional

    Raises
    ------
    ValueError
        When the run has no finite displacements.
    """
    record = run.vector("displacement")
    path = np.asarray(record.values, float)
    good = np.isfinite(path).all(axis=1)
    if good.sum() < 2:
        raise ValueError(f"run {run.id} has no displacements to draw")
    path = per("length") * (path - np.median(path[good], axis=0))
    figure, axes = new_picture(f"x, {symbol('length')}", f"y, {symbol('length')}", title=title)
    shown = path[:_MOST_SAMPLES]
    axes.plot(shown[:, 0], shown[:, 1], color=GREY, linewidth=0.5, label="as measured")
    drive = run.point.excitation
    if drive:
        time = np.asarray(record.time, float)[good]
        waves = np.column_stack([np.ones_like(time), np.cos(drive * time), np.sin(drive * time)])
        _, cosine, sine = np.linalg.lstsq(waves, path[good], rcond=None)[0]
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        ellipse = np.outer(np.cos(turn), cosine) + np.outer(np.sin(turn), sine)
        name = f"at the excitation, {run.point.excitation_hz:g} Hz"
        axes.plot(ellipse[:, 0], ellipse[:, 1], color=BLUE, linewidth=1.8, label=name)
    axes.set_aspect("equal", adjustable="datalim")
    add_legend(axes)
    return figure


#: Quantity, how its amplitude is named, and its display unit in SI.
_ROWS = (("displacement", "length"), ("force", "force"))

_AXIS_STYLE: tuple[tuple[str, str, Any], ...] = (("horizontal", "blue", "-"), ("vertical", "red", DASHED))

#: Bins of a window's foot below which there is drift, not vibration.
_DRIFT = 4


def _highest(run: Run, up_to: float | None, rate: float) -> float:
    """Highest frequency that is drawn [Hz]: as asked, or four times the excitation's, or half the sample rate."""
    return up_to or 4.0 * run.point.excitation_hz or 0.5 * rate


def spectra(run: Run, *, up_to: float | None = None, title: str | None = None) -> Figure:
    """Draw the amplitudes of displacement and force over frequency (Hann window over the whole record).

    Parameters
    ----------
    run : Run
        A dynamic run.
    up_to : float, optional
        Highest frequency [Hz]; default: four times the excitation frequency, half the sample rate without one.
    title : str, optional

    Returns
    -------
    Figure
        Logarithmic. What stands on a line has its true amplitude; noise depends on the length of the record.

    Raises
    ------
    ValueError
        When the run is too short, or empty.
    """
    drive, top = run.point.excitation_hz, _highest(run, up_to, run.sample_rate)
    figure, grid = new_pictures(2, 1, title=title, height=2.3)
    for (axes,), (quantity, unit) in zip(grid, _ROWS, strict=True):
        label(axes, "frequency, Hz", f"{quantity}, 0-peak, {symbol(unit)}")
        largest = 0.0
        record = run.vector(quantity)
        for values, (axis, colour, dashes) in zip(record.values.T, _AXIS_STYLE, strict=True):
            frequency, amplitude = amplitude_spectrum(values * per(unit), record.rate)
            shown = (frequency <= top) & (np.arange(len(frequency)) >= _DRIFT)
            if not shown.any():
                raise ValueError(f"run {run.id} has no spectrum of {quantity} up to {top:g} Hz")
            axes.plot(frequency[shown], amplitude[shown], color=LIGHT[colour], linestyle=dashes, linewidth=1.0,
                      label=axis)  # fmt: skip
            largest = max(largest, float(amplitude[shown].max()))
        axes.set_yscale("log")
        axes.minorticks_off()
        axes.yaxis.set_major_formatter("{x:g}")  # powers of ten are set by a parser that takes longer than the picture
        axes.set_xlim(0.0, top)
        axes.set_ylim(top=3.0 * largest)
        if drive:
            axes.axvline(drive, color=GREY, linewidth=0.9, zorder=0)
            axes.annotate(f"{drive:g} Hz", (drive, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -2),
                          textcoords="offset points", va="top", fontsize=FONT_SIZE - 1, color=INK)  # fmt: skip
    add_legend(grid[0][0])
    return figure


_FEWEST_SEGMENTS = 5
_LEVEL = 0.95


def coherence_spectrum(
    run: Run, *, up_to: float | None = None, segment: float | None = None, title: str | None = None
) -> Figure:
    """Draw the multiple coherence of each force component with both displacements, over frequency (Welch's method).

    It is near one where something drives the bearing, and scatters below the dashed line where nothing does.

    Parameters
    ----------
    run : Run
        A dynamic run.
    up_to : float, optional
        Highest frequency [Hz]; default: four times the excitation frequency, half the sample rate without one.
    segment : float, optional
        Length of the averaged pieces [s]; default: as many pieces as give 16 averages at half overlap.
    title : str, optional

    Raises
    ------
    ValueError
        When the run is too short for the segments.
    """
    vectors = run.vector("force"), run.vector("displacement")
    slower = min(vectors, key=len)
    force, move = (vector.at(slower.time) for vector in vectors)
    n, rate = len(slower), slower.rate
    piece = int(segment * rate) if segment else n // 8
    if piece < 16 or n < _FEWEST_SEGMENTS * piece // 2:
        raise ValueError(f"run {run.id} has {n} samples: too few for segments of {piece}; give a shorter segment")
    frequency, value, averages = _multiple_coherence(force, move, rate, piece)
    drive, top = run.point.excitation_hz, _highest(run, up_to, rate)
    figure, axes = new_picture("frequency, Hz", "multiple coherence", title=title)
    for row, (axis, colour, dashes) in zip(value, _AXIS_STYLE, strict=True):
        axes.plot(frequency, row, color=LIGHT[colour], linestyle=dashes, linewidth=1.3, label=f"{axis} force")
    # under no coherence at all, two inputs and m averages: Beta(2, m - 2)
    from scipy.special import betaincinv

    chance = float(betaincinv(2, max(averages - 2, 1), _LEVEL))
    axes.axhline(chance, color=INK, linestyle=SHORT_DASHED, linewidth=0.9, label="by chance, 95 %")
    if drive:
        axes.axvline(drive, color=GREY, linewidth=0.9)
        axes.text(drive, 0.03, f" {drive:g} Hz", color=INK, fontsize=FONT_SIZE - 1, va="bottom")
    axes.set_xlim(0.0, top)
    axes.set_ylim(0.0, 1.02)
    add_legend(axes)
    return figure


def _multiple_coherence(
    force: FloatArray, move: FloatArray, rate: float, piece: int
) -> tuple[FloatArray, FloatArray, int]:
    """Frequencies (m,) [Hz], coherence (2, m), and the number of independent averages."""
    good = np.isfinite(force).all(axis=1) & np.isfinite(move).all(axis=1)
    signals = np.column_stack([move, force])
    signals = np.where(np.asarray(good)[:, None], signals, signals[good].mean(axis=0))
    pieces = sliding_window_view(signals, piece, axis=0)[:: piece // 2]
    spectra = np.fft.rfft((pieces - pieces.mean(axis=-1, keepdims=True)) * np.hanning(piece))
    cross = np.einsum("kif,kjf->fij", spectra.conj(), spectra)
    inputs, joint, power = cross[:, :2, :2], cross[:, :2, 2:], np.einsum("fii->fi", cross[:, 2:, 2:]).real
    explained = np.einsum("fij,fij->fj", joint.conj(), np.linalg.pinv(inputs, rcond=1e-10, hermitian=True) @ joint).real
    value = np.clip(explained / np.maximum(power, 1e-300), 0.0, 1.0)
    # half-overlapping Hann windows: about 11/9 of the pieces that fit side by side count as independent
    averages = max(math.floor(11.0 / 18.0 * len(spectra)), 3)
    return np.asarray(np.fft.rfftfreq(piece, 1.0 / rate), float), np.asarray(value.T, float), averages


_FLAGGED = 0.9
_SMALLEST = 1e-7


def coherence(identification: Identification | pd.DataFrame, *, title: str | None = None) -> Figure:
    """Draw what part of the force the displacements do not explain, 1 - coherence, for every operating point.

    Parameters
    ----------
    identification : Identification or DataFrame
        Or its table, ``coefficients.csv``.
    title : str, optional

    Returns
    -------
    Figure
        Logarithmic; the dashed line is where a point is flagged ``low-coherence``.
    """
    table = as_table(identification)
    if not len(table):
        raise ValueError("there is no operating point to draw")
    rows = table.sort_values(["static_load_N", "excitation_Hz"], kind="stable")
    unexplained = np.clip(1.0 - rows["coherence"].to_numpy(float), _SMALLEST, None)
    width = max(4.6, 0.36 * len(rows) + 1.2)
    place = f"static load, {symbol('load')}, and excitation, Hz"
    figure, axes = new_picture(place, "1 - coherence", title=title, width=width, height=3.4)
    low = unexplained > 1.0 - _FLAGGED
    at = np.arange(len(rows))
    for mask, colour, marker, name in ((~low, "blue", "o", "operating point"), (low, "red", "X", "flagged")):
        if mask.any():
            axes.plot(at[mask], unexplained[mask], linestyle="none", marker=marker, markersize=6, color=LIGHT[colour],
                      label=name)  # fmt: skip
    axes.axhline(1.0 - _FLAGGED, color=INK, linestyle=DASHED, linewidth=1.0, label="flagged above")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")  # powers of ten are set by a parser that takes longer than the picture
    axes.set_ylim(0.5 * float(unexplained.min()), 1.0)
    set_point_ticks(axes, rows)
    axes.grid(axis="x", visible=False)
    add_legend(axes)
    return figure


_REJECTED = 0.3
_NAMED = 6  # rejected windows that are named in the picture


def window_weights(result: PointResult | DynamicStiffness, *, title: str | None = None) -> Figure:
    """Draw the final weight of every record window, 1 fully used, 0 thrown out.

    Parameters
    ----------
    result : PointResult or DynamicStiffness
        From a `PointResult` the rejected windows carry run, time and reason.
    title : str, optional
    """
    estimate = result.stiffness if hasattr(result, "stiffness") else result
    weights = np.asarray(estimate.weights, dtype=float)
    if not weights.size:
        raise ValueError("the estimate has no windows")
    figure, axes = new_picture("window, in the order of the runs", "robust weight", title=title, width=6.4)
    at = np.arange(1, len(weights) + 1)
    equal_weights = bool(np.allclose(weights[:, 0], weights[:, 1], equal_nan=True))
    for axis, colour, marker, name in ((0, "blue", "o", "horizontal force"), (1, "red", "s", "vertical force")):
        if equal_weights and axis:
            break
        values = weights[:, axis]
        axes.vlines(at, 0.0, values, color=LIGHT[colour], linewidth=0.6, alpha=0.5)
        axes.plot(
            at, values, linestyle="none", marker=marker, markersize=3.5 if axis else 4.5, color=LIGHT[colour],
            markerfacecolor=LIGHT[colour if axis else "paper"], label="both forces" if equal_weights else name,
        )  # fmt: skip
    axes.axhline(_REJECTED, color=INK, linestyle=DASHED, linewidth=0.9, label="counted as outlier below")
    axes.set_ylim(-0.03, 1.08)
    axes.set_xlim(0.0, len(weights) + 1)
    rejected = sorted(getattr(result, "rejected", ()), key=lambda w: w.weight)
    if rejected:
        words = [f"{w.run} at {w.time:.2f} s: {w.reason}" for w in rejected[:_NAMED]]
        if len(rejected) > _NAMED:
            words.append(f"and {len(rejected) - _NAMED} more")
        box = {"facecolor": PAPER, "edgecolor": RULE, "alpha": 0.85}
        axes.text(0.015, 0.42, "\n".join(words), transform=axes.transAxes, fontsize=FONT_SIZE - 1.0, color=INK,
                  va="bottom", bbox=box)  # fmt: skip
    add_legend(axes)
    return figure
