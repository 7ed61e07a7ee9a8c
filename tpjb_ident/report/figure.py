"""Pictures inside a page: text kept as text, light and dark.

A picture (`tpjb_ident.report.plots`) is drawn once in the colours of `LIGHT`; saved files keep them, and the copy
inside the report gets CSS variables in their place, so that it follows the reader's light or dark screen.
"""

import functools
import html
import io
import multiprocessing
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.picture import LIGHT, in_house_style
from tpjb_ident.rounding import significant
from tpjb_ident.runtime.executors import cores, local_workers
from tpjb_ident.runtime.tables import printable, write_atomic, write_text

_PNG_DPI = 160
_FONT = re.compile(r"font: (?:(italic|oblique) )?(?:(bold|\d+) )?([\d.]+)px [^;\"]*")
_WIDTH = re.compile(r'viewBox="0 0 ([\d.]+) ')
_USE = re.compile(r'<use xlink:href="#[^"]*" x="([-\d.]+)" y="([-\d.]+)"([^>]*)/>')
_POINTS_PER_INCH = 72.0
#: Markers are found again by their place in the drawing [points].
_NEAR = 0.05
#: More markers on a line are a cloud.
_MOST_POINTS = 400
_ID = re.compile(r"(\bid=\"|href=\"#|url\(#)([^\")]+)")


class Panel:
    """One figure of a report: a picture, or a function that draws it and its arguments."""

    def __init__(self, name: str, title: str, drawing: Figure | Callable[..., Figure], *arguments: Any) -> None:
        self.name, self.title = name, title
        self._drawing, self._arguments = drawing, arguments

    @functools.cached_property
    def figure(self) -> Figure:
        """The picture, without its white ground: the page's own shows through."""
        figure = self._drawing(*self._arguments) if callable(self._drawing) else self._drawing
        figure.patch.set_alpha(0.0)
        return figure


def is_wide(svg: str) -> bool:
    """Whether a picture takes a whole row of a page: half a page would make its text too small."""
    width = _WIDTH.search(svg)
    return width is not None and float(width[1]) > 6.5 * _POINTS_PER_INCH


#: Panels from which on a second process draws too, and how many processes do at most.
_TOGETHER, _MOST_HANDS = 6, 4
#: What is being drawn, for processes that are forked from this one.
_drawn: list[Panel] = []


@in_house_style
def svg_text(figure: Figure, name: str) -> str:
    """Draw a figure as SVG with text as text, markers with their values; the same figure gives the same bytes."""
    buffer = io.StringIO()
    points = _hover_points(figure)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return _USE.sub(functools.partial(_titled, points), buffer.getvalue())


def inline_svg(text: str, name: str, title: str) -> str:
    """Turn the text of an SVG file into an element of a page: page colours, page font, unique ids, a spoken title."""
    body = text[text.index("<svg") :]
    for role, colour in LIGHT.items():
        body = body.replace(colour, f"var(--{role})")
    body = _FONT.sub(lambda m: f"font-style: {m[1] or 'normal'}; font-weight: {m[2] or 'normal'}; "
                     f"font-size: {m[3]}px", body)  # fmt: skip
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.S)
    body = prefixed_ids(body, name)
    head, content = body.split(">", 1)
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{title}">{content}'


def prefixed_ids(svg: str, prefix: str) -> str:
    """Rename every id and what refers to it, so that several drawings can share one page."""
    return _ID.sub(rf"\g<1>{prefix}-\g<2>", svg)


def save_panels(panels: Sequence[Panel], folder: Path) -> dict[str, str]:
    """Write every panel as SVG and PNG, on white ground; return the SVG texts, without ground, by name."""
    folder.mkdir(exist_ok=True)
    _drawn[:] = panels
    # forked: what is drawn is there already, and a few panels are not worth a second process
    alone = len(panels) < _TOGETHER or "fork" not in multiprocessing.get_all_start_methods()
    with local_workers(1 if alone else min(cores(), _MOST_HANDS), start="fork") as opened:
        texts = list(opened.map(_save_panel, [(index, folder) for index in range(len(panels))]))
    _drawn.clear()
    return {panel.name: text for panel, text in zip(panels, texts, strict=True)}


def _save_panel(index: int, folder: Path) -> str:
    """Write one panel; its text as SVG."""
    panel = _drawn[index]
    text = svg_text(panel.figure, panel.name)
    ground = text.index(">", text.index("<svg")) + 1  # in a file of its own: dark viewers would swallow the ink
    on_white = f'{text[:ground]}<rect width="100%" height="100%" fill="white"/>{text[ground:]}'
    write_text(folder / f"{panel.name}.svg", on_white)
    save = functools.partial(panel.figure.savefig, format="png", dpi=_PNG_DPI, facecolor="white")
    write_atomic(folder / f"{panel.name}.png", save)
    return text


def _hover_points(figure: Figure) -> tuple[np.ndarray, list[str]]:
    """Where every marker is drawn, (n, 2) points of the SVG, and what it says: label, value and interval, units."""
    places, texts = [np.zeros((0, 2))], []
    height = figure.get_size_inches()[1] * _POINTS_PER_INCH
    for axes in figure.axes:
        axes.get_xlim(), axes.get_ylim()  # limits are set late: asking settles them
        axes.apply_aspect()
        xl, yl = printable(axes.get_xlabel()), printable(axes.get_ylabel())
        containers = {bars[0]: bars for bars in axes.containers if isinstance(bars, ErrorbarContainer)}
        for line in axes.lines:
            points = np.asarray(line.get_xydata())
            if line.get_marker() in ("", "None", " ", None) or len(points) > _MOST_POINTS:
                continue
            shown = axes.transData.transform(points) * _POINTS_PER_INCH / figure.dpi
            places.append(np.column_stack([shown[:, 0], height - shown[:, 1]]))
            bars, halves = containers.get(line), np.full(len(points), np.nan)
            label = str((line if bars is None else bars).get_label())
            name = "" if label.startswith("_") else f"{printable(label)}: "
            if bars is not None and bars[2] and bars.has_yerr and not bars.has_xerr:
                for k, ends in enumerate(bars[2][0].get_segments()):
                    halves[k] = 0.5 * abs(ends[-1][1] - ends[0][1]) if len(ends) else np.nan
            for (x, y), half in zip(points, halves, strict=True):
                spread = f" ± {significant(half, '.2g')}" if np.isfinite(half) else ""
                texts.append(f"{name}{_with_unit(yl, y, spread)} at {_with_unit(xl, x)}")
    return np.concatenate(places), texts


def _with_unit(label: str, value: float, spread: str = "") -> str:
    """``kxx 66 ± 0.5 MN/m`` of the axis label ``kxx, MN/m``."""
    name, _, unit = label.rpartition(", ")
    name, unit = (name, unit) if name else (unit, "")
    return f"{name} {significant(value)}{spread} {unit}".strip()


def _titled(points: tuple[np.ndarray, list[str]], match: re.Match[str]) -> str:
    """A mark of the drawing with a title, where it is a marker that says something."""
    places, texts = points
    with np.errstate(invalid="ignore"):  # a point off the axes has no place, and NaN is never near
        near = np.flatnonzero(np.abs(places - [float(match[1]), float(match[2])]).max(axis=1) < _NEAR)
    words = html.escape("; ".join(dict.fromkeys(texts[i] for i in near)))
    return f"{match[0][:-2]}><title>{words}</title></use>" if words else match[0]
