"""Pictures inside a page: text kept as text, light and dark.

A picture (`tpjb_ident.report.plots`) is drawn once in the colours of `LIGHT`; saved files keep them, and the copy
inside the report gets CSS variables in their place, so that it follows the reader's light or dark screen.
"""

from __future__ import annotations

import functools
import io
import itertools
import multiprocessing
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from PIL import Image

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import new_picture
from tpjb_ident.report.hover import mark_lines, with_titles
from tpjb_ident.runtime.executors import cores, in_order, local_workers
from tpjb_ident.runtime.tables import write_atomic, write_text

PNG_DPI = 160
_FONT = re.compile(r"font: (?:(italic|oblique) )?(?:(bold|\d+) )?([\d.]+)px [^;\"]*")
_SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')
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
    found = _SIZE.search(svg)
    assert found is not None
    width, height = float(found[1]), float(found[2])
    if width > 1.35 * height and width > 6.5 * 72.0:
        return "wide"
    return "tall" if height > 0.8 * width else ""


#: Panels from which on a second process draws too, and how many processes do at most.
TOGETHER, MOST_HANDS = 6, 4
#: What is being drawn, for processes that are forked from this one.
_drawn: dict[int, tuple[Panel, ...]] = {}
_numbers = itertools.count()


def panel(name: str, title: str, figure: Figure | Callable[[], Figure], group: str) -> Panel:
    """Make a panel of a picture."""
    return Panel(name, title, figure if callable(figure) else lambda: figure, group)


def svg_text(figure: Figure, name: str) -> str:
    """Draw a figure as SVG with text as text, markers with their values; the same figure gives the same bytes."""
    buffer = io.StringIO()
    spots = mark_lines(figure)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return with_titles(buffer.getvalue(), spots)


def inline_svg(text: str, name: str, title: str) -> str:
    """Turn the text of an SVG file into an element of a page: page colours, page font, unique ids, a spoken title."""
    body = text[text.index("<svg") :]
    for role, colour in LIGHT.items():
        body = body.replace(colour, f"var(--{role})")
    body = _FONT.sub(lambda m: f"font-style: {m[1] or 'normal'}; font-weight: {m[2] or 'normal'}; "
                     f"font-size: {m[3]}px", body)  # fmt: skip
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.S)
    body = prefixed_ids(body, name)
    head, rest = body.split(">", 1)
    head = re.sub(r'\s(width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{title}">{rest}'


def prefixed_ids(svg: str, prefix: str) -> str:
    """Rename every id and what refers to it, so that several drawings can share one page."""
    return _ID.sub(rf"\g<1>{prefix}-\g<2>", svg)


def make_ready() -> None:
    """Draw a picture for nobody: fonts and both ways to write are loaded, also for processes forked from this one."""
    figure, _ = new_picture("x", "y")
    svg_text(figure, "x")
    _save_png(figure, io.BytesIO())


def save_panels(panels: Sequence[Panel], folder: Path) -> dict[str, str]:
    """Write every panel as SVG and PNG, on white ground; return the SVG texts, without ground, by name."""
    folder.mkdir(exist_ok=True)
    number = next(_numbers)
    _drawn[number] = tuple(panels)
    try:
        # forked: what is drawn is there already, and a few panels are not worth a second process
        alone = len(panels) < TOGETHER or "fork" not in multiprocessing.get_all_start_methods()
        with local_workers(1 if alone else min(cores(), MOST_HANDS), start="fork") as opened:
            jobs = [(number, index, folder) for index in range(len(panels))]
            texts = list(in_order(opened, _save_panel, jobs))
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
    figure.savefig(pixels, format="rgba", dpi=PNG_DPI, facecolor="white")
    width, height = (int(inches * PNG_DPI) for inches in figure.get_size_inches())
    opaque = Image.frombytes("RGBA", (width, height), pixels.getvalue()).convert("RGB")  # a third of the file
    opaque.save(path, format="PNG", dpi=(PNG_DPI, PNG_DPI), compress_level=4)
