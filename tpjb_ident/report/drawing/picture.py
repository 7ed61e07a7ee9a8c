"""Figures, panels, labels and legends, alike in all pictures, in colours that colour-blind readers can tell apart.

Pictures are matplotlib figures made without pyplot and without any global setting: what a user has set for plots of
their own stays as it is. Margins are fixed in inches, so that pictures line up side by side and no layout solver runs.
"""

from __future__ import annotations

import contextlib
import io
import math
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler
from matplotlib.ticker import ScalarFormatter
from matplotlib.transforms import Bbox

from rigdata.arrays import FloatArray

#: Okabe and Ito's palette, told apart by most colour-blind readers; ink, rule and paper follow the page.
LIGHT = {
    "ink": "#1c2024",
    "rule": "#d7dce1",
    "paper": "#fdfefe",
    "blue": "#0072b2",
    "orange": "#d98c00",
    "green": "#009e73",
    "red": "#d55e01",
    "purple": "#b9609a",
    "grey": "#7a828b",
}
INK, RULE, PAPER, BLUE, RED, GREY = (LIGHT[name] for name in ("ink", "rule", "paper", "blue", "red", "grey"))
#: What `plot` takes to draw a curve: its colour, line and marker.
Style = dict[str, Any]


def _styles(colours: str, lines: Sequence[Any], markers: str) -> list[Style]:
    return list(cycler(color=[LIGHT[name] for name in colours.split()], linestyle=lines, marker=list(markers)))


_SERIES = _styles("blue red green purple orange", ["-", "--", "-.", ":", (0, (8, 2, 1, 2))], "os^Dv")
_TABLES = _styles("green red purple blue ink", ["-.", "--", ":", "-.", "--"], "*PX<>")
#: How each pivot model is drawn everywhere. Line and marker tell them apart without colour.
_MODELS = ("rigid", "kirk", "kirk-secant", "measured", "model before", "with the effects found")
_OF_MODELS = _styles("grey orange purple blue orange blue", [":", "--", "-.", "-", "--", "-"], "s^vD^D")
MODEL_STYLES = dict(zip(_MODELS, _OF_MODELS, strict=True))
#: How the entries of K, C and h are drawn.
ENTRY_STYLES = dict(
    zip(("xx", "yy", "xy", "yx"), _styles("blue red green purple", ["--", "-", ":", "-."], "so<>"), strict=True)
)
#: Names of models in legends, where they are not their own.
MODEL_LABELS = {
    "rigid": "rigid pivots",
    "kirk": "Kirk pivots",
    "kirk-secant": "Kirk, secant",
    "measured": "measured pivots",
}
#: Blue through paper to orange: signs that nobody confuses.
DIVERGING = LinearSegmentedColormap.from_list("tpjb-diverging", ["#004c7a", "#4f9bcb", "#f6f7f8", "#e8a33d", "#9a4a00"])
#: Paper to deep blue: more is darker.
SEQUENTIAL = LinearSegmentedColormap.from_list("tpjb-sequential", ["#f6f7f8", "#9cc7e3", "#2f86bf", "#003a63"])


def style_of(number: int) -> Style:
    """How the curve of this number is drawn, where several of a kind are in one panel: pads, axes, bearings."""
    return _SERIES[number % len(_SERIES)]


def model_styles(names: Sequence[str]) -> dict[str, Style]:
    """How the predictions of a picture are drawn: those of pivot models, and of the tables of other programs."""
    tables = [name for name in names if name not in MODEL_STYLES]
    return MODEL_STYLES | {name: _TABLES[k % len(_TABLES)] for k, name in enumerate(tables)}


_WIDTH, _HEIGHT = 4.6, 3.1  # inches: legible in one column of a phone, and of a printed page
SMALL = 8.0  # size of letters inside a panel
LEFT, _RIGHT, _BOTTOM, _TOP = 0.8, 0.15, 0.55, 0.15  # margins [inches]
_LINE = 0.172  # height of one line of text with its leading [inches]
CHARACTER = 0.074  # mean width of a character [inches]
_NOTEBOOK_DPI = 120

_LOOK = matplotlib.rc_params_from_file(Path(__file__).with_name("house.mplstyle"), use_default_template=False)
_ALONE = threading.RLock()


@contextlib.contextmanager
def _house_style() -> Iterator[None]:
    """The look of the house, and the user's again behind it; settings are the process', so one thread draws."""
    with _ALONE, matplotlib.rc_context(_LOOK):
        yield


#: Decorator of what draws.
in_house_style = _house_style()


