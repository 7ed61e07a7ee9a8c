"""Stiffness and damping over load and over frequency: measured with intervals, predicted as lines (Fig. 15 to 20)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from tpjb_ident.report.figure import LIGHT, VARIANT_LABEL, VARIANT_STYLE, Panel, add_legend, new_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNITS = {"k": ("N_per_m", 1e6, "MN/m", "stiffness"), "c": ("Ns_per_m", 1e3, "kN s/m", "damping")}
AXES = {
    "load": ("static_load_N", 1e3, "static load, kN"),
    "frequency": ("excitation_Hz", 1.0, "excitation frequency, Hz"),
}
DIRECT = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")
STATIC = ["static_load_direction_deg", "shaft_speed_Hz"]


def coefficient_panels(table: pd.DataFrame) -> list[Panel]:
    """Draw every series of at least two points.

    Parameters
    ----------
    table : DataFrame
        As comparison.csv.

    Returns
    -------
    list of Panel
        Direct coefficients over load and over frequency, then cross-coupled ones.
    """
    panels = []
    for axis in AXES:
        series = longest_series(table, axis)
        if series is None:
            continue
        for names, kind in ((DIRECT, "Stiffness and damping"), (CROSS, "Cross-coupled stiffness and damping")):
            panels += [_panel(series, name, axis, f"{kind} over {axis}") for name in names]
    return panels


def longest_series(table: pd.DataFrame, axis: str) -> pd.DataFrame | None:
    """Rows of the longest series over load (at one frequency) or over frequency (at one load); None if none varies."""
    column = AXES[axis][0]
    fixed = ["excitation_Hz" if axis == "load" else "static_load_N", *STATIC]
    best, length = None, 1
    for _, group in table.groupby(fixed, sort=True):
        if group[column].nunique() > length:
            best, length = group, group[column].nunique()
    return best


def _where(series: pd.DataFrame, axis: str) -> str:
    first = series.iloc[0]
    fixed = f"{first.excitation_Hz:g} Hz excitation" if axis == "load" else f"{first.static_load_N / 1e3:g} kN"
    return f"{fixed}, {first.shaft_speed_Hz:g} Hz shaft speed"


def _panel(series: pd.DataFrame, name: str, axis: str, group: str) -> Panel:
    suffix, scale, unit, quantity = UNITS[name[0]]
    column, axis_scale, axis_label = AXES[axis]
    figure, axes = new_panel(axis_label, f"{name}, {unit}")
    key = f"{name}_{suffix}"
    for variant in VARIANT_STYLE:
        rows = series[series["pivots"] == variant].sort_values(column)
        if len(rows):
            _line(axes, rows[column] / axis_scale, rows[f"{key}_predicted"] / scale, variant)
    measured = series.drop_duplicates(column).sort_values(column)
    values, low, high = (measured[f"{key}{end}"].to_numpy() / scale for end in ("", "_lo", "_hi"))
    axes.errorbar(
        measured[column] / axis_scale, values, yerr=[values - low, high - values], fmt="o", color=LIGHT["ink"],
        markersize=5, capsize=3, linewidth=1.2, label="measured, 95 %", zorder=5,
    )  # fmt: skip
    if name in DIRECT:
        axes.set_ylim(bottom=0.0)
    axes.margins(x=0.06)
    add_legend(axes, columns=2)
    title = f"{name} ({quantity}) over {axis}, at {_where(series, axis)}"
    return Panel(f"{name}-over-{axis}", title, figure, group)


def _line(axes: Axes, x: pd.Series, y: pd.Series, variant: str) -> None:
    colour, dashes, marker = VARIANT_STYLE[variant]
    axes.plot(
        x, y, color=LIGHT[colour], linestyle=dashes, linewidth=1.6, marker=marker, markersize=4,
        label=VARIANT_LABEL[variant],
    )  # fmt: skip
