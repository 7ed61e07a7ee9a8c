"""Draw what part of the force the displacements do not explain, 1 - coherence, for every operating point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.columns import symbol
from tpjb_ident.report.drawing.colours import INK, LIGHT
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures
from tpjb_ident.report.drawing.series import as_table, set_point_ticks

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification

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
    figure, ((axes,),) = new_pictures(1, 1, title=title, width=width, height=3.4)
    label(axes, f"static load, {symbol('load')}, and excitation, Hz", "1 - coherence")
    low = unexplained > 1.0 - _FLAGGED
    at = np.arange(len(rows))
    for mask, colour, marker, name in ((~low, "blue", "o", "operating point"), (low, "red", "X", "flagged")):
        if mask.any():
            axes.plot(at[mask], unexplained[mask], linestyle="none", marker=marker, markersize=6, color=LIGHT[colour],
                      label=name)  # fmt: skip
    axes.axhline(1.0 - _FLAGGED, color=INK, linestyle=(0, (5, 2)), linewidth=1.0, label="flagged above")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")  # powers of ten are set by a parser that takes longer than the picture
    axes.set_ylim(0.5 * float(unexplained.min()), 1.0)
    set_point_ticks(axes, rows)
    axes.grid(axis="x", visible=False)
    add_legend(axes)
    return figure