class Picture(Figure):
    """A figure that shows itself in a notebook, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_DPI)
        return buffer.getvalue()

    draw = in_house_style(Figure.draw)  # ticks are made when they are drawn


def new_picture(
    x_label: str, y_label: str, *, title: str | None = None, width: float = _WIDTH, height: float = _HEIGHT
) -> tuple[Picture, Axes]:
    """Make a picture with one empty panel."""
    figure, ((axes,),) = new_pictures(1, 1, title=title, width=width, height=height)
    label(axes, x_label, y_label)
    return figure, axes


@in_house_style
def new_pictures(
    rows: int,
    columns: int,
    *,
    title: str | None = None,
    width: float = _WIDTH,
    height: float | Sequence[float] = _HEIGHT,
) -> tuple[Picture, Any]:
    """Make a picture with (rows, columns) empty panels, each with its own margins; a height for all or each."""
    inner, gap = np.broadcast_to(height, rows) - _BOTTOM - _TOP, _BOTTOM + _TOP
    total = float(inner.sum()) + rows * gap
    size = columns * width, total + (1.6 * _LINE if title else 0.0)
    figure = Picture(figsize=size)
    FigureCanvasAgg(figure)
    places = {
        "left": LEFT / size[0],
        "right": 1.0 - _RIGHT / size[0],
        "bottom": _BOTTOM / size[1],
        "top": (total - _TOP) / size[1],
        "wspace": (LEFT + _RIGHT) / (width - LEFT - _RIGHT),
        "hspace": gap / float(inner.mean()),
    }
    grid = figure.subplots(rows, columns, squeeze=False, height_ratios=inner.tolist(), gridspec_kw=places)
    for axes in grid.flat:
        axes.yaxis.set_major_formatter(_Millions())
    if title:
        figure.suptitle(title, y=1.0 - 0.06 / size[1], wrap=True)
    return figure, grid


class _Millions(ScalarFormatter):
    """Ticks of a hundred thousand and more as 0.4M: lbf/in would push the axis' label off the picture."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.fix_minus(f"{x / 1e6:g}M") if abs(x) >= 1e5 else super().__call__(x, pos)


def label(axes: Axes, x_label: str, y_label: str, heading: str = "") -> None:
    """Label both axes; a heading stands above the panel, which gives way."""
    axes.set(xlabel=x_label, ylabel=y_label, title=heading)
    if heading:
        shrink(axes, top=1.2 * _LINE)


def from_zero(axes: Axes) -> None:
    """Begin the vertical axis at zero, unless a value is below it, with room for the highest mark."""
    bottom, top = axes.dataLim.intervaly
    low, high = min(0.0, 1.1 * bottom), max(0.0, 1.1 * top)
    if low < high:
        axes.set_ylim(low, high)


def logarithmic(axes: Axes) -> None:
    """Make the vertical axis logarithmic; powers of ten are set by a parser that takes longer than the picture."""
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")


def shrink(axes: Axes, *, left: float = 0.0, right: float = 0.0, top: float = 0.0, bottom: float = 0.0) -> None:
    """Take inches off the sides of a panel: room for names, a colour bar or a legend."""
    low, high = axes.get_position().get_points()
    inches = _size(axes)
    axes.set_position(Bbox([low + np.array([left, bottom]) / inches, high - np.array([right, top]) / inches]))


def add_legend(axes: Axes, handles: Sequence[Any] | None = None, across: bool = False) -> None:
    """Put a legend above the panel, which makes room for it; nothing if nothing is labelled."""
    drawn = list(axes.get_legend_handles_labels()[0] if handles is None else handles)
    if not drawn:
        return
    names = [str(handle.get_label()) for handle in drawn]
    (width, height), box = _size(axes), axes.get_position()
    columns = _columns(names, width - 0.1 if across else width * box.width + 0.4 * LEFT)
    rows = math.ceil(len(drawn) / columns)
    shrink(axes, top=_LINE * rows + 0.03)
    heading = 1.4 * _LINE / (axes.get_position().height * height) if axes.get_title() else 0.0
    centre = (0.5 - box.x0) / box.width if across else 0.5
    axes.legend(handles=drawn, ncols=math.ceil(len(drawn) / rows), loc="lower center",  # no wider than the rows need
                bbox_to_anchor=(centre, 1.0 + heading))  # fmt: skip


def _size(axes: Axes) -> FloatArray:
    """Width and height of the picture that holds a panel [inches]."""
    figure: Any = axes.get_figure(root=True)
    return np.asarray(figure.get_size_inches())


def _columns(names: Sequence[str], room: float) -> int:
    """Most columns whose widest entries, side by side, fit into `room` inches."""
    for columns in range(min(len(names), 4), 1, -1):
        rows = math.ceil(len(names) / columns)
        widest = [max(len(name) for name in names[j * rows : (j + 1) * rows] or [""]) for j in range(columns)]
        if sum(0.55 + CHARACTER * n for n in widest) <= room:
            return columns
    return 1


def add_colour_bar(axes: Axes, image: Any, text: str) -> Axes:
    """Put a colour bar right of a panel, which makes room for it."""
    shrink(axes, right=0.75)
    width = _size(axes)[0] * axes.get_position().width
    bar = axes.inset_axes((1.0 + 0.12 / width, 0.0, 0.14 / width, 1.0))
    figure: Any = axes.figure
    figure.colorbar(image, cax=bar, label=text).outline.set_visible(False)
    return bar
