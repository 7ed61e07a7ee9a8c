"""Pictures of how far an operating point is explained: coherence by point, robust weight by record window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.columns import symbol
from tpjb_ident.report.drawing.picture import (
    FONT_SIZE,
    INK,
    LIGHT,
    PAPER,
    RULE,
    add_legend,
    label,
    new_picture,
    new_pictures,
)
from tpjb_ident.report.drawing.series import as_table, set_point_ticks

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.results.point_result import PointResult

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
    axes.axhline(_REJECTED, color=INK, linestyle=(0, (5, 2)), linewidth=0.9, label="counted as outlier below")
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
