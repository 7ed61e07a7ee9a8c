"""Confusion: which effect was hidden, and what the diagnosis said."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tpjb_ident.report.drawing.colours import LIGHT, SEQUENTIAL
from tpjb_ident.report.drawing.picture import CHARACTER, FONT_SIZE, WIDTH, label, new_pictures, shrink

if TYPE_CHECKING:
    import pandas as pd

WIDE, HIGH = 0.26, 0.2  # of a cell [inches]
#: Ink and paper that stay as they are on their coloured ground when the page turns dark.
ON_PALE, ON_DEEP, WRONG = "#1b1f23", "#fcfcfc", "#d35400"


def confusion(
    matrix: pd.DataFrame, apart: Collection[str] = (), *, absent: bool = False, title: str | None = None
) -> Figure:
    """Draw a confusion matrix: a row per hidden effect, a column per answer, shares of the row as shades.

    Parameters
    ----------
    matrix : DataFrame
        First column: names of what was hidden; further columns: counts per answer.
    apart : collection of str
        Answers that name no effect; a line keeps them apart.
    absent : bool
        The hidden effects were missing from the library: nothing on the diagonal could be right.
    title : str, optional

    Returns
    -------
    Figure
        Right names are framed, other single names red where there are any.
    """
    hidden = [str(name) for name in matrix.iloc[:, 0]]
    said = [str(name) for name in matrix.columns[1:]]
    counts = matrix.iloc[:, 1:].to_numpy(dtype=float)
    if not hidden or not said:
        raise ValueError("the matrix is empty; there is nothing to draw")
    rows, columns = ([name.replace("_", " ") for name in names] for names in (hidden, said))
    left, below = (0.9 * CHARACTER * max(map(len, words)) for words in (rows, columns))
    figure, ((axes,),) = new_pictures(
        1, 1, title=title, width=max(WIDE * len(said) + left + 0.9, WIDTH), height=HIGH * len(hidden) + below + 0.7
    )
    label(axes, "said", "hidden, and not in the library" if absent else "hidden")
    shrink(axes, left=max(left - 0.2, 0.0), bottom=below)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    axes.imshow(share, cmap=SEQUENTIAL, vmin=0.0, vmax=1.0, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.set_xticks(range(len(said)), columns, rotation=90, fontsize=FONT_SIZE - 1)
    axes.set_yticks(range(len(hidden)), rows, fontsize=FONT_SIZE - 1)
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=FONT_SIZE - 2,
                  color=ON_DEEP if share[i, j] > 0.5 else ON_PALE)  # fmt: skip
        right = hidden[i] == said[j]
        if right or said[j] not in apart:
            axes.add_patch(Rectangle((j - 0.46, i - 0.46), 0.92, 0.92, fill=False, linewidth=1.3,
                                     edgecolor=ON_PALE if right and not absent else WRONG))  # fmt: skip
    line = sum(name not in apart for name in said) - 0.5
    if -0.5 < line < len(said) - 0.5:
        axes.axvline(line, color=LIGHT["ink"], linewidth=0.9)
    return figure
