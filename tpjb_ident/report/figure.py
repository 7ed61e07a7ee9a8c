"""Pictures inside a page: text kept as text, light and dark.

A picture (`tpjb_ident.report.plots`) is drawn once in the colours of `LIGHT`; saved files keep them, and the copy
inside the report gets CSS variables in their place, so that it follows the reader's light or dark screen.
"""

from __future__ import annotations

import functools
import html
import io
import itertools
import multiprocessing
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.rounding import significant
from tpjb_ident.runtime.executors import cores, local_workers, map_ordered
from tpjb_ident.runtime.tables import printable, write_atomic, write_text

_PNG_DPI = 160
_FONT = re.compile(r"font: (?:(italic|oblique) )?(?:(bold|\d+) )?([\d.]+)px [^;\"]*")
_SIZE = re.compile(r'viewBox="0 [\d.]+ ([\d.]+) ([\d.]+)"')
_USE = re.compile(r'<use xlink:href="#[^"]*" x="([-\d.]+)" y="([-\d.]+)"([^>]*)/>')
_POINTS_PER_INCH = 72.0
#: Between the last line of a legend and its panel [points].
_BELOW_LEGEND = 2.0
#: Markers are found again by their place in the drawing [points].
_NEAR = 0.05
_ID = re.compile(r"(\bid=\"|href=\"#|url\(#)([^\")]+)")


@dataclass(frozen=True)
class Panel:
    """One figure of a report."""

    name: str
    title: str
    drawing: Callable[[], Figure]
    group: str

    @functools.cached_property
    def figure(self) -> Figure:
        """The picture, without its white ground: the page's own shows through."""
        figure = self.drawing()
        figure.patch.set_alpha(0.0)
        return figure


def shape(svg: str) -> str:
    """How a picture stands on a page: ``"wide"``, several panels side by side; ``"tall"``, on top of each other.

    Or "".
    """
    size = _SIZE.search(svg)
    assert size is not None
    width, height = float(size[1]), float(size[2])
    if width > 1.35 * height and width > 6.5 * 72.0:
        return "wide"
    return "tall" if height > 0.8 * width else ""


#: Panels from which on a second process draws too, and how many processes do at most.
_TOGETHER, _MOST_HANDS = 6, 4
#: What is being drawn, for processes that are forked from this one.
_drawn: dict[int, tuple[Panel, ...]] = {}
_numbers = itertools.count()


def panel(name: str, title: str, figure: Figure | Callable[[], Figure], group: str) -> Panel:
    """Make a panel of a picture."""
    return Panel(name, title, figure if callable(figure) else lambda: figure, group)


def svg_text(figure: Figure, name: str) -> str:
    """Draw a figure as SVG with text as text, markers with their values; the same figure gives the same bytes."""
    buffer = io.StringIO()
    points = _hover_points(figure)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return _with_titles(buffer.getvalue(), points)


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


def without_legend(svg: str) -> tuple[str, frozenset[str]]:
    """A drawing with its legend hidden (it may define marks that others use), its room cut off, and its words."""
    start, size = svg.find('<g id="legend_1">'), _SIZE.search(svg)
    if start < 0 or size is None or '<g id="legend_2">' in svg:
        return svg, frozenset()
    end = _end_of_group(svg, start)
    texts = re.findall(r'y="([\d.]+)"[^>]*>([^<]+)</text>', svg[start:end])
    bottom = max(float(y) for y, _ in texts) + _BELOW_LEGEND
    width, height = float(size[1]), float(size[2])
    cut = f'{svg[:start]}<g visibility="hidden"{svg[start + 2 :]}'.replace(
        size[0], f'viewBox="0 {bottom:.2f} {width:g} {height - bottom:.2f}"', 1
    )
    return cut, frozenset(words for _, words in texts)


def prefixed_ids(svg: str, prefix: str) -> str:
    """Rename every id and what refers to it, so that several drawings can share one page."""
    return _ID.sub(rf"\g<1>{prefix}-\g<2>", svg)


def save_panels(panels: Sequence[Panel], folder: Path) -> dict[str, str]:
    """Write every panel as SVG and PNG, on white ground; return the SVG texts, without ground, by name."""
    folder.mkdir(exist_ok=True)
    number = next(_numbers)
    _drawn[number] = tuple(panels)
    try:
        # forked: what is drawn is there already, and a few panels are not worth a second process
        alone = len(panels) < _TOGETHER or "fork" not in multiprocessing.get_all_start_methods()
        with local_workers(1 if alone else min(cores(), _MOST_HANDS), start="fork") as opened:
            jobs = [(number, index, folder) for index in range(len(panels))]
            texts = list(map_ordered(opened, _save_panel, jobs))
    finally:
        del _drawn[number]
    return {panel.name: text for panel, text in zip(panels, texts, strict=True)}


def _save_panel(number: int, index: int, folder: Path) -> str:
    """Write one panel; its text as SVG."""
    panel = _drawn[number][index]
    text = svg_text(panel.figure, panel.name)
    write_text(folder / f"{panel.name}.svg", _on_white(text))
    write_atomic(folder / f"{panel.name}.png", functools.partial(_save_png, panel.figure))
    return text


