"""Figures, panels, labels and legends, alike in all pictures, in colours that colour-blind readers can tell apart.

Pictures are matplotlib figures made without pyplot and without any global setting: what a user has set for plots of
their own stays as it is. Margins are fixed in inches, so that pictures line up side by side and no layout solver runs.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import ScalarFormatter

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
#: Lines that are told apart without colour.
DASHED, SHORT_DASHED, DOTTED, DASH_DOTTED = (0, (5, 2)), (0, (4, 2)), (0, (1, 1.5)), (0, (3, 1, 1, 1))
#: Colour, line and marker.
Style = tuple[str, Any, str]
#: How each pivot model is drawn everywhere: colour, line, marker. Line and marker tell them apart without colour.
VARIANT_STYLE: dict[str, Style] = {
    "rigid": ("grey", DOTTED, "s"),
    "kirk": ("orange", DASHED, "^"),
    "kirk-secant": ("purple", DASH_DOTTED, "v"),
    "measured": ("blue", "-", "D"),
    "model before": ("orange", DASHED, "^"),
    "with the effects found": ("blue", "-", "D"),
}
VARIANT_LABEL = {
    "rigid": "rigid pivots",
    "kirk": "Kirk pivots",
    "kirk-secant": "Kirk, secant",
    "measured": "measured pivots",
}
#: Of the tables of other programs, one after the other.
_TABLE_STYLE: tuple[Style, ...] = (
    ("green", (0, (4, 1, 1, 1)), "*"),
    ("red", (0, (2, 1)), "P"),
    ("purple", (0, (6, 1, 1, 1, 1, 1)), "X"),
    ("blue", (0, (1, 1)), "<"),
    ("ink", (0, (3, 3)), ">"),
)
_PAD_STYLE: tuple[Style, ...] = (
    ("blue", "-", "o"),
    ("red", DASHED, "s"),
    ("green", DASH_DOTTED, "^"),
    ("purple", DOTTED, "D"),
    ("orange", (0, (8, 2, 1, 2)), "v"),
)
#: Blue through paper to orange: signs that nobody confuses.
DIVERGING = LinearSegmentedColormap.from_list("tpjb-diverging", ["#004c7a", "#4f9bcb", "#f6f7f8", "#e8a33d", "#9a4a00"])
#: Paper to deep blue: more is darker.
SEQUENTIAL = LinearSegmentedColormap.from_list("tpjb-sequential", ["#f6f7f8", "#9cc7e3", "#2f86bf", "#003a63"])


def style_of_variant(variant: str, variants: Sequence[str]) -> Style:
    """Colour, line style and marker of one of the variants of a picture: a pivot model or another program's table."""
    tables = [name for name in variants if name not in VARIANT_STYLE]
    return VARIANT_STYLE.get(variant) or _TABLE_STYLE[tables.index(variant) % len(_TABLE_STYLE)]


def style_of_pad(pad: int) -> Style:
    """Colour, line style and marker of a pad (from 1)."""
    colour, dashes, marker = _PAD_STYLE[(pad - 1) % len(_PAD_STYLE)]
    return LIGHT[colour], dashes, marker


_WIDTH, _HEIGHT = 4.6, 3.1  # inches: legible in one column of a phone, and of a printed page
FONT_SIZE = 9.0
LEFT, _RIGHT, _BOTTOM, _TOP = 0.8, 0.15, 0.55, 0.15  # margins [inches]
_LINE = 0.172  # height of one line of text with its leading [inches]
CHARACTER = 0.074  # mean width of a character [inches]
_NOTEBOOK_DPI = 120


class Picture(Figure):
    """A figure that shows itself in a notebook, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=_NOTEBOOK_DPI)
        return buffer.getvalue()


def new_picture(
    x_label: str, y_label: str, *, title: str | None = None, width: float = _WIDTH, height: float = _HEIGHT
) -> tuple[Picture, Axes]:
    """Make a picture with one empty panel."""
    figure, ((axes,),) = new_pictures(1, 1, title=title, width=width, height=height)
    label(axes, x_label, y_label)
    return figure, axes


def new_pictures(
    rows: int,
    columns: int,
    *,
    title: str | None = None,
    width: float = _WIDTH,
    height: float | Sequence[float] = _HEIGHT,
) -> tuple[Picture, list[list[Axes]]]:
    """Make a picture with rows times columns of empty panels, each with its own margins; a height for all or each."""
    head = 1.6 * _LINE if title else 0.0
    heights = list(height) if isinstance(height, Sequence) else [height] * rows
    size = (columns * width, sum(heights) + head)
    figure = Picture(figsize=size, facecolor="white")
    FigureCanvasAgg(figure)
    grid = [
        [
            _panel(figure, (j * width + LEFT, sum(heights[i + 1 :]) + _BOTTOM, width - LEFT - _RIGHT,
                            heights[i] - _BOTTOM - _TOP))
            for j in range(columns)
        ]
        for i in range(rows)
    ]  # fmt: skip
    if title:
        figure.suptitle(title, x=0.5, y=1.0 - 0.06 / size[1], va="top", fontsize=FONT_SIZE + 1.0, color=INK, wrap=True)
    return figure, grid


class _Millions(ScalarFormatter):
    """Ticks of a hundred thousand and more as 0.4M: lbf/in would push the axis' label off the picture."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.fix_minus(f"{x / 1e6:g}M") if abs(x) >= 1e5 else super().__call__(x, pos)


