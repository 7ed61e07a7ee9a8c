"""Coverage: how often the interval of a rightly named effect holds the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import CHARACTER, FONT_SIZE, LEFT, add_legend, new_picture, shrink

if TYPE_CHECKING:
    import pandas as pd


def interval_coverage(table: pd.DataFrame, level: float = 0.95, *, title: str | None = None) -> Figure:
    """Draw the share of intervals that hold the truth, per effect, with binomial 95 % intervals of that share.

    Parameters
    ----------
    table : DataFrame
        Columns ``effect``, ``intervals``, ``share``, ``share_lo``, ``share_hi``; lines that begin with "all" are
        drawn full.
    level : float
        Stated.
    title : str, optional

    Returns
    -------
    Figure
    """
    known = table[table["intervals"] > 0]
    if not len(known):
        raise ValueError("no interval was counted; there is nothing to draw")
    words = [str(name).replace("_", " ") for name in known["effect"]]
    figure, axes = new_picture("share of 95 % intervals that hold the truth", "", title=title,
                               height=0.22 * len(words) + 1.3)  # fmt: skip
    shrink(axes, left=max(CHARACTER * max(map(len, words)) + 0.2 - LEFT, 0.0), right=0.45)
    axes.axvline(level, color=LIGHT["ink"], linestyle=(0, (2, 2)), linewidth=0.9, label=f"stated: {level:g}")
    share = known["share"].to_numpy(dtype=float)
    low, high = (known[f"share_{end}"].to_numpy(dtype=float) for end in ("lo", "hi"))
    y = np.arange(len(words))
    whole = np.array([word.startswith("all") for word in words])
    for mine, colour, fill, name in (
        (whole, "blue", "blue", "all effects"), (~whole, "grey", "paper", "one effect, d' = 6 and more"),
    ):  # fmt: skip
        if mine.any():
            bars = np.abs(np.array([share - low, high - share]))[:, mine]
            axes.errorbar(share[mine], y[mine], xerr=bars, fmt="o", color=LIGHT[colour], markersize=4.5,
                          markerfacecolor=LIGHT[fill], capsize=2.5, linewidth=1.1, label=name)  # fmt: skip
    for at, n in zip(y, known["intervals"], strict=True):
        axes.annotate(f"{n:.0f}", (1.0, at), xycoords=("axes fraction", "data"), xytext=(6, 0),
                      textcoords="offset points", va="center", fontsize=FONT_SIZE - 1, color=LIGHT["ink"])  # fmt: skip
    axes.set_yticks(y, words)
    axes.set_ylim(len(words) - 0.4, -0.6)
    axes.set_xlim(min(0.5, float(low.min())) - 0.02, 1.01)
    axes.grid(axis="y", visible=False)
    add_legend(axes, across=True)
    return figure
