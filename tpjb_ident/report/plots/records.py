"""Pictures of records, over time and frequency, and of their windows: how far displacements explain the force."""

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigdata.run import Run
from rigdata.survey.spectrum import amplitude_spectrum
from tpjb_ident.columns import size, symbol
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.report.drawing.picture import (
    BLUE,
    GREY,
    INK,
    PAPER,
    RED,
    RULE,
    SMALL,
    add_legend,
    as_table,
    label,
    logarithmic,
    new_picture,
    new_pictures,
    plot,
    set_point_ticks,
    style_of,
)
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.rounding import listed

#: More samples could not be told apart.
_MOST_SAMPLES = 4000


@plot
def orbit(run: Run) -> Figure:
    """Draw the shaft's path about its mean position, and the ellipse at the excitation frequency.

    Parameters
    ----------
    run : Run
        With two displacement channels.

    Raises
    ------
    ValueError
        When the run has no finite displacements.
    """
    record = run.vector("displacement")
    path = record.values
    good = np.isfinite(path).all(axis=1)
    if good.sum() < 2:
        raise ValueError(f"run {run.id} has no displacements to draw")
    path = (path - np.median(path[good], axis=0)) / size("length")
    figure, axes = new_picture(f"x, {symbol('length')}", f"y, {symbol('length')}")
    axes.plot(*path[:_MOST_SAMPLES].T, color=GREY, linewidth=0.5, label="as measured")
    drive = run.point.excitation
    if drive:
        turns = drive * record.time[good]
        waves = np.column_stack([np.ones_like(turns), np.cos(turns), np.sin(turns)])
        _, cosine, sine = np.linalg.lstsq(waves, path[good], rcond=None)[0]
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        ellipse = np.outer(np.cos(turn), cosine) + np.outer(np.sin(turn), sine)
        name = f"at the excitation, {run.point.excitation_hz:g} Hz"
        axes.plot(*ellipse.T, color=BLUE, linewidth=1.8, label=name)
    axes.set_aspect("equal", adjustable="datalim")
    add_legend(axes)
    return figure


#: Quantity, how its amplitude is named, and its display unit in SI.
_ROWS = (("displacement", "length"), ("force", "force"))
_AXES = ("horizontal", "vertical")
#: Spectra end at so many times the excitation; without one at half the rate.
_TIMES = 4.0
#: Bins of a window's foot below which there is drift, not vibration.
_DRIFT = 4


def _end_axis(axes: Axes, run: Run, highest: float) -> None:
    """End the axis at a frequency [Hz], and mark the excitation."""
    axes.set_xlim(0.0, highest)
    if hz := run.point.excitation_hz:
        axes.axvline(hz, color=GREY, linewidth=0.9, zorder=0, label=f"excitation, {hz:g} Hz")


@plot
def spectra(run: Run) -> Figure:
    """Draw the amplitudes of displacement and force over frequency (Hann window over the whole record).

    Parameters
    ----------
    run : Run
        A dynamic run.

    Returns
    -------
    Figure
        Logarithmic. What stands on a line has its true amplitude; noise depends on the length of the record.

    Raises
    ------
    ValueError
        When the run is too short, or empty.
    """
    figure, grid = new_pictures(2, 1, height=2.3)
    top = _TIMES * run.point.excitation_hz or 0.5 * run.sample_rate
    for axes, (quantity, unit) in zip(grid[:, 0], _ROWS, strict=True):
        label(axes, "frequency, Hz", f"{quantity}, 0-peak, {symbol(unit)}")
        record = run.vector(quantity)
        largest = 0.0
        for number, axis in enumerate(_AXES):
            frequency, amplitude = amplitude_spectrum(record.values[:, number] / size(unit), record.rate)
            shown = (frequency <= top) & (np.arange(len(frequency)) >= _DRIFT)
            if not shown.any():
                raise ValueError(f"run {run.id} has no spectrum of {quantity} up to {top:g} Hz")
            style = style_of(number) | {"marker": "", "linewidth": 1.0}
            axes.plot(frequency[shown], amplitude[shown], **style, label=axis)
            largest = max(largest, amplitude[shown].max())
        logarithmic(axes)
        axes.set_ylim(top=3.0 * largest)
        _end_axis(axes, run, top)
    add_legend(grid[0, 0])
    return figure


_FEWEST_SEGMENTS = 5
_LEVEL = 0.95


