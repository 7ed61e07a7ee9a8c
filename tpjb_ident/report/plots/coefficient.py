"""Draw one coefficient over load or frequency (the paper's Fig. 17 to 20)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import INK, LIGHT, VARIANT_LABEL, VARIANT_STYLE
from tpjb_ident.report.drawing.picture import add_legend, new_picture
from tpjb_ident.report.drawing.series import DIRECT, axis_of, longest_series, with_errors
from tpjb_ident.schema import COEFFICIENT_COLUMNS, KINDS, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison


def coefficient(
    comparison: Comparison | pd.DataFrame,
    name: str,
    *,
    over: Literal["load", "frequency"] = "load",
    title: str | None = None,
) -> Figure:
    """Draw one coefficient over load or frequency (the paper's Fig. 17 to 20).

    Parameters
    ----------
    comparison : Comparison or DataFrame
        What `compare_campaign` gives, or its table (``comparison.csv``). A prediction that needed a pivot beyond its
        measured loads stands in a frame.
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
    names = [column[:3] for column in COEFFICIENT_COLUMNS]
    if name not in names:
        raise ValueError(f"name must be one of {', '.join(names)}; got {name!r}")
    series = longest_series(_comparison_table(comparison), over)
    if series is None:
        raise ValueError(f"the campaign has no two points that differ in {over} alone")
    kind = KINDS[name[0]]
    scale, key = kind.display_scale, coefficient_column(name)
    column, axis_scale, axis_label = axis_of(over)
    figure, axes = new_picture(axis_label, f"{name}, {kind.display_unit}", title=title)
    for variant in dict.fromkeys(series["pivots"]):
        rows = series[series["pivots"] == variant].sort_values(column)
        _draw_predicted(axes, rows[column] / axis_scale, rows[f"{key}_predicted"] / scale, rows, str(variant))
    measured = series.drop_duplicates(column).dropna(subset=[key]).sort_values(column)
    value, errors = with_errors(measured, key, scale)
    axes.errorbar(
        measured[column] / axis_scale, value, yerr=errors, fmt="o", color=INK,
        markersize=5, capsize=3, linewidth=1.2, label="measured, 95 %", zorder=5,
    )  # fmt: skip
    axes.margins(x=0.06, y=0.1)
    if name in DIRECT:
        axes.set_ylim(bottom=0.0)
    add_legend(axes)
    return figure


def _comparison_table(comparison: Comparison | pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    if isinstance(comparison, pd.DataFrame):
        return comparison
    from tpjb_ident.compare.comparison import comparison_frame

    return comparison_frame(comparison)


def _draw_predicted(axes: Axes, over: pd.Series, predicted: pd.Series, rows: pd.DataFrame, variant: str) -> None:
    colour, dashes, marker = VARIANT_STYLE.get(variant, ("green", (0, (4, 1, 1, 1)), "*"))
    x, y = over.to_numpy(float), predicted.to_numpy(float)
    axes.plot(x, y, color=LIGHT[colour], linestyle=dashes, linewidth=1.6, marker=marker, markersize=4,
              label=VARIANT_LABEL.get(variant, variant))  # fmt: skip
    if variant == "measured" and "pivot_extrapolated" in rows:
        extrapolated = rows["pivot_extrapolated"].to_numpy(bool)
        if extrapolated.any():
            axes.plot(x[extrapolated], y[extrapolated], linestyle="none", marker=marker, markersize=8.5,
                      color=LIGHT[colour], markerfacecolor="none", label="beyond the dry tests")  # fmt: skip
