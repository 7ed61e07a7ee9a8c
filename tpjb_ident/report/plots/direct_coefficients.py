"""Draw measured coefficients of one or several bearings with their 95 % intervals (the paper's Fig. 15, 16)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, from_zero, new_picture
from tpjb_ident.report.drawing.series import CURVE, as_table, axis_of, longest_series, with_errors
from tpjb_ident.schema import KINDS

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification

_BEARING_COLOURS = ("blue", "red", "green", "purple")

#: Marker, line and fill of the entry: full lines for the loaded direction.
_ENTRY_STYLE: dict[str, tuple[str, Any, str | None]] = {
    "xx": ("s", (0, (4, 2)), "paper"),
    "yy": ("o", "-", None),
    "xy": ("<", (0, (1, 1.5)), "paper"),
    "yx": (">", (0, (3, 1, 1, 1)), "paper"),
}


def direct_coefficients(
    bearings: Mapping[str, Identification | pd.DataFrame],
    part: Literal["k", "c"] = "k",
    *,
    over: str = "load",
    entries: tuple[str, ...] = ("xx", "yy"),
    title: str | None = None,
) -> Figure:
    """Draw measured coefficients of one or several bearings with their 95 % intervals (the paper's Fig. 15, 16).

    Parameters
    ----------
    bearings : mapping of str to Identification or DataFrame
        By name; a table as ``coefficients.csv`` or ``comparison.csv``.
    part : {"k", "c"}
        Stiffness or damping.
    over : {"load", "frequency"}
        The longest series over it is drawn; the points that lie apart from it are not.
    entries : tuple of str
        Out of ``"xx"``, ``"xy"``, ``"yx"``, ``"yy"``.
    title : str, optional

    Raises
    ------
    ValueError
        When no bearing was measured at two loads or frequencies.
    """
    kind = KINDS[part]
    column, axis_scale, axis_label = axis_of(over)
    figure, axes = new_picture(axis_label, f"{kind.quantity}, {kind.display_unit}", title=title)
    drawn = False
    for (name, source), colour in zip(bearings.items(), _BEARING_COLOURS * len(bearings), strict=False):
        series = longest_series(as_table(source), over)
        if series is None:
            continue
        drawn = True
        rows = series.drop_duplicates(column).sort_values(column)
        for entry in entries:
            marker, dashes, face = _ENTRY_STYLE[entry]
            key = kind.column(entry)
            value, errors = with_errors(rows, key, kind.display_scale)
            axes.errorbar(
                rows[column] / axis_scale, value, yerr=errors, marker=marker,
                markersize=5, markerfacecolor=LIGHT[face or colour], color=LIGHT[colour],
                linestyle=dashes if len(rows) >= CURVE else "none",
                linewidth=1.3, capsize=3, label=f"{name}, {part}{entry}",
            )  # fmt: skip
    if not drawn:
        raise ValueError(f"no bearing was measured at two points over {over}: give a campaign with a series over it")
    axes.margins(x=0.06)
    if set(entries) <= {"xx", "yy"}:
        from_zero(axes)
    add_legend(axes)
    return figure
