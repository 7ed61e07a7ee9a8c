"""Draw the amplitudes of displacement and force over frequency (Hann window over the whole record)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from rigdata.survey.spectrum import amplitude_spectrum
from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.colours import GREY, INK, LIGHT
from tpjb_ident.report.drawing.picture import FONT_SIZE, add_legend, label, new_pictures

if TYPE_CHECKING:
    from rigdata.run import Run

#: Quantity, how its amplitude is named, and its display unit in SI.
_ROWS = (("displacement", "length"), ("force", "force"))

_AXIS_STYLE: tuple[tuple[str, str, Any], ...] = (("horizontal", "blue", "-"), ("vertical", "red", (0, (5, 2))))

#: Bins of a window's foot below which there is drift, not vibration.
_DRIFT = 4


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
    drive = run.point.excitation_hz if run.point.excitation else None
    top = up_to or (4.0 * drive if drive else 0.5 * run.sample_rate)
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