def _panel(figure: Figure, box: tuple[float, float, float, float]) -> Axes:
    """Empty axes at a box in inches, in the house look."""
    width, height = figure.get_size_inches()
    axes = figure.add_axes((box[0] / width, box[1] / height, box[2] / width, box[3] / height))
    axes.patch.set_alpha(0.0)
    axes.yaxis.set_major_formatter(_Millions())
    axes.ticklabel_format(style="plain", useOffset=False)
    axes.tick_params(colors=INK, labelsize=FONT_SIZE, color=RULE, labelcolor=INK)
    axes.grid(True, color=RULE, linewidth=0.6, linestyle="-", alpha=1.0)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_color(RULE)
        spine.set_visible(side in ("left", "bottom"))
    return axes


def label(axes: Axes, x_label: str, y_label: str, heading: str | None = None) -> None:
    """Label both axes; a heading stands above the panel, which gives way."""
    axes.set_xlabel(x_label, fontsize=FONT_SIZE, color=INK)
    axes.set_ylabel(y_label, fontsize=FONT_SIZE, color=INK)
    if heading:
        shrink(axes, top=1.2 * _LINE)
        axes.set_title(heading, fontsize=FONT_SIZE, color=INK, pad=4.0)


def from_zero(axes: Axes) -> None:
    """Begin the vertical axis at zero, unless a value is below it, with room for the highest mark."""
    bottom, top = axes.dataLim.intervaly
    low, high = min(0.0, 1.1 * bottom), max(0.0, 1.1 * top)
    if low < high:
        axes.set_ylim(low, high)


def shrink(axes: Axes, *, left: float = 0.0, right: float = 0.0, top: float = 0.0, bottom: float = 0.0) -> None:
    """Take inches off the sides of a panel: room for names, a colour bar or a legend."""
    box = axes.get_position()
    width, height = _size(axes)
    axes.set_position((
        box.x0 + left / width, box.y0 + bottom / height,
        box.width - (left + right) / width, box.height - (top + bottom) / height,
    ))  # fmt: skip


def add_legend(
    axes: Axes, columns: int | None = None, handles: Sequence[Any] | None = None, across: bool = False
) -> Legend | None:
    """Put a frameless legend above the panel, which makes room for it; nothing if nothing is labelled."""
    drawn = list(axes.get_legend_handles_labels()[0] if handles is None else handles)
    if not drawn:
        return None
    names = [str(handle.get_label()) for handle in drawn]
    width, box = _size(axes)[0], axes.get_position()
    columns = columns or _columns(names, width - 0.1 if across else width * box.width + 0.4 * LEFT)
    columns = math.ceil(len(drawn) / math.ceil(len(drawn) / columns))  # no wider than the rows need
    centre = (0.5 - box.x0) / box.width if across else 0.5
    heading = 1.4 * _LINE if axes.get_title() else 0.0
    shrink(axes, top=_LINE * math.ceil(len(drawn) / columns) + 0.03)
    height = axes.get_position().height * _size(axes)[1]
    legend = axes.legend(
        handles=drawn, fontsize=FONT_SIZE, frameon=False, ncols=columns, loc="lower center", borderaxespad=0.2,
        bbox_to_anchor=(centre, 1.0 + heading / height), columnspacing=1.2, handlelength=2.6, labelspacing=0.35,
        labelcolor=INK,
    )  # fmt: skip
    return legend


def _size(axes: Axes) -> tuple[float, float]:
    """Width and height of the picture that holds a panel [inches]."""
    figure = axes.get_figure(root=True)
    width, height = figure.get_size_inches()  # type: ignore[union-attr]
    return float(width), float(height)


def _columns(names: Sequence[str], room: float) -> int:
    """Most columns whose widest entries, side by side, fit into `room` inches."""
    for columns in range(min(len(names), 4), 1, -1):
        rows = math.ceil(len(names) / columns)
        widest = [max(len(name) for name in names[j * rows : (j + 1) * rows] or [""]) for j in range(columns)]
        if sum(0.55 + CHARACTER * n for n in widest) <= room:
            return columns
    return 1


def add_colour_bar(axes: Axes, image: Any, text: str) -> None:
    """Put a colour bar right of a panel, which makes room for it."""
    shrink(axes, right=0.75)
    figure, box = axes.figure, axes.get_position()
    width = _size(axes)[0]
    bar_axes = figure.add_axes((box.x1 + 0.12 / width, box.y0, 0.14 / width, box.height))
    bar = figure.colorbar(image, cax=bar_axes)  # type: ignore[union-attr]
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(labelsize=FONT_SIZE - 1, colors=INK, color=RULE)
    bar.set_label(text, fontsize=FONT_SIZE, color=INK)


def mark_extrapolated(axes: Axes, start: float) -> None:
    """Shade everything right of `start` (in the panel's units) and say why."""
    end = axes.get_xlim()[1]
    if end > start:
        axes.axvspan(start, end, color=RULE, alpha=0.35, linewidth=0, zorder=0)
        axes.text(
            start, 0.02, " extrapolated", transform=axes.get_xaxis_transform(), fontsize=FONT_SIZE - 1,
            color=GREY, va="bottom", ha="left",
        )  # fmt: skip
        axes.set_xlim(right=end)
