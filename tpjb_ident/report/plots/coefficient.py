"""Draw one coefficient over load or frequency (the paper's Fig. 17 to 20)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigdata.arrays import FloatArray
from tpjb_ident.report.drawing.colours import INK, LIGHT, VARIANT_LABEL, Style, style_of_variant
from tpjb_ident.report.drawing.picture import add_legend, from_zero, label, new_pictures
from tpjb_ident.report.drawing.series import COEFFICIENTS, CURVE, DIRECT, axis_of, longest_series, with_errors
from tpjb_ident.schema import KINDS, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison

#: Intervals of a smaller share [%] are hidden by their marks: then differences get a panel of their own.
_SMALL = 5.0
#: A prediction nearer than this [%] is the measurement itself: it sets no scale.
_EXACT = 1e-3
_BARS: dict[str, Any] = {"fmt": "o", "color": INK, "markersize": 5, "capsize": 3, "linewidth": 1.2, "zorder": 5}


def coefficient(
    comparison: Comparison | pd.DataFrame,
    name: str,
    *,
    over: str = "load",
    title: str | None = None,
) -> Figure:
    """Draw one coefficient over load or frequency (the paper's Fig. 17 to 20).

    Parameters
    ----------
    comparison : Comparison or DataFrame
        What `compare_campaign` gives, or its table (``comparison.csv``). A prediction that needed a pivot beyond its
        measured loads stands in a frame. Where intervals are smaller than their marks, a second panel shows the
        deviations, as far as the closest prediction reaches.
    name : str
        ``"kxx"``, ``"kxy"``, .. ``"cyy"``.
    over : {"load", "frequency"}
        The longest series over it is drawn.
    title : str, optional

    Raises
    ------
    ValueError
        For an unknown coefficient, or when nothing varies over `over`.
    """
    if name not in COEFFICIENTS:
        raise ValueError(f"name must be one of {', '.join(COEFFICIENTS)}; got {name!r}")
    series = longest_series(_comparison_table(comparison), over)
    if series is None:
        raise ValueError(f"the campaign has no two points that differ in {over} alone")
    kind = KINDS[name[0]]
    scale, key = kind.display_scale, coefficient_column(name)
    column, axis_scale, axis_label = axis_of(over)
    measured = series.drop_duplicates(column).dropna(subset=[key]).sort_values(column)
    value, errors = with_errors(measured, key, scale)
    shares = 100.0 * errors / np.maximum(np.abs(value), np.finfo(float).tiny)
    apart = len(value) > 0 and float(np.median(shares)) < _SMALL
    figure, grid = new_pictures(2 if apart else 1, 1, title=title, height=(2.3, 1.5) if apart else 3.1)
    axes = grid[0][0]
    label(axes, axis_label, f"{name}, {kind.display_unit}")
    variants = {str(pivots): rows.sort_values(column) for pivots, rows in series.groupby("pivots", sort=False)}
    styles = {variant: style_of_variant(variant, list(variants)) for variant in variants}
    for variant, rows in variants.items():
        _draw_predicted(axes, rows[f"{key}_predicted"].to_numpy(float) / scale, rows, styles[variant], over)
    axes.errorbar(measured[column] / axis_scale, value, yerr=errors, label="measured, 95 %", **_BARS)
    axes.margins(x=0.06, y=0.1)
    if name in DIRECT:
        from_zero(axes)
    add_legend(axes)
    if apart:
        below = grid[1][0]
        label(below, axis_label, "off measured, %")
        reach = [_draw_deviations(below, rows, styles[variant], key, over) for variant, rows in variants.items()]
        below.errorbar(measured[column] / axis_scale, np.zeros_like(value), yerr=shares, **_BARS)
        below.margins(x=0.06)
        limit = 1.4 * max(float(np.max(shares)), min((r for r in reach if r > _EXACT), default=1.0))
        below.set_ylim(-limit, limit)
    return figure


def _draw_deviations(axes: Axes, rows: pd.DataFrame, style: Style, key: str, over: str) -> float:
    """Draw predicted / measured - 1 [%] of one prediction; how far it reaches."""
    off = 100.0 * (rows[f"{key}_predicted"] / rows[key] - 1.0).to_numpy(float)
    _draw_predicted(axes, off, rows, style, over)
    return float(np.max(np.abs(off), where=np.isfinite(off), initial=0.0))


def _comparison_table(comparison: Comparison | pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    if isinstance(comparison, pd.DataFrame):
        return comparison
    from tpjb_ident.compare.comparison import comparison_frame

    return comparison_frame(comparison)


def _draw_predicted(axes: Axes, y: FloatArray, rows: pd.DataFrame, style: Style, over: str) -> None:
    column, size, _ = axis_of(over)
    variant, (colour, dashes, marker) = str(rows["pivots"].iloc[0]), style
    x = rows[column].to_numpy(float) / size
    line = dashes if len(x) >= CURVE else "none"
    axes.plot(x, y, color=LIGHT[colour], linestyle=line, linewidth=1.6, marker=marker, markersize=4,
              label=VARIANT_LABEL.get(variant, variant))  # fmt: skip
    if variant == "measured" and "pivot_extrapolated" in rows:
        extrapolated = rows["pivot_extrapolated"].to_numpy(bool)
        if extrapolated.any():
            axes.plot(x[extrapolated], y[extrapolated], linestyle="none", marker=marker, markersize=8.5,
                      color=LIGHT[colour], markerfacecolor="none", label="beyond the dry tests")  # fmt: skip