def _on_white(svg: str) -> str:
    """Give a file of its own a ground: dark viewers would swallow the ink."""
    start = svg.index(">", svg.index("<svg")) + 1
    return f'{svg[:start]}<rect width="100%" height="100%" fill="white"/>{svg[start:]}'


def _save_png(figure: Figure, path: Path | io.BytesIO) -> None:
    pixels = io.BytesIO()
    figure.savefig(pixels, format="rgba", dpi=_PNG_DPI, facecolor="white")
    width, height = (int(inches * _PNG_DPI) for inches in figure.get_size_inches())
    opaque = Image.frombytes("RGBA", (width, height), pixels.getvalue()).convert("RGB")  # a third of the file
    opaque.save(path, format="PNG", dpi=(_PNG_DPI, _PNG_DPI), compress_level=4)


@dataclass(frozen=True)
class _HoverPoints:
    """Markers of one line: where they are drawn and what they say."""

    gid: str
    places: np.ndarray
    texts: tuple[str, ...]


def _hover_points(figure: Figure) -> tuple[_HoverPoints, ...]:
    """Give every line with markers a name that the SVG keeps, and work out what its points say."""
    lines = []
    for i, axes in enumerate(figure.axes):
        axes.get_xlim(), axes.get_ylim()  # limits are set late: asking settles them
        axes.apply_aspect()
        labels, halves = _errorbars(axes)
        for j, line in enumerate(axes.lines):
            if line.get_marker() in ("", "None", " ", None) or len(np.asarray(line.get_xdata())) > 400:
                continue
            line.set_gid(f"spots-{i}-{j}")
            label = labels.get(line, str(line.get_label()))
            lines.append(_points_of_line(figure, axes, line, label, halves.get(line)))
    return tuple(lines)


def _errorbars(axes: Axes) -> tuple[dict[Line2D, str], dict[Line2D, np.ndarray]]:
    """Label and half-widths of the intervals, of the lines that are drawn with error bars."""
    labels, halves = {}, {}
    for container in axes.containers:
        if isinstance(container, ErrorbarContainer) and isinstance(container[0], Line2D):
            labels[container[0]] = str(container.get_label())
            bars = container[2]
            if bars and container.has_yerr and not container.has_xerr:
                segments = bars[0].get_segments()
                halves[container[0]] = np.array([0.5 * abs(s[-1][1] - s[0][1]) if len(s) else np.nan for s in segments])
    return labels, halves


def _points_of_line(figure: Figure, axes: Axes, line: Line2D, label: str, half: np.ndarray | None) -> _HoverPoints:
    x = np.asarray(line.get_xdata(), dtype=float)
    y = np.asarray(line.get_ydata(), dtype=float)
    shown = axes.transData.transform(np.column_stack([x, y])) * _POINTS_PER_INCH / figure.dpi
    height = figure.get_size_inches()[1] * _POINTS_PER_INCH
    places = np.column_stack([shown[:, 0], height - shown[:, 1]])
    name = "" if label.startswith("_") else f"{printable(label)}: "
    xl, yl = printable(axes.get_xlabel()), printable(axes.get_ylabel())
    texts = []
    for k in range(len(x)):
        spread = (
            f" ± {significant(half[k], '.2g')}" if half is not None and k < len(half) and np.isfinite(half[k]) else ""
        )
        texts.append(f"{name}{_with_unit(yl, y[k], spread)} at {_with_unit(xl, x[k])}")
    return _HoverPoints(str(line.get_gid()), places, tuple(texts))


def _with_unit(label: str, value: float, spread: str = "") -> str:
    """``kxx 66 ± 0.5 MN/m`` of the axis label ``kxx, MN/m``."""
    name, _, unit = label.rpartition(", ")
    name, unit = (name, unit) if name else (unit, "")
    return f"{name} {significant(value)}{spread} {unit}".strip()


def _with_titles(svg: str, lines: tuple[_HoverPoints, ...]) -> str:
    """Put a title into every marker of the drawing that `_hover_points` knows."""
    for points in lines:
        start = svg.find(f'<g id="{points.gid}"')
        if start < 0:
            continue
        end = _end_of_group(svg, start)
        svg = svg[:start] + _USE.sub(functools.partial(_titled, points), svg[start:end]) + svg[end:]
    return svg


def _end_of_group(svg: str, start: int) -> int:
    depth = 0
    for match in re.compile(r"<g(?: [^>]*)?(?<!/)>|</g>").finditer(svg, start):
        depth += -1 if match[0] == "</g>" else 1
        if depth == 0:
            return match.end()
    return len(svg)


def _titled(points: _HoverPoints, match: re.Match[str]) -> str:
    place = np.array([float(match[1]), float(match[2])])
    with np.errstate(invalid="ignore"):  # a spot off the axes has no place, and NaN is never near
        away = np.abs(points.places - place).max(axis=1)
    if not np.isfinite(away).any():
        return match[0]
    best = int(np.nanargmin(away))
    if away[best] > _NEAR:
        return match[0]
    return f"{match[0][:-2]}><title>{html.escape(points.texts[best])}</title></use>"