@plot
def coherence_spectrum(run: Run, *, segment: float | None = None) -> Figure:
    """Draw the multiple coherence of each force component with both displacements, over frequency (Welch's method).

    It is near one where something drives the bearing, and scatters below the dashed line where nothing does.

    Parameters
    ----------
    run : Run
        A dynamic run.
    segment : float, optional
        Length of the averaged pieces [s]; default: as many pieces as give 16 averages at half overlap.

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
    signals = np.column_stack([move, force])
    good = np.asarray(np.isfinite(signals).all(axis=1))
    signals = np.where(good[:, None], signals, signals[good].mean(axis=0))
    from scipy.signal import csd
    from scipy.special import betaincinv

    frequency, cross = csd(signals.T[:, None], signals.T[None], rate, "hann", piece, detrend="constant")
    cross = np.moveaxis(cross, -1, 0)
    inputs, joint, power = cross[:, :2, :2], cross[:, :2, 2:], np.einsum("fii->fi", cross[:, 2:, 2:]).real
    explained = np.einsum("fij,fij->fj", joint.conj(), np.linalg.pinv(inputs, rcond=1e-10, hermitian=True) @ joint).real
    value = np.clip(explained / np.maximum(power, 1e-300), 0.0, 1.0)
    # half-overlapping Hann windows: about 11/9 of the pieces that fit side by side count as independent
    pieces = (n - piece) // (piece - piece // 2) + 1
    averages = max(math.floor(11.0 / 18.0 * pieces), 3)
    figure, axes = new_picture("frequency, Hz", "multiple coherence")
    for number, (axis, row) in enumerate(zip(_AXES, value.T, strict=True)):
        axes.plot(frequency, row, **style_of(number) | {"marker": ""}, label=f"{axis} force")
    # under no coherence at all, two inputs and m averages: Beta(2, m - 2)
    chance = betaincinv(2, max(averages - 2, 1), _LEVEL)
    axes.axhline(chance, color=INK, linestyle=":", linewidth=0.9, label="by chance, 95 %")
    axes.set_ylim(0.0, 1.02)
    _end_axis(axes, run, _TIMES * run.point.excitation_hz or 0.5 * rate)
    add_legend(axes)
    return figure


_FLAGGED = 0.9
_SMALLEST = 1e-7


@plot
def coherence(identification: Identification | pd.DataFrame) -> Figure:
    """Draw what part of the force the displacements do not explain, 1 - coherence, for every operating point.

    Parameters
    ----------
    identification : Identification or DataFrame
        Or its table, ``coefficients.csv``.

    Returns
    -------
    Figure
        Logarithmic; the dashed line is where a point is flagged ``low-coherence``.
    """
    table = as_table(identification)
    if not len(table):
        raise ValueError("there is no operating point to draw")
    rows = table.sort_values(["static_load_N", "excitation_Hz"], kind="stable")
    unexplained = np.maximum(1.0 - rows["coherence"].to_numpy(float), _SMALLEST)
    width = max(4.6, 0.36 * len(rows) + 1.2)
    place = f"static load, {symbol('load')}, and excitation, Hz"
    figure, axes = new_picture(place, "1 - coherence", width=width, height=3.4)
    low = unexplained > 1.0 - _FLAGGED
    at = np.arange(len(rows))
    for mask, colour, marker, name in ((~low, BLUE, "o", "operating point"), (low, RED, "X", "flagged")):
        if mask.any():
            axes.plot(at[mask], unexplained[mask], marker, markersize=6, color=colour, label=name)
    axes.axhline(1.0 - _FLAGGED, color=INK, linestyle="--", linewidth=1.0, label="flagged above")
    logarithmic(axes)
    axes.set_ylim(0.5 * unexplained.min(), 1.0)
    set_point_ticks(axes, rows)
    axes.grid(axis="x", visible=False)
    add_legend(axes)
    return figure


_REJECTED = 0.3
_NAMED = 6  # rejected windows that are named in the picture


@plot
def window_weights(result: PointResult | DynamicStiffness) -> Figure:
    """Draw the final weight of every record window, 1 fully used, 0 thrown out.

    Parameters
    ----------
    result : PointResult or DynamicStiffness
        From a `PointResult` the rejected windows carry run, time and reason.
    """
    estimate = result.stiffness if hasattr(result, "stiffness") else result
    weights = estimate.weights
    if not weights.size:
        raise ValueError("the estimate has no windows")
    figure, axes = new_picture("window, in the order of the runs", "robust weight", width=6.4)
    at = np.arange(1, len(weights) + 1)
    names = ["horizontal force", "vertical force"]
    if np.allclose(weights[:, 0], weights[:, 1], equal_nan=True):
        names = ["both forces"]
    for number, name in enumerate(names):
        style = style_of(number) | {"linestyle": "none", "markersize": 4.5 - number}
        axes.vlines(at, 0.0, weights[:, number], color=style["color"], linewidth=0.6, alpha=0.5)
        face = style["color"] if number else PAPER
        axes.plot(at, weights[:, number], **style, markerfacecolor=face, label=name)
    axes.axhline(_REJECTED, color=INK, linestyle="--", linewidth=0.9, label="counted as outlier below")
    axes.set(xlim=(0.0, len(weights) + 1), ylim=(-0.03, 1.08))
    rejected = sorted(getattr(result, "rejected", ()), key=lambda w: w.weight)
    if rejected:
        words = listed([f"{w.run} at {w.time:.2f} s: {w.reason}" for w in rejected], _NAMED, "\n")
        box = {"facecolor": PAPER, "edgecolor": RULE, "alpha": 0.85}
        axes.text(0.015, 0.42, words, transform=axes.transAxes, fontsize=SMALL, va="bottom", bbox=box)
    add_legend(axes)
    return figure
