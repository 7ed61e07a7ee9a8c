"""One case: the gap of every observable, before and after, beside its controls."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import CHARACTER, LEFT, add_legend, new_picture, shrink

if TYPE_CHECKING:
    import pandas as pd

#: Column of the table, colour, marker, filled, height within its row, words.
SERIES = (
    ("baseline", "orange", "s", True, -0.1, "baseline"),
    ("named", "blue", "o", True, -0.1, "with the effects found"),
    ("wrong effect", "red", "X", True, -0.1, "with the best wrong effect"),
    ("gaussian process", "green", "D", False, -0.1, "with a Gaussian process"),
    ("placebo before", "grey", "s", False, 0.25, "placebo: nothing hidden"),
    ("placebo after", "grey", "o", False, 0.25, "placebo, best effect added"),
)


def case_gaps(table: pd.DataFrame, *, title: str | None = None) -> Figure:
    """Draw the root mean square residual of every observable on points that no fit has seen.

    Parameters
    ----------
    table : DataFrame
        ``observable`` and a column per model (`SERIES`), in standard deviations.
    title : str, optional

    Returns
    -------
    Figure
    """
    if not len(table):
        raise ValueError("the table is empty; there is nothing to draw")
    words = [str(name).replace("_", " ") for name in table["observable"]]
    figure, axes = new_picture("held-out residual, root mean square, standard deviations", "", title=title,
                               height=0.3 * len(words) + 1.7)  # fmt: skip
    shrink(axes, left=max(CHARACTER * max(map(len, words)) + 0.2 - LEFT, 0.0))
    y = np.arange(len(words))
    if {"baseline", "named"} <= set(table.columns):
        axes.hlines(y - 0.1, table["named"], table["baseline"], color=LIGHT["rule"], linewidth=2.0)
    for column, colour, marker, full, offset, name in SERIES:
        if column in table:
            axes.plot(table[column], y + offset, marker, color=LIGHT[colour], markersize=5.0,
                      fillstyle="full" if full else "none", label=name)  # fmt: skip
    axes.axvline(1.0, color=LIGHT["ink"], linewidth=0.9, linestyle=(0, (2, 2)), label="noise, tolerance, calibration")
    axes.set_yticks(y, words)
    axes.set_ylim(len(words) - 0.4, -0.6)
    axes.set_xlim(left=0.0)
    axes.grid(axis="y", visible=False)
    add_legend(axes, 2, across=True)
    return figure
