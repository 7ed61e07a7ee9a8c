"""Draw how far each effect stands from what every other one can imitate, in standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from tpjb_ident.compare.effect_words import label_in_words
from tpjb_ident.report.drawing.colours import RED, SEQUENTIAL
from tpjb_ident.report.drawing.picture import (
    CHARACTER,
    FONT_SIZE,
    add_colour_bar,
    label,
    new_pictures,
    shrink,
)

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.plan import CampaignPlan

_CELL = 0.3  # [inches]

_TALL = 2.0  # the colour bar needs it [inches]

_CONFUSABLE = 3.0

_VISIBLE = 6.0


def isolability(
    plan: CampaignPlan | ArrayLike, names: Sequence[str] | None = None, *, title: str | None = None
) -> Figure:
    """Draw how far each effect stands from what every other one can imitate, in standard deviations.

    Row A, column B: distance of A, at a size that is seen with 6 standard deviations, from all that B can do. Pairs
    below 3 are framed: the campaign could not tell them apart. Blank rows are effects that it does not see at all.

    Parameters
    ----------
    plan : CampaignPlan or (k, k) array_like
        As `tpjb_ident.diagnosis.plan.plan` makes it, or its matrix.
    names : sequence of str, optional
        Of the k effects; default: the plan's own.
    title : str, optional
    """
    matrix = np.asarray(getattr(plan, "separation", plan), dtype=float)
    names = names or [c.label for c in getattr(plan, "candidates", ())]
    k = len(matrix)
    if matrix.shape != (k, k) or len(names) != k:
        raise ValueError(f"the matrix must be square with one name per row, got shape {matrix.shape}")
    words = [label_in_words(name) for name in names]
    room = CHARACTER * max(len(word) for word in words)
    # the panel's own margins and the colour bar come on top of cells and names
    figure, ((axes,),) = new_pictures(
        1, 1, title=title, width=_CELL * k + room + 2.0, height=max(_CELL * k, _TALL) + room + 1.0
    )
    label(axes, "could pass for (framed: closer than 3)", "effect at work")
    shrink(axes, left=room - 0.1, bottom=room - 0.1)
    image = axes.imshow(matrix, cmap=SEQUENTIAL, vmin=0.0, vmax=_VISIBLE, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.set_xticks(range(k), words, rotation=90, fontsize=FONT_SIZE - 1)
    axes.set_yticks(range(k), words, fontsize=FONT_SIZE - 1)
    for i, j in zip(*np.nonzero(matrix < _CONFUSABLE), strict=True):
        axes.add_patch(Rectangle((j - 0.45, i - 0.45), 0.9, 0.9, fill=False, edgecolor=RED, linewidth=1.2))
    add_colour_bar(axes, image, "distance, standard deviations")
    return figure
