"""Draw the stiffness of every pad's pivot over its load (the paper's Fig. 12)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from rigdata.arrays import FloatArray
from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.colours import INK, style_of_pad
from tpjb_ident.report.drawing.picture import add_legend, mark_extrapolated, new_picture

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve

Formula = Callable[[int, float], tuple[float, float]]

_STIFFNESS_POINTS = 120

_LOWEST = 0.04  # of the largest load: Hertz's stiffness has no value at zero


def pivot_stiffness(
    curves: Sequence[PivotCurve],
    formula: Formula | None = None,
    *,
    loads: ArrayLike | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the stiffness of every pad's pivot over its load (the paper's Fig. 12).

    Thick where it was measured with the shaft fully in contact; thin and dotted where it is extrapolated, below the
    contact onset as well as beyond the largest load (shaded).

    Parameters
    ----------
    curves : sequence of PivotCurve
    formula : callable, optional
        ``formula(pad, load)`` gives the printed formula's (secant, tangent) stiffness [N/m], as
        `tpjb_ident.compare.predictions.printed_formula` makes it; drawn for the first curve's pad. What the
        paper prints is the secant.
    loads : (n,) array_like, optional
        Pad loads [N]; default: up to the largest measured one.
    title : str, optional
    """
    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    top = max(curve.valid_to for curve in curves)
    grid = np.linspace(_LOWEST * top, top, _STIFFNESS_POINTS) if loads is None else np.asarray(loads, dtype=float)
    figure, axes = new_picture(
        f"load on the pad, {symbol('load')}", f"tangent stiffness, {symbol('stiffness')}", title=title
    )
    for curve in curves:
        _draw_stiffness(axes, curve, grid)
    if formula is not None:
        printed = np.array([formula(curves[0].pad, float(load)) for load in grid]) * per("stiffness")
        axes.plot(grid * per("load"), printed[:, 1], color=INK, linewidth=1.3, label="Kirk, tangent")
        axes.plot(grid * per("load"), printed[:, 0], color=INK, linewidth=1.3, linestyle=(0, (5, 2)),
                  label="Kirk, printed")  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, float(grid[-1]) * per("load"))
    mark_extrapolated(axes, top * per("load"))
    add_legend(axes)
    return figure


def _draw_stiffness(axes: Axes, curve: PivotCurve, grid: FloatArray) -> None:
    colour, dashes, _ = style_of_pad(curve.pad)
    value, band = curve.stiffness(grid) * per("stiffness"), curve.stiffness_band(grid)
    outside = curve.is_extrapolated(grid)
    low, high = (np.where(outside, np.nan, b * per("stiffness")) for b in band)
    axes.fill_between(grid * per("load"), low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(grid * per("load"), np.where(outside, np.nan, value), color=colour, linestyle=dashes, linewidth=1.7,
              label=f"pad #{curve.pad}")  # fmt: skip
    # one point of overlap, so that the two lines meet
    extrapolated = np.where(outside | np.roll(outside, 1) | np.roll(outside, -1), value, np.nan)
    axes.plot(grid * per("load"), extrapolated, color=colour, linestyle=(0, (1, 2)), linewidth=0.9)
