"""Records: pick a run, see its channels over time, their spectra, and the orbit of the shaft."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.problem import RigDataError
from rigdata.survey.spectrum import amplitude_spectrum, strongest
from tpjb_ident.columns import channel_unit, set_point
from tpjb_ident.report.drawing.picture import LIGHT, thinned
from tpjb_ident.report.figure import Panel
from tpjb_ident.report.page import Section, render_section
from tpjb_ident.report.plots.records import orbit
from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rigdata.campaign import Campaign
    from rigdata.record import Record
    from rigdata.run import Run

#: More points than this are thinned to lows and highs: a screen shows no more.
_MOST_POINTS = 6000
_COLOURS = tuple(LIGHT[name] for name in ("ink", "blue", "orange", "green", "red", "purple"))


def records_tab(campaign: Campaign) -> Any:
    """Build the tab."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, Div, MultiSelect, Select

    runs = {run.id: run for run in campaign.runs}
    first = campaign.runs[0]
    pick = Select(title="run", options=list(runs), value=first.id, name="run", width=240)
    channel = Select(title="channel", options=list(first.channels), value=next(iter(first.channels)), name="channel")
    further = MultiSelect(title="beside it (same quantity)", options=[], value=[], name="others", width=320)
    facts = Div(name="run-facts", sizing_mode="stretch_width")
    orbit_of_run = text_element("orbit")
    plots = {
        "time": _new_plot("channels over time", "time, s", name="time-plot"),
        "spectrum": _new_plot("amplitude spectrum", "frequency, Hz", y_axis_type="log", name="spectrum-plot"),
    }
    data = {name: ColumnDataSource(_nothing()) for name in plots}
    for name, plot in plots.items():
        plot.multi_line("x", "y", source=data[name], color="colour", legend_field="name")
        plot.add_layout(plot.legend[0], "below")  # covers nothing
        plot.legend.orientation = "horizontal"

    def update() -> None:
        run = runs[pick.value]
        quantity = run.channels[channel.value].quantity
        alike = [name for name, c in run.channels.items() if c.quantity == quantity and name != channel.value]
        further.options = alike
        try:
            records = [run.record(name) for name in (channel.value, *alike) if name in (channel.value, *further.value)]
            message = _show_channels(records, plots, data)
        except RigDataError as error:
            message = str(error)
            for source in data.values():
                source.data = _nothing()
        facts.text = html.escape(printable(f"{run.kind}, {set_point(run.point)}. {message}"))
        orbit_of_run.text = _orbit(run)

    follow(update, pick, channel, further)
    over = column(*plots.values(), sizing_mode="stretch_width", min_width=340)
    widgets = _side_by_side(pick, channel, further)
    return column(widgets, facts, _side_by_side(over, orbit_of_run), sizing_mode="stretch_width")


def _nothing() -> dict[str, Any]:
    return {"x": [], "y": [], "colour": [], "name": []}


def text_element(name: str, html: str = "") -> Any:
    """Make an element of the page that holds a section of the report."""
    from bokeh.models import Div

    wide = ".bk-clearfix { display: block; width: 100%; }"  # otherwise as narrow as the text
    # the page is inverted as a whole; sections of the report know dark screens themselves
    back = "@media (prefers-color-scheme: dark) { :host { filter: invert(1) hue-rotate(180deg); } }"
    return Div(text=html, name=name, sizing_mode="stretch_width", stylesheets=[wide, back])


def follow(update: Callable[[], None], *widgets: Any, event: str = "value") -> None:
    """Update now and whenever one of the widgets changes."""
    for widget in widgets:
        widget.on_change(event, lambda attr, old, new: update())
    update()


def _show_channels(records: Sequence[Record], plots: dict[str, Any], data: dict[str, Any]) -> str:
    """Draw channels of one quantity over time and frequency; what is to be said of them."""
    first = records[0]
    unit, scale, zero = channel_unit(first.quantity)
    drawn = records[: len(_COLOURS)]
    plots["time"].yaxis.axis_label = f"{first.name if len(drawn) == 1 else first.quantity}, {unit}"
    plots["spectrum"].yaxis.axis_label = f"amplitude, {unit}"
    paths = [thinned(r.time, (r.values - zero) / scale, _MOST_POINTS) for r in drawn]
    spectra = [amplitude_spectrum(r.values / scale, r.rate) for r in drawn]
    foot = slice(4, None)  # of the window, about zero
    curves = {"time": paths, "spectrum": [(f[foot], np.maximum(a[foot], 1e-12)) for f, a in spectra]}
    for name, pairs in curves.items():
        x, y = map(list, zip(*pairs, strict=True))
        data[name].data = {"x": x, "y": y, "colour": _COLOURS[: len(drawn)], "name": [r.name for r in drawn]}
    lines = ", ".join(f"{x.frequency:.4g} Hz ({x.amplitude:.3g} {unit})" for x in strongest(*spectra[0], 3))
    missing = int(np.isnan(first.values).sum())
    not_shown = ", ".join(r.name for r in records[len(_COLOURS) :])
    message = (
        f"{first.name}: {len(first.values)} samples at {first.rate:g} Hz, {missing} missing; lines: {lines or 'none'}"
    )
    return message + (f"; not drawn: {not_shown}" if not_shown else "")


def _orbit(run: Run) -> str:
    """The path of the shaft, as the report draws it; of a run whose probes give none nothing."""
    try:
        picture = Panel("orbit", "Orbit of the shaft in the housing", orbit(run))
    except (RigDataError, ValueError):
        return ""
    return render_section(Section("Shaft in the housing", panels=[picture]))


def _side_by_side(*parts: Any) -> Any:
    """Set parts beside each other; on a narrow screen below each other."""
    from bokeh.layouts import row

    return row(*parts, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"})


def _new_plot(title: str, x: str, **options: Any) -> Any:
    """Make an empty plot."""
    from bokeh.plotting import figure

    plot = figure(title=title, x_axis_label=x, y_axis_label="", height=280, min_width=330,
                  sizing_mode="stretch_width", tools="pan,box_zoom,wheel_zoom,reset,save", **options)  # fmt: skip
    plot.toolbar.logo = None
    return plot
