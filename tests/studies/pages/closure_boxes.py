"""Closure: how much of the gap is closed on held-out points, by the right name and by three controls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import LINE, add_legend, label, new_pictures

if TYPE_CHECKING:
    import pandas as pd

STYLE = {
    "effect named": ("blue", None),
    "Gaussian process": ("green", "...."),
    "best wrong effect": ("orange", "////"),
    "placebo: fall per point": ("grey", "xxxx"),
}
PLACEBO = "placebo: fall per point"


def closures(table: pd.DataFrame, *, title: str | None = None) -> Figure:
    """Draw quantiles of the closure per size, beside the placebo.

    Boxes reach from the first to the third quartile, whiskers from 5 to 95 %, a line marks the median.

    Parameters
    ----------
    table : DataFrame
        As of `tests.studies.evidence.measures.closure_table`, of one rung.
    title : str, optional

    Returns
    -------
    Figure
    """
    hidden, placebo = table[table["closed_by"] != PLACEBO], table[table["closed_by"] == PLACEBO]
    rungs = sorted(set(table["rung"]))
    if len(rungs) != 1:
        raise ValueError(f"the table must hold one rung, got {', '.join(rungs) or 'none'}")
    parts = [part for part in (hidden, placebo) if len(part)]
    figure, (panels,) = new_pictures(1, len(parts), title=title, height=3.6 + LINE)
    for axes, part in zip(panels, parts, strict=True):
        if part is hidden:
            _by_size(axes, part)
        else:
            _placebo(axes, part)
    return figure


def _by_size(axes: Axes, part: pd.DataFrame) -> None:
    sizes = sorted(part["size_sigma"].unique())
    label(axes, "size of the hidden effect d', standard deviations (campaigns)", "share of the squared gap closed",
          "points that no fit has seen")  # fmt: skip
    names = [name for name in STYLE if name in set(part["closed_by"])]
    for k, name in enumerate(names):
        for line in part[part["closed_by"] == name].to_dict("records"):
            at = sizes.index(line["size_sigma"]) + 0.26 * (k - 0.5 * (len(names) - 1))
            _box(axes, at, line, name, first=line["size_sigma"] == sizes[0])
    counts = part[part["closed_by"] == names[0]].set_index("size_sigma")["campaigns"]
    axes.set_xticks(range(len(sizes)), [f"{size:g} ({counts.get(size, 0):.0f})" for size in sizes])
    axes.set_xlim(-0.6, len(sizes) - 0.4)
    for level, dashes in ((0.0, "-"), (1.0, (0, (2, 2)))):
        axes.axhline(level, color=LIGHT["ink"], linewidth=0.8, linestyle=dashes)
    axes.set_ylim(min(-0.3, float(part["q05"].min()) - 0.1), max(1.6, float(part["q95"].max()) + 0.1))
    add_legend(axes)


def _placebo(axes: Axes, part: pd.DataFrame) -> None:
    label(axes, "", "fall of the squared misfit per point", "placebo: nothing hidden, best effect added all the same")
    for at, line in enumerate(part.to_dict("records")):
        _box(axes, at, line, PLACEBO, first=False)
    names = [f"{name} ({n:.0f})" for name, n in zip(part["rung"], part["campaigns"], strict=True)]
    axes.set_xticks(range(len(part)), names)
    axes.set_xlim(-0.8, len(part) - 0.2)
    axes.axhline(0.0, color=LIGHT["ink"], linewidth=0.8)
    reach = 1.3 * float(np.abs(part[["q05", "q95"]].to_numpy(dtype=float)).max())
    axes.set_ylim(-max(reach, 0.5), max(reach, 0.5))


def _box(axes: Axes, at: float, line: dict[Any, Any], name: str, first: bool) -> None:
    colour, hatch = STYLE[name]
    axes.vlines(at, line["q05"], line["q95"], color=LIGHT[colour], linewidth=1.2)
    axes.bar(at, line["q75"] - line["q25"], 0.2, bottom=line["q25"], hatch=hatch, edgecolor=LIGHT[colour],
             color=LIGHT[colour] if hatch is None else LIGHT["paper"], linewidth=0.9,
             label=name if first else None)  # fmt: skip
    axes.hlines(line["median"], at - 0.1, at + 0.1, color=LIGHT["ink"], linewidth=1.6)
