"""Model: move load, frequency and pivots, and see prediction and measurement follow, with their residuals."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tpjb_ident.view.session import Curve, Session
from tpjb_ident.view.style import BLUE, GREY, INK, ORANGE, new_plot, side_by_side

if TYPE_CHECKING:
    from tpjb_ident.dynamic.results.point_result import PointResult

#: Frequencies of the curves [Hz].
LINES = np.linspace(5.0, 80.0, 31)
PARTS = {"k": ("stiffness, MN/m", 1e-6), "c": ("damping, kN s/m", 1e-3)}
_NEAR = 0.02


def model_tab(session: Session) -> Any:
    """Build the tab; the session has a predictor and identified points."""
    from bokeh.layouts import column
    from bokeh.models import Div

    load, line, pivots = _controls(session)
    said = Div(name="model-said", sizing_mode="stretch_width")
    plots, sources = _curve_plots()
    rest, residual = _residual_plot()
    follower = _Follower(session, (load, line, pivots), sources, residual, said)
    for slider in (load, line):
        slider.on_change("value", lambda attr, old, new: follower.later(follower.update))
    pivots.on_change("active", lambda attr, old, new: follower.later(follower.update, follower.residuals))
    follower.update()
    follower.residuals()
    return column(side_by_side(load, line, pivots), said, side_by_side(plots["k"], plots["c"]), rest,
                  sizing_mode="stretch_width")  # fmt: skip


def _controls(session: Session) -> tuple[Any, Any, Any]:
    """Sliders of load [kN] and excitation [Hz], and the choice of pivots."""
    from bokeh.models import RadioButtonGroup, Slider

    assert session.identification is not None
    points = session.identification.points
    loads = sorted({p.point.static_load for p in points})
    low, high = 0.8 * loads[0] / 1e3, 1.15 * loads[-1] / 1e3
    load = Slider(title="static load, kN", start=round(low, 2), end=round(high, 2), step=0.05, value=loads[0] / 1e3,
                  name="load", width=320)  # fmt: skip
    first = points[0].point.excitation_hz
    line = Slider(title="excitation, Hz", start=5.0, end=80.0, step=0.5, value=first, name="line", width=320)
    pivots = RadioButtonGroup(labels=list(session.pivots), active=len(session.pivots) - 1, name="pivots")
    return load, line, pivots


def _curve_plots() -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Plots of stiffness and damping over excitation, and what fills them."""
    from bokeh.models import ColumnDataSource

    plots, sources = {}, {}
    for part, (unit, _) in PARTS.items():
        plots[part] = new_plot(f"{part} over excitation", "excitation, Hz", unit, name=f"model-{part}")
        sources[part] = {n: ColumnDataSource({"x": [], "xx": [], "yy": []}) for n in ("curve", "here", "measured")}
        _draw(plots[part], sources[part])
    return plots, sources


def _residual_plot() -> tuple[Any, Any]:
    """Plot of predicted over measured at all points, and what fills it."""
    from bokeh.models import ColumnDataSource

    residual = ColumnDataSource({"point": [], "xx": [], "yy": [], "cxx": [], "cyy": []})
    rest = new_plot("predicted / measured - 1, all points", "static load, kN", "per cent", name="residuals", height=240)
    looks = (("xx", BLUE, "circle"), ("yy", ORANGE, "square"), ("cxx", INK, "x"), ("cyy", GREY, "cross"))
    for name, colour, marker in looks:
        shown = {"xx": "kxx", "yy": "kyy"}.get(name, name)
        rest.scatter("point", name, source=residual, color=colour, marker=marker, size=8, legend_label=shown)
    rest.add_layout(rest.legend[0], "right")
    return rest, residual


class _Follower:
    """Lets curves, sentence and residuals follow the controls (load, line, pivots)."""

    def __init__(
        self, session: Session, controls: tuple[Any, Any, Any], sources: dict[str, Any], residual: Any, said: Any
    ) -> None:
        assert session.identification is not None
        self.session, self.sources, self.residual, self.said = session, sources, residual, said
        self.load, self.line, self.pivots = controls
        self.points = session.identification.points
        self.curve = functools.lru_cache(maxsize=512)(self._predict)
        self.waiting: dict[Callable[[], None], None] = {}

    def _predict(self, newtons: float, name: str) -> Curve:
        assert self.session.predict is not None
        first = self.points[0].point
        return self.session.predict(newtons, first.static_load_direction, first.shaft_speed, LINES, name)

    def update(self) -> None:
        """Show the model at the sliders' load beside the points measured near it."""
        name, load, line = self.session.pivots[self.pivots.active], self.load.value, self.line.value
        got = self.curve(round(1e3 * load, 3), name)
        near = [p for p in self.points if abs(p.point.static_load / (1e3 * load) - 1.0) < _NEAR]
        for part, (_, scale) in PARTS.items():
            _fill(self.sources[part], scale * getattr(got, part), got.frequency, line)
            self.sources[part]["measured"].data = _measured_columns(near, part, scale)
        self.said.text = describe(got, line, load, name, len(near))

    def residuals(self) -> None:
        """Show all points against the chosen pivots."""
        self.residual.data = _residual_columns(self.session, self.session.pivots[self.pivots.active])

    def later(self, *tasks: Callable[[], None]) -> None:
        """Let a moving slider outrun the model: only its last place counts."""
        from bokeh.io import curdoc

        self.waiting.update(dict.fromkeys(tasks))
        if len(self.waiting) == len(set(tasks)):
            curdoc().add_timeout_callback(self._run_waiting, 60)

    def _run_waiting(self) -> None:
        tasks = list(self.waiting)
        self.waiting.clear()
        for task in tasks:
            task()


def _draw(plot: Any, sources: dict[str, Any]) -> None:
    for entry, colour in (("xx", BLUE), ("yy", ORANGE)):
        plot.line("x", entry, source=sources["curve"], color=colour, line_width=2, legend_label=f"{entry} predicted")
        plot.scatter("x", entry, source=sources["here"], color=colour, size=11, marker="diamond")
        plot.scatter("x", entry, source=sources["measured"], color=INK, fill_color=colour, size=9,
                     legend_label=f"{entry} measured")  # fmt: skip
    plot.y_range.start = 0
    plot.add_layout(plot.legend[0], "below")  # covers nothing
    plot.legend.orientation = "horizontal"
    plot.legend.ncols = 2
    plot.legend.label_text_font_size = "8pt"


def _fill(sources: dict[str, Any], table: np.ndarray, frequency: np.ndarray, line: float) -> None:
    xx, yy = table[:, 0, 0], table[:, 1, 1]
    sources["curve"].data = {"x": frequency, "xx": xx, "yy": yy}
    at = {n: [float(np.interp(line, frequency, v))] for n, v in (("xx", xx), ("yy", yy))}
    sources["here"].data = {"x": [line], **at}


def _measured_columns(points: list[PointResult], part: str, scale: float) -> dict[str, list[float]]:
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


def _residual_columns(session: Session, pivots: str) -> dict[str, list[float]]:
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
