"""Records: pick a run, see its channels over time, a spectrum, and the orbit of the shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.problem import RigDataError
from rigdata.survey.spectrum import amplitude_spectrum, strongest
from tpjb_ident.view.style import BLUE, INK, RED, new_plot

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.record import Record

#: More points than this are thinned to lows and highs: a screen shows no more.
MOST_POINTS = 6000
#: Of the running speed, taken off the orbit together: unbalance and runout.
HARMONICS = 2
_UNITS = {
    "displacement": ("µm", 1e6),
    "force": ("N", 1.0),
    "acceleration": ("m/s²", 1.0),
    "temperature": ("K", 1.0),
    "pressure": ("Pa", 1.0),
    "speed": ("rad/s", 1.0),
}


def records_tab(campaign: Campaign) -> Any:
    """Build the tab.

    Parameters
    ----------
    campaign : Campaign
    """
    from bokeh.layouts import column, row
    from bokeh.models import ColumnDataSource, Div, Select

    runs = {run.id: run for run in campaign.runs}
    first = campaign.runs[0]
    pick = Select(title="run", options=list(runs), value=first.id, name="run", width=240)
    channel = Select(title="channel", options=list(first.channels), value=next(iter(first.channels)), name="channel")
    facts = Div(name="run-facts", sizing_mode="stretch_width")
    data = {name: ColumnDataSource({"x": [], "y": []}) for name in ("time", "spectrum", "orbit", "without")}
    time = new_plot("channel over time", "time, s", "", name="time-plot")
    time.line("x", "y", source=data["time"], color=INK)
    spectrum = new_plot("amplitude spectrum", "frequency, Hz", "amplitude", y_axis_type="log", name="spectrum-plot")
    spectrum.line("x", "y", source=data["spectrum"], color=BLUE)
    orbit = new_plot("shaft in the housing", "x, µm", "y, µm", match_aspect=True, height=420, name="orbit-plot")
    orbit.line("x", "y", source=data["orbit"], color=BLUE, line_width=0.7, legend_label="as measured")
    orbit.line("x", "y", source=data["without"], color=RED, line_width=0.7, legend_label="without running speed")
    orbit.add_layout(orbit.legend[0], "below")  # covers nothing
    orbit.legend.click_policy = "hide"

    def update() -> None:
        run = runs[pick.value]
        p = run.point
        text = f"{run.kind}, {p.static_load / 1e3:g} kN at {p.static_load_direction_deg:g} deg, {p.shaft_speed_hz:g} Hz"
        text += f", excitation {p.excitation_hz:g} Hz" if p.excitation else ""
        try:
            record = run.record(channel.value)
            said = _show_channel(record, (time, spectrum), data)
            data["orbit"].data, data["without"].data = _orbits(run)
            facts.text = _escaped(f"{text}. {said}")
        except RigDataError as error:
            for source in data.values():
                source.data = {"x": [], "y": []}
            facts.text = _escaped(f"{text}. {error}")

    pick.on_change("value", lambda attr, old, new: update())
    channel.on_change("value", lambda attr, old, new: update())
    update()
    return column(row(pick, channel), facts, row(column(time, spectrum, sizing_mode="stretch_width"), orbit,
                  sizing_mode="stretch_width"), sizing_mode="stretch_width")  # fmt: skip


def _show_channel(record: Record, plots: tuple[Any, Any], data: dict[str, Any]) -> str:
    unit, scale = _UNITS.get(record.quantity, ("", 1.0))
    values = scale * record.values
    plots[0].yaxis.axis_label = f"{record.name}, {unit}"
    plots[1].yaxis.axis_label = f"amplitude, {unit}"
    x, y = thinned(record.time, values)
    data["time"].data = {"x": x, "y": y}
    frequency, amplitude = amplitude_spectrum(values, record.rate)
    data["spectrum"].data = {"x": frequency[4:], "y": np.maximum(amplitude[4:], 1e-12)}
    lines = ", ".join(f"{x.frequency:.4g} Hz ({x.amplitude:.3g} {unit})" for x in strongest(frequency, amplitude, 3))
    missing = int(np.isnan(values).sum())
    return f"{record.name}: {len(values)} samples at {record.rate:g} Hz, {missing} missing; lines: {lines or 'none'}"


def _orbits(run: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Path of the shaft about its mean [µm], as measured and without what turns with the shaft (unbalance, runout)."""
    try:
        record = run.vector("displacement")
    except RigDataError:  # a run whose probes cannot be turned into X and Y has no orbit; its channels still show
        return {"x": [], "y": []}, {"x": [], "y": []}
    path = 1e6 * (record.values - np.nanmean(record.values, axis=0))
    good = np.isfinite(path).all(axis=1)
    omega, rest = run.point.shaft_speed, np.full((0, 2), np.nan)
    if omega > 0 and good.sum() > 2 * HARMONICS + 1:
        turns = [wave(k * omega * record.time) for k in range(1, HARMONICS + 1) for wave in (np.cos, np.sin)]
        waves = np.column_stack(turns)
        rest = path - waves @ np.linalg.lstsq(waves[good], path[good], rcond=None)[0]
    return tuple({"x": p[:MOST_POINTS, 0], "y": p[:MOST_POINTS, 1]} for p in (path, rest))  # type: ignore[return-value]


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lows and highs of so many blocks that a screen can show them; short records as they are.

    Parameters
    ----------
    time : np.ndarray
        [s]
    values : np.ndarray
        Samples.
    """
    step = -(-len(values) // (MOST_POINTS // 2))
    if step <= 2:
        return time, values
    count = len(values) // step
    blocks = np.ma.masked_invalid(values[: count * step].reshape(count, step))
    ends = np.stack([blocks.min(axis=1).filled(np.nan), blocks.max(axis=1).filled(np.nan)], axis=1)
    return np.repeat(time[: count * step : step], 2), ends.ravel()


def _escaped(text: str) -> str:
    import html

    from tpjb_ident.runtime.tables import printable

    return html.escape(printable(text))
