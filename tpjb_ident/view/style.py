"""One look for all plots of the page."""

from __future__ import annotations

from typing import Any

INK, BLUE, ORANGE, GREEN, RED, GREY = "#1c2024", "#0072b2", "#d98c00", "#009e73", "#d55e01", "#7a828b"
COLOURS = (BLUE, ORANGE, GREEN, RED, "#b9609a", GREY)


def side_by_side(*parts: Any) -> Any:
    """Set parts beside each other; on a narrow screen below each other."""
    from bokeh.layouts import row

    return row(*parts, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"})


def new_plot(title: str, x: str, y: str, **options: Any) -> Any:
    """Make an empty plot."""
    from bokeh.plotting import figure

    settings = {
        "height": 280,
        "min_width": 330,
        "sizing_mode": "stretch_width",
        "tools": "pan,box_zoom,wheel_zoom,reset,save",
    }
    plot = figure(title=title, x_axis_label=x, y_axis_label=y, **{**settings, **options})
    plot.toolbar.logo = None
    return plot
