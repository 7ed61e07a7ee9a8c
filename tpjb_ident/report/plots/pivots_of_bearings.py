"""Fig. 13: the pivot of one pad in several bearings, measured and by the printed formula."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, new_picture
from tpjb_ident.report.plots.pivot_stiffness import LOWEST, POINTS, Formula

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve

STYLE: tuple[tuple[str, Any], ...] = (
    ("blue", "-"),
    ("red", (0, (5, 2))),
    ("green", (0, (3, 1, 1, 1))),
    ("purple", (0, (1, 1.5))),
)


def pivots_of_bearings(
    curves: Mapping[str, PivotCurve],
    formulas: Mapping[str, Formula | None] | None = None,
    *,
    logarithmic: bool = False,
    level: float = 0.95,
    title: str | None = None,
) -> Figure:
    """Draw the tangent stiffness of one pad in several bearings (the paper's Fig. 13).

    Parameters
    ----------
    curves : mapping of str to PivotCurve
        By the bearing's name.
    formulas : mapping of str to callable, optional
        ``formula(pad, load)`` gives (secant, tangent) stiffness [N/m]; the secant is what the formula prints, and both
        are drawn in grey: tangent with the bearing's own dashes, as printed dotted.
    logarithmic : bool
        Logarithmic stiffness: ratios of very different pivots are then distances.
    level : float
        Coverage of the bands.
    title : str, optional
    """
    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    pads = sorted({curve.pad for curve in curves.values()})
    of = f" of pad #{pads[0]}" if len(pads) == 1 else ""
    figure, axes = new_picture("load on the pad, kN", f"tangent stiffness{of}, MN/m", title=title)
    for (name, curve), (colour, dashes) in zip(curves.items(), STYLE * len(curves), strict=False):
        load = np.linspace(max(LOWEST * curve.valid_to, curve.valid_from), curve.valid_to, POINTS)
        low, high = curve.stiffness_band(load, level)
        axes.fill_between(load / 1e3, low / 1e6, high / 1e6, color=LIGHT[colour], alpha=0.2, linewidth=0)
        axes.plot(load / 1e3, curve.stiffness(load) / 1e6, color=LIGHT[colour], linestyle=dashes, linewidth=1.7,
                  label=f"{name}, measured{_pad(curve, of)}")  # fmt: skip
        formula = (formulas or {}).get(name)
        if formula is not None:
            printed = np.array([formula(curve.pad, float(w)) for w in load]) / 1e6
            axes.plot(load / 1e3, printed[:, 1], color=LIGHT[colour], linestyle=dashes, linewidth=0.9, marker="^",
                      markevery=POINTS // 8, markersize=4, label=f"{name}, Kirk tangent")  # fmt: skip
            axes.plot(load / 1e3, printed[:, 0], color=LIGHT[colour], linestyle=(0, (1, 2)), linewidth=0.9, marker="v",
                      markevery=POINTS // 8, markersize=4, label=f"{name}, Kirk printed")  # fmt: skip
    if logarithmic:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    add_legend(axes)
    return figure


def _pad(curve: PivotCurve, already_said: str) -> str:
    return "" if already_said else f", pad #{curve.pad}"
