"""Records: pick a run, see its channels over time, their spectra, and the orbit of the shaft."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.problem import RigDataError
from rigdata.survey.spectrum import amplitude_spectrum, strongest
from tpjb_ident.columns import amount, channel_unit, per, symbol
from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rigdata.campaign import Campaign
    from rigdata.record import Record

#: More points than this are thinned to lows and highs: a screen shows no more.
_MOST_POINTS = 6000
#: Of the running speed, taken off the orbit together: unbalance and runout.
_HARMONICS = 2
_INK, _BLUE, _RED = "#1c2024", "#0072b2", "#d55e01"
_COLOURS = (_INK, _BLUE, "#d98c00", "#009e73", _RED, "#b9609a", "#7a828b")


#: Columns of what is drawn.
_COLUMNS = {"orbit": "x y", "without": "x y", "time": "x y colour name", "spectrum": "x y colour name"}


def _nothing(name: str) -> dict[str, Any]:
    return {column: [] for column in _COLUMNS[name].split()}


def records_tab(campaign: Campaign) -> Any:
    """Build the tab."""
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, Div, MultiSelect, Select

    runs = {run.id: run for run in campaign.runs}
    first = campaign.runs[0]
    pick = Select(title="run", options=list(runs), value=first.id, name="run", width=240)
    channel = Select(title="channel", options=list(first.channels), value=next(iter(first.channels)), name="channel")
    further = MultiSelect(
        title="beside it (same quantity)", options=list(first.channels), value=[], name="others", width=320
    )
    facts = Div(name="run-facts", sizing_mode="stretch_width")
    data = {name: ColumnDataSource(_nothing(name)) for name in _COLUMNS}
    time = _new_plot("channels over time", "time, s", "", name="time-plot")
    spectrum = _new_plot("amplitude spectrum", "frequency, Hz", "amplitude", y_axis_type="log", name="spectrum-plot")
    for plot, name in ((time, "time"), (spectrum, "spectrum")):
        plot.multi_line("x", "y", source=data[name], color="colour", legend_field="name")
        plot.add_layout(plot.legend[0], "below")  # covers nothing
        plot.legend.orientation = "horizontal"
    x, y = (f"{axis}, {symbol('length')}" for axis in "xy")
    orbit = _new_plot("shaft in the housing", x, y, match_aspect=True, height=420, name="orbit-plot")
    orbit.line("x", "y", source=data["orbit"], color=_BLUE, line_width=0.7, legend_label="as measured")
    orbit.line("x", "y", source=data["without"], color=_RED, line_width=0.7, legend_label="without running speed")
    orbit.add_layout(orbit.legend[0], "below")  # covers nothing
    orbit.legend.click_policy = "hide"

    def update() -> None:
        run = runs[pick.value]
        p = run.point
        load = amount(p.static_load, "load")
        text = f"{run.kind}, {load} at {p.static_load_direction_deg:g} deg, {p.shaft_speed_hz:g} Hz"
        text += f", excitation {p.excitation_hz:g} Hz" if p.excitation else ""
        try:
            records = [run.record(channel.value), *(run.record(n) for n in further.value if n != channel.value)]
            message = _show_channels(records, (time, spectrum), data)
            data["orbit"].data, data["without"].data = _orbits(run)
        except RigDataError as error:
            message = str(error)
            for name, source in data.items():
                source.data = _nothing(name)
        facts.text = html.escape(printable(f"{text}. {message}"))

    follow(update, pick, channel, further)
    over = column(time, spectrum, sizing_mode="stretch_width", min_width=340)
    widgets = _side_by_side(pick, channel, further)
    return column(widgets, facts, _side_by_side(over, orbit), sizing_mode="stretch_width")


def follow(update: Callable[[], None], *widgets: Any, event: str = "value") -> None:
    """Update now and whenever one of the widgets changes."""
    for widget in widgets:
        widget.on_change(event, lambda attr, old, new: update())
    update()


def _show_channels(records: Sequence[Record], plots: tuple[Any, Any], data: dict[str, Any]) -> str:
    """Draw channels of one quantity over time and frequency; what is to be said of them."""
    first = records[0]
    unit, scale = channel_unit(first.quantity)
    drawn = [r for r in records if r.quantity == first.quantity][: len(_COLOURS) - 1]
    label = first.name if len(drawn) == 1 else first.quantity
    plots[0].yaxis.axis_label, plots[1].yaxis.axis_label = f"{label}, {unit}", f"amplitude, {unit}"
    paths = [_thinned(r.time, r.values / scale) for r in drawn]
    spectra = [amplitude_spectrum(r.values / scale, r.rate) for r in drawn]
    look = {"colour": _COLOURS[: len(drawn)], "name": [r.name for r in drawn]}
    data["time"].data = {"x": [x for x, _ in paths], "y": [y for _, y in paths], **look}
    data["spectrum"].data = {
        "x": [f[4:] for f, _ in spectra],
        "y": [np.maximum(a[4:], 1e-12) for _, a in spectra],
        **look,
    }
    lines = ", ".join(f"{x.frequency:.4g} Hz ({x.amplitude:.3g} {unit})" for x in strongest(*spectra[0], 3))
    missing = int(np.isnan(first.values).sum())
    not_shown = ", ".join(r.name for r in records if r not in drawn)
    message = (
        f"{first.name}: {len(first.values)} samples at {first.rate:g} Hz, {missing} missing; lines: {lines or 'none'}"
    )
    return message + (f"; of another quantity, not drawn: {not_shown}" if not_shown else "")


def _orbits(run: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Path of the shaft about its mean, as measured and without what turns with the shaft (unbalance, runout)."""
    try:
        record = run.vector("displacement")
    except RigDataError:  # a run whose probes cannot be turned into X and Y has no orbit; its channels still show
        return _nothing("orbit"), _nothing("without")
    path = per("length") * (record.values - np.nanmean(record.values, axis=0))
    good = np.isfinite(path).all(axis=1)
    omega, without_synchronous = run.point.shaft_speed, np.full((0, 2), np.nan)
    if omega > 0 and good.sum() > 2 * _HARMONICS + 1:
        turns = [wave(k * omega * record.time) for k in range(1, _HARMONICS + 1) for wave in (np.cos, np.sin)]
        waves = np.column_stack(turns)
        without_synchronous = path - waves @ np.linalg.lstsq(waves[good], path[good], rcond=None)[0]
    return tuple({"x": p[:_MOST_POINTS, 0], "y": p[:_MOST_POINTS, 1]} for p in (path, without_synchronous))  # type: ignore[return-value]


def _thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lows and highs of so many blocks that a screen can show them; short records as they are."""
    step = -(-len(values) // (_MOST_POINTS // 2))
    if step <= 2:
        return time, values
    count = len(values) // step
    blocks = np.ma.masked_invalid(values[: count * step].reshape(count, step))
    ends = np.stack([blocks.min(axis=1).filled(np.nan), blocks.max(axis=1).filled(np.nan)], axis=1)
    return np.repeat(time[: count * step : step], 2), ends.ravel()


def _side_by_side(*parts: Any) -> Any:
    """Set parts beside each other; on a narrow screen below each other."""
    from bokeh.layouts import row

    return row(*parts, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"})


def _new_plot(title: str, x: str, y: str, **options: Any) -> Any:
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
