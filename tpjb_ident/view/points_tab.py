"""Operating points: K and C with intervals, and the robust weight of every window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.runtime.tables import printable
from tpjb_ident.view.style import BLUE, RED, new_plot

if TYPE_CHECKING:
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.results.point_result import PointResult


def points_tab(found: Identification) -> Any:
    """Build the tab."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, DataTable, HoverTool, Select, TableColumn

    named = {label(p): p for p in found.points}
    pick = Select(title="operating point", options=list(named), value=next(iter(named)), name="point", width=320)
    columns = ["coefficient", "value", "interval", "unit"]
    numbers = ColumnDataSource({c: [] for c in columns})
    heads = [TableColumn(field=c, title=c) for c in columns]
    table = DataTable(source=numbers, columns=heads, height=250, sizing_mode="stretch_width", index_position=None,
                      reorderable=False, name="coefficients")  # fmt: skip
    windows = ColumnDataSource({"window": [], "weight": [], "colour": [], "why": []})
    plot = new_plot("robust weight of every record window", "window, in the order of the runs", "weight",
                    y_range=(-0.05, 1.1), name="weights-plot")  # fmt: skip
    dots = plot.scatter("window", "weight", color="colour", size=6, source=windows)
    plot.add_tools(HoverTool(renderers=[dots], tooltips=[("window", "@window"), ("weight", "@weight"), ("", "@why")]))

    def update() -> None:
        point = named[pick.value]
        numbers.data = _coefficient_rows(point)
        windows.data = _window_rows(point)
        plot.title.text = f"robust weight of {point.n_windows} windows; flags: " + (
            ", ".join(str(q) for q in point.quality) or "none"
        )

    pick.on_change("value", lambda attr, old, new: update())
    update()
    return column(pick, table, plot, _stiffness_plot(found), sizing_mode="stretch_width")


def _stiffness_plot(found: Identification) -> Any:
    """Direct stiffness of all points over load, with 95 % intervals as bars."""
    from bokeh.models import ColumnDataSource, Whisker

    plot = new_plot("direct stiffness, 95 % intervals", "static load, kN", "stiffness, MN/m", name="stiffness-plot")
    good = [p for p in found.points if np.isfinite(p.stiffness.h).all()]
    for index, name, colour, marker in ((0, "kxx", BLUE, "square"), (3, "kyy", RED, "circle")):
        value = [p.stiffness.vector[index] / 1e6 for p in good]
        half = [p.stiffness.half_width()[index] / 1e6 for p in good]
        source = ColumnDataSource({"x": [p.point.static_load / 1e3 for p in good], "y": value,
                                   "low": [v - h for v, h in zip(value, half, strict=True)],
                                   "high": [v + h for v, h in zip(value, half, strict=True)]})  # fmt: skip
        plot.scatter("x", "y", source=source, color=colour, marker=marker, size=7, legend_label=name)
        plot.add_layout(Whisker(base="x", upper="high", lower="low", source=source, line_color=colour))
    if plot.legend:
        plot.add_layout(plot.legend[0], "below")
        plot.legend.orientation = "horizontal"
    return plot


def label(p: PointResult) -> str:
    """Name of a point that tells it from the others."""
    point = p.point
    return (
        f"{point.static_load / 1e3:g} kN at {point.static_load_direction_deg:g} deg, {point.shaft_speed_hz:g} Hz, "
        f"excitation {point.excitation_hz:g} Hz"
    )


def _coefficient_rows(p: PointResult) -> dict[str, list[str]]:
    """Columns of the table: eight coefficients with half their intervals."""
    half, omega = p.stiffness.half_width(), p.stiffness.omega
    rows: dict[str, list[str]] = {"coefficient": [], "value": [], "interval": [], "unit": []}
    for i, name in enumerate(("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")):
        scale, unit = (1e-6, "MN/m") if i < 4 else (1e-3 / omega, "kN s/m")
        rows["coefficient"].append(name)
        rows["value"].append(f"{scale * p.stiffness.vector[i]:.2f}")
        rows["interval"].append(f"± {scale * half[i]:.2f}")
        rows["unit"].append(unit)
    return rows


def _window_rows(p: PointResult) -> dict[str, list[Any]]:
    """Columns of the plot: weight of each window; the rejected ones carry their reason."""
    weights = np.asarray(p.stiffness.weights, dtype=float).min(axis=1)
    reasons = [""] * len(weights)
    low = np.argsort(weights, kind="stable")
    for index, verdict in zip(low, sorted(p.rejected, key=lambda w: w.weight), strict=False):
        reasons[int(index)] = printable(f"{verdict.run} at {verdict.time:.2f} s: {verdict.reason}")
    return {
        "window": list(range(1, len(weights) + 1)),
        "weight": weights.round(4).tolist(),
        "colour": [RED if w < 0.3 else BLUE for w in weights],
        "why": reasons,
    }
