"""Draw the settled steps of dry tests and the laws fitted to them (the paper's Fig. 11)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.colours import INK, PAPER, style_of_pad
from tpjb_ident.report.drawing.picture import add_legend, from_zero, new_picture

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve

_LAW_POINTS = 200


def load_deflection(
    curves: PivotCurve | Sequence[PivotCurve],
    *,
    up_to: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the settled steps of dry tests and the laws fitted to them (the paper's Fig. 11).

    Steps that were left out are crossed; unloading steps are hollow. The law is drawn solid where it was measured with
    full contact and dotted elsewhere (extrapolated); where the shaft comes down on the pad first, a thin line shows
    what the readings do meanwhile.

    Parameters
    ----------
    curves : PivotCurve or sequence of PivotCurve
        One or several pads.
    up_to : float, optional
        Largest load [N]; default: the largest measured one.
    title : str, optional
    """
    chosen = list(curves) if isinstance(curves, Sequence) else [curves]
    if not chosen:
        raise ValueError("curves must hold at least one PivotCurve")
    figure, axes = new_picture(
        f"radial deflection, {symbol('length')}", f"load on the pad, {symbol('load')}", title=title
    )
    for curve in chosen:
        _draw_law(axes, curve, up_to or curve.valid_to)
        _draw_steps(axes, curve)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    from_zero(axes)
    named = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    add_legend(axes, handles=[named[name] for name in sorted(named)])  # pad by pad, what was left out last
    return figure


def _draw_steps(axes: Axes, curve: PivotCurve) -> None:
    colour, _, marker = style_of_pad(curve.pad)
    steps = curve.steps
    deflection, load = per("length") * steps.deflection, per("load") * steps.load
    for mask, face, name in (
        ((steps.weight > 0) & (steps.branch > 0), colour, f"pad #{curve.pad}, {curve.law.name}"),
        ((steps.weight > 0) & (steps.branch < 0), PAPER, f"pad #{curve.pad}, unloading"),
    ):
        if mask.any():
            axes.errorbar(
                deflection[mask], load[mask], xerr=1.96 * per("length") * steps.deflection_se[mask],
                fmt=marker, color=colour, markerfacecolor=face, markersize=4.5, linewidth=0.9, capsize=0, label=name,
                zorder=4,
            )  # fmt: skip
    bad = steps.weight == 0
    if bad.any():
        axes.plot(deflection[bad], load[bad], linestyle="none", marker="x", markersize=6,
                  color=INK, label="step left out", zorder=5)  # fmt: skip


def _draw_law(axes: Axes, curve: PivotCurve, top: float) -> None:
    """The law, its band, and the way into contact."""
    colour, _, _ = style_of_pad(curve.pad)
    load = np.linspace(0.0, top, _LAW_POINTS)[1:]
    reading, low, high = (per("length") * part for part in curve.reading_band(load))
    measured = ~curve.is_extrapolated(load)
    axes.fill_betweenx(load * per("load"), low, high, color=colour, alpha=0.25, linewidth=0)
    deflection = per("length") * curve.deflection(load)
    axes.plot(deflection, load * per("load"), color=colour, linestyle=(0, (1, 1.5)), linewidth=1.2)
    axes.plot(np.where(measured, deflection, np.nan), load * per("load"), color=colour, linewidth=1.5)
    if curve.law.contact:
        coming = load <= max(curve.onset_load, load[0])
        axes.plot(reading[coming], load[coming] * per("load"), color=colour, linewidth=0.7)
