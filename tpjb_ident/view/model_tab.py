"""Model: move load, frequency and pivots, and see prediction and measurement follow, with their residuals."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.view.look import BLUE, GREY, INK, ORANGE, new_plot
from tpjb_ident.view.session import Curve, Session

if TYPE_CHECKING:
    from tpjb_ident.dynamic.point_result import PointResult

#: Frequencies of the curves [Hz].
LINES = np.linspace(5.0, 80.0, 31)
PARTS = {"k": ("stiffness, MN/m", 1e-6), "c": ("damping, kN s/m", 1e-3)}
_NEAR = 0.02


def model_tab(session: Session) -> Any:
    """Build the tab; the session has a predictor and identified points."""
    from bokeh.io import curdoc
    from bokeh.layouts import column, row
    from bokeh.models import ColumnDataSource, Div, RadioButtonGroup, Slider

    found = session.identification
    assert found is not None
    assert session.predict is not None
    points = found.points
    loads = sorted({p.point.static_load for p in points})
    first = points[0].point
    low, high = 0.8 * loads[0] / 1e3, 1.15 * loads[-1] / 1e3
    load = Slider(title="static load, kN", start=round(low, 2), end=round(high, 2), step=0.05, value=loads[0] / 1e3,
                  name="load", width=320)  # fmt: skip
    line = Slider(
        title="excitation, Hz", start=5.0, end=80.0, step=0.5, value=first.excitation_hz, name="line", width=320
    )
    pivots = RadioButtonGroup(labels=list(session.pivots), active=len(session.pivots) - 1, name="pivots")
    said = Div(name="model-said", sizing_mode="stretch_width")
    waiting: dict[Callable[[], None], None] = {}
    plots, sources = {}, {}
    for part, (unit, _) in PARTS.items():
        plot = new_plot(f"{part} over excitation", "excitation, Hz", unit, name=f"model-{part}")
        sources[part] = {n: ColumnDataSource({"x": [], "xx": [], "yy": []}) for n in ("curve", "here", "measured")}
        _draw(plot, sources[part])
        plots[part] = plot
    residual = ColumnDataSource({"point": [], "xx": [], "yy": [], "cxx": [], "cyy": []})
    rest = new_plot("predicted / measured - 1, all points", "static load, kN", "per cent", name="residuals", height=240)
    looks = (("xx", BLUE, "circle"), ("yy", ORANGE, "square"), ("cxx", INK, "x"), ("cyy", GREY, "cross"))
    for name, colour, marker in looks:
        shown = {"xx": "kxx", "yy": "kyy"}.get(name, name)
        rest.scatter("point", name, source=residual, color=colour, marker=marker, size=8, legend_label=shown)

    rest.add_layout(rest.legend[0], "right")

    @functools.lru_cache(maxsize=512)
    def curve(newtons: float, name: str) -> Curve:
        assert session.predict is not None
        return session.predict(newtons, first.static_load_direction, first.shaft_speed, LINES, name)

    def update() -> None:
        name = session.pivots[pivots.active]
        got = curve(round(1e3 * load.value, 3), name)
        near = [p for p in points if abs(p.point.static_load / (1e3 * load.value) - 1.0) < _NEAR]
        for part, (_, scale) in PARTS.items():
            _fill(sources[part], scale * getattr(got, part), got.frequency, line.value)
            sources[part]["measured"].data = measured_columns(near, part, scale)
        said.text = describe(got, line.value, load.value, name, len(near))

    def later(*tasks: Callable[[], None]) -> None:
        """Let a moving slider outrun the model: only its last place counts."""
        waiting.update(dict.fromkeys(tasks))
        if len(waiting) == len(set(tasks)):
            curdoc().add_timeout_callback(run_waiting, 60)

    def run_waiting() -> None:
        tasks = list(waiting)
        waiting.clear()
        for task in tasks:
            task()

    def residuals() -> None:
        residual.data = residual_columns(session, session.pivots[pivots.active])

    for slider in (load, line):
        slider.on_change("value", lambda attr, old, new: later(update))
    pivots.on_change("active", lambda attr, old, new: later(update, residuals))
    update()
    residuals()
    return column(row(load, line, pivots), said, row(plots["k"], plots["c"], sizing_mode="stretch_width"), rest,
                  sizing_mode="stretch_width")  # fmt: skip


def _draw(plot: Any, sources: dict[str, Any]) -> None:
    for entry, colour in (("xx", BLUE), ("yy", ORANGE)):
        plot.line("x", entry, source=sources["curve"], color=colour, line_width=2, legend_label=f"{entry} predicted")
        plot.scatter("x", entry, source=sources["here"], color=colour, size=11, marker="diamond")
        plot.scatter("x", entry, source=sources["measured"], color=INK, fill_color=colour, size=9,
                     legend_label=f"{entry} measured")  # fmt: skip
    plot.y_range.start = 0
    plot.legend.location = "bottom_right"
    plot.legend.orientation = "horizontal"
    plot.legend.label_text_font_size = "8pt"


def _fill(sources: dict[str, Any], table: np.ndarray, frequency: np.ndarray, line: float) -> None:
    xx, yy = table[:, 0, 0], table[:, 1, 1]
    sources["curve"].data = {"x": frequency, "xx": xx, "yy": yy}
    at = {n: [float(np.interp(line, frequency, v))] for n, v in (("xx", xx), ("yy", yy))}
    sources["here"].data = {"x": [line], **at}


def measured_columns(points: list[PointResult], part: str, scale: float) -> dict[str, list[float]]:
    """Measured direct coefficients of the points at a load, over their excitation."""
    tables = [p.stiffness.k if part == "k" else p.stiffness.c for p in points]
    return {
        "x": [p.point.excitation_hz for p in points],
        "xx": [scale * float(t[0, 0]) for t in tables],
        "yy": [scale * float(t[1, 1]) for t in tables],
    }


def describe(curve: Curve, line: float, load: float, pivots: str, measured: int) -> str:
    """What the sliders show, in one sentence; HTML."""
    if curve.status:
        import html

        return html.escape(f"{load:g} kN, {pivots} pivots: {curve.status}")
    values = [float(np.interp(line, curve.frequency, curve.k[:, i, i])) / 1e6 for i in (0, 1)]
    values += [float(np.interp(line, curve.frequency, curve.c[:, i, i])) / 1e3 for i in (0, 1)]
    numbers = "kxx {:.1f}, kyy {:.1f} MN/m; cxx {:.0f}, cyy {:.0f} kN s/m".format(*values)
    points = f"{measured} measured point{'s' if measured > 1 else ''}" if measured else "no measured point"
    return f"{load:g} kN, {line:g} Hz, {pivots} pivots: {numbers}; {points} at this load."


def residual_columns(session: Session, pivots: str) -> dict[str, list[float]]:
    """Predicted / measured - 1 in per cent, of the direct coefficients at every point."""
    found = session.identification
    assert found is not None
    assert session.predict is not None
    out: dict[str, list[float]] = {"point": [], "xx": [], "yy": [], "cxx": [], "cyy": []}
    for p in found.points:
        q, line = p.point, np.array([p.point.excitation_hz])
        got = session.predict(q.static_load, q.static_load_direction, q.shaft_speed, line, pivots)
        out["point"].append(q.static_load / 1e3)
        for i, name in enumerate(("xx", "yy")):
            out[name].append(100.0 * float(got.k[0, i, i] / p.stiffness.k[i, i] - 1.0))
            out[f"c{name}"].append(100.0 * float(got.c[0, i, i] / p.stiffness.c[i, i] - 1.0))
    return out
