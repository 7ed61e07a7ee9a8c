"""Draw measured load and displacement vectors of every pad's test beside their projection (the paper's Fig. 10)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rigdata.arrays import FloatArray
from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.colours import GREY, INK, style_of_pad
from tpjb_ident.report.drawing.picture import FONT_SIZE, add_legend, label, new_pictures

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve


def pad_projection(curves: Sequence[PivotCurve], *, title: str | None = None) -> Figure:
    """Draw measured load and displacement vectors of every pad's test beside their projection (the paper's Fig. 10).

    Hollow markers are what was measured, filled ones its projection on the pad's direction (dashed). Displacements
    count from where each pad's curve has its zero. The angles between load or displacement and the pad stand at the
    ends of the dashed lines, with their standard errors.

    Parameters
    ----------
    curves : sequence of PivotCurve
        As `fit_pivots` gives them.
    title : str, optional

    Returns
    -------
    Figure
        Left the loads [kN], right the displacements [µm].
    """
    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    figure, ((forces, places),) = new_pictures(1, 2, title=title, width=4.4, height=4.8)
    for curve in curves:
        steps = curve.steps
        used = steps.weight > 0
        load, across_load = steps.load[used] * per("load"), steps.across_load[used] * per("load")
        move, across = per("length") * steps.deflection[used], per("length") * steps.across_deflection[used]
        _draw_vectors(forces, curve, load, across_load, curve.load_direction.angle)
        _draw_vectors(places, curve, move, across, curve.displacement_direction.angle)
    label(forces, f"horizontal load, {symbol('load')}", f"vertical load, {symbol('load')}", "static load")
    label(places, f"x, {symbol('length')}", f"y, {symbol('length')}", "displacement, shaft against housing")
    for axes in (forces, places):
        reach = 1.45 * max(float(np.max(np.abs(line.get_xydata()))) for line in axes.get_lines()) / 1.12
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        axes.set_aspect("equal", adjustable="box")
    handles = [
        Line2D([], [], marker="o", linestyle="none", color=INK, markerfacecolor="none", label="measured"),
        Line2D([], [], marker="o", linestyle="none", color=INK, label="on the pad's direction"),
    ]
    for axes in (forces, places):
        add_legend(axes, 2, handles)
    return figure


def _draw_vectors(axes: Axes, curve: PivotCurve, along: FloatArray, across: FloatArray, off: float) -> None:
    """One pad's points, measured and projected, and its direction."""
    colour, _, marker = style_of_pad(curve.pad)
    axis = np.array([math.cos(curve.angle), math.sin(curve.angle)])
    side = np.array([-axis[1], axis[0]])
    projected = np.outer(along, axis)
    measured = projected + np.outer(across, side)
    end = 1.12 * float(np.max(along)) * axis
    axes.plot([0.0, end[0]], [0.0, end[1]], color=GREY, linestyle=(0, (5, 3)), linewidth=0.9, zorder=1)
    axes.plot(*measured.T, linestyle="none", marker=marker, markersize=5.5, markerfacecolor="none",
              markeredgewidth=1.0, color=colour)  # fmt: skip
    axes.plot(*projected.T, linestyle="none", marker=marker, markersize=3.0, color=colour)
    text = f"#{curve.pad}\n{math.degrees(off):+.1f}°"
    axes.annotate(
        text, (end[0], end[1]), xytext=(12.0 * axis[0], 12.0 * axis[1]), textcoords="offset points", ha="center",
        va="center", fontsize=FONT_SIZE - 1, color=INK,
    )  # fmt: skip
