"""Draw the final weight of every record window, 1 fully used, 0 thrown out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import INK, LIGHT, PAPER, RULE
from tpjb_ident.report.drawing.picture import FONT_SIZE, add_legend, new_picture

if TYPE_CHECKING:
    from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
    from tpjb_ident.dynamic.results.point_result import PointResult

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
