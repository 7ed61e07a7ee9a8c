"""Power: how often an effect is seen, and named, against its size."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import LINE, add_legend, label, new_pictures

if TYPE_CHECKING:
    import pandas as pd

SERIES = (
    ("detected", "detected", "blue", "-", "o"),
    ("right", "named, or in a group of at most three", "green", (0, (5, 2)), "s"),
    ("named_right", "named alone", "orange", (0, (3, 1, 1, 1)), "^"),
    ("named_wrong", "wrong single name", "red", (0, (1, 1.5)), "X"),
)


def power(table: pd.DataFrame, *, title: str | None = None) -> Figure:
    """Draw shares of detected, rightly and wrongly named effects against d', with 95 % intervals.

    Parameters
    ----------
    table : DataFrame
        As of `tests.studies.evidence.measures.power_table`; where there are several noises their sum is drawn. One
        panel per rung.
    title : str, optional

    Returns
    -------
    Figure
    """
    rungs = list(dict.fromkeys(table["rung"]))
    if not rungs:
        raise ValueError("the table is empty; there is nothing to draw")
    figure, (panels,) = new_pictures(1, len(rungs), title=title, height=3.4 + 2 * LINE)
    for axes, name in zip(panels, rungs, strict=True):
        mine = table[table["rung"] == name].sort_values("size_sigma")
        mine = mine[(mine["noise_factor"] == "all") | ~mine["size_sigma"].isin(_pooled(mine))]
        trials = ", ".join(f"{n:.0f}" for n in mine["trials"])
        label(axes, "size of the hidden effect d', standard deviations", "share of campaigns",
              f"{name} ({trials} campaigns)")  # fmt: skip
        axes.set_xscale("log")
        sizes = mine["size_sigma"].to_numpy(dtype=float)
        for k, (column, words, colour, dashes, marker) in enumerate(SERIES):
            at = sizes * 1.03 ** (k - 1.5)  # intervals side by side
            y = mine[column].to_numpy(dtype=float)
            bars = np.abs(np.array([y - mine[f"{column}_lo"], mine[f"{column}_hi"] - y], dtype=float))
            axes.errorbar(at, y, yerr=bars, color=LIGHT[colour], linestyle=dashes, marker=marker, markersize=4.5,
                          capsize=2.5, linewidth=1.3, elinewidth=0.9, label=words)  # fmt: skip
        axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axes.minorticks_off()
        axes.set_xlim(0.8 * sizes.min(), 1.25 * sizes.max())
        axes.set_ylim(-0.03, 1.03)
        add_legend(axes)
    return figure


def _pooled(table: pd.DataFrame) -> list[float]:
    return [float(size) for size in table.loc[table["noise_factor"] == "all", "size_sigma"]]
