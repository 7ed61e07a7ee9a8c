"""What all pictures share: figures, panels, labels, legends, series of operating points, colours for the colour-blind.

Pictures are matplotlib figures made without pyplot and without any global setting: what a user has set for plots of
their own stays as it is. Margins are fixed in inches, so that pictures line up side by side and no layout solver runs.
"""

import contextlib
import functools
import inspect
import io
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler
from matplotlib.ticker import ScalarFormatter
from matplotlib.transforms import Bbox

from rigdata.arrays import FloatArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, place_of, size, spinning, symbol
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_KEY, STATIC_KEY

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
    "model before": "model as stated",
    "before": "as stated",
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


def plot(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Decorator of each picture that users draw: the house's look, and above all panels the ``title`` that is given."""

    @functools.wraps(draw)
    @in_house_style
    def drawn(*arguments: Any, title: str | None = None, **options: Any) -> Figure:
        figure = draw(*arguments, **options)
        if title:  # above all panels, for which the figure grows
            width, height = figure.get_size_inches()
            taller = height + 1.6 * _LINE
            for axes in figure.axes:
                corners = axes.get_position(original=True).get_points()
                axes.set_position(Bbox(corners * [1.0, height / taller]))
            figure.set_size_inches(width, taller)
            figure.suptitle(title, y=1.0 - 0.06 / taller, wrap=True)
        return figure

    signature = inspect.signature(draw)
    named = inspect.Parameter("title", inspect.Parameter.KEYWORD_ONLY, default=None, annotation="str | None")
    extended: Any = drawn
    extended.__signature__ = signature.replace(parameters=[*signature.parameters.values(), named])
    return drawn


class Picture(Figure):
    """A figure that shows itself in a notebook, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_DPI)
        return buffer.getvalue()

    draw = in_house_style(Figure.draw)  # ticks are made when they are drawn


def new_picture(x_label: str, y_label: str, *, width: float = _WIDTH, height: float = _HEIGHT) -> tuple[Picture, Axes]:
    """Make a picture with one empty panel."""
    figure, ((axes,),) = new_pictures(1, 1, width=width, height=height)
    label(axes, x_label, y_label)
    return figure, axes


@in_house_style
def new_pictures(
    rows: int, columns: int, *, width: float = _WIDTH, height: float | Sequence[float] = _HEIGHT
) -> tuple[Picture, Any]:
    """Make a picture with (rows, columns) empty panels, each with its own margins; a height for all or each."""
    inner, gap = np.broadcast_to(height, rows) - _BOTTOM - _TOP, _BOTTOM + _TOP
    across, down = columns * width, inner.sum() + rows * gap
    figure = Picture(figsize=(across, down))
    FigureCanvasAgg(figure)
    places = {
        "left": LEFT / across,
        "right": 1.0 - _RIGHT / across,
        "bottom": _BOTTOM / down,
        "top": 1.0 - _TOP / down,
        "wspace": (LEFT + _RIGHT) / (width - LEFT - _RIGHT),
        "hspace": gap / inner.mean(),
    }
    grid = figure.subplots(rows, columns, squeeze=False, height_ratios=inner.tolist(), gridspec_kw=places)
    for axes in grid.flat:
        axes.yaxis.set_major_formatter(_Millions())
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
    """Begin the vertical axis at zero, unless a value is below it, with room for the highest and the lowest mark."""
    bottom, top = axes.dataLim.intervaly
    low, high = min(0.0, bottom), max(0.0, top)
    room = 0.1 * (high - low)
    if room > 0.0:
        axes.set_ylim(low - room * (bottom < 0.3 * room), high + room * (top > -0.3 * room))


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
    return figure.get_size_inches()


def _columns(names: Sequence[str], room: float) -> int:
    """Most columns whose widest entries, side by side, fit into `room` inches."""
    for columns in range(min(len(names), 4), 1, -1):
        rows = math.ceil(len(names) / columns)
        widest = [max(map(len, names[j * rows : (j + 1) * rows] or [""])) for j in range(columns)]
        if sum(0.55 + CHARACTER * n for n in widest) <= room:
            return columns
    return 1


def add_colour_bar(axes: Axes, image: Any, text: str) -> Axes:
    """Put a colour bar right of a panel, which makes room for it."""
    shrink(axes, right=0.75)
    width = _size(axes)[0] * axes.get_position().width
    bar = axes.inset_axes((1.0 + 0.12 / width, 0.0, 0.14 / width, 1.0))
    axes.figure.colorbar(image, cax=bar, label=text).outline.set_visible(False)
    return bar


#: Column that a series runs over, its quantity and its name.
_AXES = {
    "load": ("static_load_N", "load", "static load"),
    "frequency": ("excitation_Hz", "frequency", "excitation frequency"),
}
#: Points from which on a line joins them; between fewer nobody knows what it would do.
CURVE = 5
#: Height of a further line of ticks [inches].
_TICKS = 0.16
COEFFICIENTS = tuple(column[:3] for column in COEFFICIENT_COLUMNS)
DIRECT = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")


def axis_label(over: str) -> str:
    """Label of the axis that a series runs along."""
    _, quantity, name = _AXES[over]
    return f"{name}, {symbol(quantity)}"


def as_table(source: Any) -> pd.DataFrame:
    """Table of coefficients of a result, or the table that was given."""
    return source if isinstance(source, pd.DataFrame) else source.to_dataframe()


def longest_series(table: pd.DataFrame, over: str) -> pd.DataFrame | None:
    """Rows of the longest series over load (at one frequency) or over frequency (at one load); None if none varies.

    In order, with their places `at` in the unit of the axis.
    """
    column, quantity, _ = _AXES[over]
    fixed = ["excitation_Hz" if over == "load" else "static_load_N", *STATIC_KEY[1:]]
    keys = [name for name in fixed if name in table]
    groups = (group for _, group in table.groupby(keys))
    best = max(groups, key=lambda group: group[column].nunique(), default=table)
    if best[column].nunique() < 2:
        return None
    return best.sort_values(column, kind="stable").assign(at=best[column] / size(quantity))


def constant_along(series: pd.DataFrame, over: str) -> str:
    """What is constant along a series, in words."""
    first = series.iloc[0]
    fixed = f"{first.excitation_Hz:g} Hz excitation" if over == "load" else amount(first.static_load_N, "load")
    return f"{fixed}, shaft at {spinning(first.shaft_speed_Hz, first.get('rotation', ROTATIONS[0]))}"


def points_table(points: Sequence[PointResult]) -> pd.DataFrame:
    """Set points of results, by the columns of every table."""
    return pd.DataFrame([p.point.key for p in points], columns=list(POINT_KEY))


def point_labels(table: pd.DataFrame) -> list[str]:
    """Load and excitation of every row, in words, and what else tells the rows apart."""
    return [", ".join([place_of(load, excitation), *extras]) for load, excitation, extras in _set_points(table)]


def set_point_ticks(axes: Axes, table: pd.DataFrame) -> None:
    """Name places 0 to n - 1 of a panel by operating points: a line for load, excitation and what else differs."""
    lines = [[f"{load / size('load'):.4g}", f"{hz:g}", *extras] for load, hz, extras in _set_points(table)]
    axes.set_xticks(range(len(lines)), ["\n".join(texts) for texts in lines], fontsize=SMALL)
    shrink(axes, bottom=0.09 + _TICKS * (len(lines[0]) - 1 if lines else 0))


def _set_points(table: pd.DataFrame) -> list[tuple[float, float, list[str]]]:
    """Load, excitation and, in words, what of these differs between rows: direction of the load, speed and sense."""
    forms = {"static_load_direction_deg": "{:g}°", "shaft_speed_Hz": "shaft {:g} Hz", "rotation": "{}"}
    varied = [name for name in forms if name in table and len(table[name].drop_duplicates()) > 1]
    short = table.replace({"rotation": dict(zip(ROTATIONS, ("ccw", "cw"), strict=True))}) if varied else table
    points = []
    for row in short.to_dict("records"):
        words = [forms[name].format(row[name]) for name in varied]
        points.append((row["static_load_N"], row["excitation_Hz"], words))
    return points


def thinned(time: FloatArray, values: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Lows and highs of as many blocks as a screen can show; short records as they are."""
    step = -(-len(values) // (most // 2))
    if step <= 2:
        return time, values
    count = len(values) // step
    blocks = np.ma.masked_invalid(values[: count * step].reshape(count, step))
    ends = np.stack([blocks.min(axis=1).filled(np.nan), blocks.max(axis=1).filled(np.nan)], axis=1)
    return np.repeat(time[: count * step : step], 2), ends.ravel()


def with_errors(rows: pd.DataFrame, column: str, scale: float) -> tuple[FloatArray, FloatArray]:
    """Values (n,) of a column, and the lengths (2, n) of their intervals below and above."""
    value, low, high = (rows[f"{column}{end}"].to_numpy(float) / scale for end in ("", "_lo", "_hi"))
    return value, np.abs([value - low, high - value])
