"""Results, in the pictures and tables of the report: points with their windows, and prediction with measurement."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.columns import amount, set_point, size, symbol
from tpjb_ident.compare.comparison import joined
from tpjb_ident.compare.predictions import ModelSettings, point_columns, predict_points
from tpjb_ident.conditions import untrusted
from tpjb_ident.report.comparison_page import deviations_table, measured_table
from tpjb_ident.report.drawing.picture import DIRECT, longest_series
from tpjb_ident.report.figure import Panel
from tpjb_ident.report.page import Section, render_section
from tpjb_ident.report.plots.coefficients import coefficient, direct_coefficients
from tpjb_ident.report.plots.records import window_weights
from tpjb_ident.report.plots.residuals import residual_map
from tpjb_ident.report.sections import flags_line, tested_facts, values_table
from tpjb_ident.rounding import counted
from tpjb_ident.schema import POINT_COLUMNS, POINT_KEY
from tpjb_ident.view.records_tab import follow, text_element

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.results.identification import Identification
    from tpjb_ident.view.server import Session

#: Frequencies of the curves [Hz].
_LINES = np.arange(5.0, 85.0, 5.0)
#: Points are shown at the slider's load where theirs differs by no more than this share.
_NEAR = 0.02


def verdict_tab(session: Session, identification: Identification) -> Any:
    """Build the first tab: what was tested, how far to trust it, K and C at one point, predictions against it."""
    assert session.campaign is not None
    points = identification.points
    facts = tested_facts(session.campaign, session.bearing, points)
    notes = [f"{name}: {value}" for name, value in facts.items()]
    notes.append(flags_line([p.quality for p in points], len(points)))
    values = values_table(points)
    tables = [] if values is None else [values]
    if session.bearing is not None and points:
        tables.append(deviations_table(_all_compared(session, identification)))
    bad = sum(bool(untrusted(p.quality)) for p in points)
    title = f"{counted(len(points), 'operating point')}, {f'{bad} NOT to be trusted' if bad else 'all to be trusted'}"
    return text_element("verdict", render_section(Section(title, notes, tables=tables)))


def points_tab(identification: Identification) -> Any:
    """Build the tab: windows of one point, then K and C of all."""
    from bokeh.layouts import column
    from bokeh.models import Select

    points = {set_point(p.point): p for p in identification.points}
    choice = Select(title="operating point", options=list(points), value=next(iter(points)), name="point", width=320)
    windows = text_element("windows")

    def update() -> None:
        p = points[choice.value]
        flags = ", ".join(str(condition) for condition in p.quality) or "none"
        title = f"Robust weight of {p.n_windows} windows; flags: {flags}"
        windows.text = render_section(Section("Windows", panels=[Panel("window-weights", title, window_weights(p))]))

    follow(update, choice)
    return column(
        choice, windows, text_element("coefficients", _points_html(identification)), sizing_mode="stretch_width"
    )


def _points_html(identification: Identification) -> str:
    panels = []
    if longest_series(identification.to_frame(), "load") is not None:
        figure = direct_coefficients({identification.campaign: identification})
        panels.append(Panel("stiffness", "Direct stiffness over load, 95 % intervals", figure))
    return render_section(Section("All points", panels=panels, tables=[measured_table(identification)]))


def model_tab(session: Session, identification: Identification) -> Any:
    """Build the tab: coefficients over excitation at the slider's load, then the residuals of all points."""
    from bokeh.layouts import column
    from bokeh.models import Slider

    loads = sorted({p.point.static_load / size("load") for p in identification.points})
    step = 0.05 if size("load") > 100.0 else 10.0
    load = Slider(title=f"static load, {symbol('load')}", start=step * round(0.8 * loads[0] / step), value=loads[0],
                  end=step * round(1.15 * loads[-1] / step), step=step, name="load", width=320)  # fmt: skip
    curves = text_element("curves")
    html = functools.lru_cache(maxsize=512)(functools.partial(_curves_html, session, identification))

    def update() -> None:
        curves.text = html(round(load.value * size("load"), 3))

    follow(update, load, event="value_throttled")  # when a moving slider is let go
    residuals = Panel("residual-map", "Residuals of all points", residual_map(_all_compared(session, identification)))
    html_of_all = render_section(Section("All points", panels=[residuals]))
    return column(load, curves, text_element("residuals", html_of_all), sizing_mode="stretch_width")


def _curves_html(session: Session, identification: Identification, load: float) -> str:
    """Direct coefficients over excitation at one load, with every pivot model."""
    first = identification.points[0].point
    measured = identification.to_frame()
    measured = measured[(measured["static_load_N"] / load - 1.0).abs() < _NEAR]
    measured = measured.assign(static_load_N=load)
    frequencies = sorted({*_LINES, *measured["excitation_Hz"]})
    points = [replace(first, static_load=load, excitation=2 * np.pi * frequency) for frequency in frequencies]
    table = _compared(session, points, measured)
    panels = []
    for name in DIRECT:
        figure = coefficient(table, name, over="frequency")
        panels.append(Panel(f"model-{name}", f"{name} over excitation at {amount(load, 'load')}", figure))
    note = f"{counted(len(measured), 'measured point')} at this load."
    return render_section(Section("Prediction and measurement", [note], panels))


def _all_compared(session: Session, identification: Identification) -> pd.DataFrame:
    return _compared(session, [p.point for p in identification.points], identification.to_frame())


def _compared(session: Session, points: Sequence[OperatingPoint], measured: pd.DataFrame) -> pd.DataFrame:
    """Predictions with every pivot model, and what was measured at the same points; columns as in comparison.csv."""
    import pandas as pd

    digits = dict.fromkeys(POINT_COLUMNS, 6)
    places = pd.DataFrame([point_columns(point) for point in points]).round(digits)
    predictions = {}
    for name, pivots in session.pivots.items():
        predictions[name] = pd.DataFrame(predict_points(session.bearing, points, ModelSettings(pivots)))
    return joined(places.merge(measured.round(digits), how="left", on=list(POINT_KEY)), predictions)
