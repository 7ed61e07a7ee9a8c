"""Values at the points of a picture: each marker carries its numbers as an SVG title, which browsers show on hover.

No script is needed, and what is printed or read aloud is complete without them: the same numbers stand in the tables.
"""

from __future__ import annotations

import functools
import html
import re
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tpjb_ident.runtime.tables import printable

_USE = re.compile(r'<use xlink:href="#[^"]*" x="([-\d.]+)" y="([-\d.]+)"([^>]*)/>')
_POINTS_PER_INCH = 72.0
#: Markers are found again by their place in the drawing [points].
_NEAR = 0.05


@dataclass(frozen=True)
class Spots:
    """Markers of one line: where they are drawn and what they say."""

    gid: str
    places: np.ndarray
    texts: tuple[str, ...]


def mark_lines(figure: Figure) -> tuple[Spots, ...]:
    """Give every line with markers a name that the SVG keeps, and work out what its points say."""
    found = []
    for i, axes in enumerate(figure.axes):
        axes.get_xlim(), axes.get_ylim()  # limits are set late: asking settles them
        axes.apply_aspect()
        labels, halves = _errorbars(axes)
        for j, line in enumerate(axes.lines):
            if line.get_marker() in ("", "None", " ", None) or len(np.asarray(line.get_xdata())) > 400:
                continue
            line.set_gid(f"spots-{i}-{j}")
            found.append(_spots(figure, axes, line, labels.get(line, str(line.get_label())), halves.get(line)))
    return tuple(found)


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


def _spots(figure: Figure, axes: Axes, line: Line2D, label: str, half: np.ndarray | None) -> Spots:
    x = np.asarray(line.get_xdata(), dtype=float)
    y = np.asarray(line.get_ydata(), dtype=float)
    shown = axes.transData.transform(np.column_stack([x, y])) * _POINTS_PER_INCH / figure.dpi
    height = figure.get_size_inches()[1] * _POINTS_PER_INCH
    places = np.column_stack([shown[:, 0], height - shown[:, 1]])
    name = "" if label.startswith("_") else f"{printable(label)}: "
    xl, yl = printable(axes.get_xlabel()), printable(axes.get_ylabel())
    texts = []
    for k in range(len(x)):
        spread = f" ± {half[k]:.2g}" if half is not None and k < len(half) and np.isfinite(half[k]) else ""
        texts.append(f"{name}{_with_unit(yl, y[k], spread)} at {_with_unit(xl, x[k])}")
    return Spots(str(line.get_gid()), places, tuple(texts))


def _with_unit(label: str, value: float, spread: str = "") -> str:
    """``kxx 66 ± 0.5 MN/m`` of the axis label ``kxx, MN/m``."""
    name, _, unit = label.rpartition(", ")
    name, unit = (name, unit) if name else (unit, "")
    return f"{name} {value:.4g}{spread} {unit}".strip()


def with_titles(svg: str, spots: tuple[Spots, ...]) -> str:
    """Put a title into every marker of the drawing that `mark_lines` knows."""
    for one in spots:
        start = svg.find(f'<g id="{one.gid}"')
        if start < 0:
            continue
        end = _end_of_group(svg, start)
        svg = svg[:start] + _USE.sub(functools.partial(_titled, one), svg[start:end]) + svg[end:]
    return svg


def _end_of_group(svg: str, start: int) -> int:
    depth = 0
    for match in re.compile(r"<g[ >]|</g>").finditer(svg, start):
        depth += -1 if match[0] == "</g>" else 1
        if depth == 0:
            return match.end()
    return len(svg)


def _titled(one: Spots, match: re.Match[str]) -> str:
    place = np.array([float(match[1]), float(match[2])])
    with np.errstate(invalid="ignore"):  # a spot off the axes has no place, and NaN is never near
        away = np.abs(one.places - place).max(axis=1)
    if not np.isfinite(away).any():
        return match[0]
    best = int(np.nanargmin(away))
    if away[best] > _NEAR:
        return match[0]
    return f"{match[0][:-2]}><title>{html.escape(one.texts[best])}</title></use>"
