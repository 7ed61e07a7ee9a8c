"""One look for all figures: colours that colour-blind readers can tell apart, text kept as text, light and dark.

Figures are matplotlib `Figure` objects without pyplot and without any global setting. A figure is drawn once in the
colours of `LIGHT`; saved files keep them, and the copy inside the report gets CSS variables in their place, so that it
follows the reader's light or dark screen.
"""

from __future__ import annotations

import functools
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.tables import write_atomic, write_text

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
#: How each pivot model is drawn everywhere: colour, line, marker. Line and marker tell them apart without colour.
VARIANT_STYLE = {
    "rigid": ("grey", (0, (1, 1.5)), "s"),
    "kirk": ("orange", (0, (5, 2)), "^"),
    "kirk-secant": ("purple", (0, (3, 1, 1, 1)), "v"),
    "measured": ("blue", "-", "D"),
}
VARIANT_LABEL = {
    "rigid": "rigid pivots",
    "kirk": "Kirk pivots",
    "kirk-secant": "Kirk, secant",
    "measured": "measured pivots",
}
PAD_STYLE = (
    ("blue", "-", "o"),
    ("red", (0, (5, 2)), "s"),
    ("green", (0, (3, 1, 1, 1)), "^"),
    ("purple", (0, (1, 1.5)), "D"),
    ("orange", (0, (8, 2, 1, 2)), "v"),
)
WIDTH, HEIGHT = 5.2, 3.4  # inches: legible in one column of a phone
FONT_SIZE = 9.0
PNG_DPI = 160
_FONT = re.compile(r"font: (?:(italic|oblique) )?(?:(bold|\d+) )?([\d.]+)px [^;\"]*")
_ID = re.compile(r"(\bid=\"|href=\"#|url\(#)([^\")]+)")


@dataclass(frozen=True)
class Panel:
    """One figure of a report.

    Attributes
    ----------
    name : str
        File name without suffix, and anchor in the report.
    title : str
        What it shows, in words.
    figure : Figure
    group : str
        Heading under which it stands.
    """

    name: str
    title: str
    figure: Figure
    group: str


def new_panel(x_label: str, y_label: str, width: float = WIDTH, height: float = HEIGHT) -> tuple[Figure, Axes]:
    """Make an empty panel in the house look.

    Parameters
    ----------
    x_label, y_label : str
        With units.
    width, height : float
        Inches.
    """
    figure = Figure(figsize=(width, height))
    figure.patch.set_alpha(0.0)
    # fixed margins: they suit every panel, line up side by side, and save the layout solver's time
    axes = figure.add_axes((0.8 / width, 0.55 / height, 1.0 - 0.95 / width, 1.0 - 1.15 / height))
    axes.patch.set_alpha(0.0)
    axes.set_xlabel(x_label, fontsize=FONT_SIZE, color=LIGHT["ink"])
    axes.set_ylabel(y_label, fontsize=FONT_SIZE, color=LIGHT["ink"])
    axes.tick_params(colors=LIGHT["ink"], labelsize=FONT_SIZE, color=LIGHT["rule"])
    axes.grid(True, color=LIGHT["rule"], linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_color(LIGHT["rule"])
        spine.set_visible(side in ("left", "bottom"))
    return figure, axes


def add_legend(axes: Axes, columns: int = 2) -> None:
    """Add a frameless legend above the panel; nothing if nothing is labelled."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        legend = axes.legend(
            handles, labels, fontsize=FONT_SIZE, frameon=False, ncols=columns, loc="lower center",
            bbox_to_anchor=(0.5, 1.0), columnspacing=1.2, handlelength=2.6, borderaxespad=0.2,
        )  # fmt: skip
        for text in legend.get_texts():
            text.set_color(LIGHT["ink"])


def svg_text(figure: Figure, name: str) -> str:
    """Draw a figure as SVG with text as text; the same figure gives the same bytes."""
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def inline_svg(text: str, name: str, title: str) -> str:
    """Turn the text of an SVG file into an element of a page: page colours, page font, unique ids, a spoken title.

    Parameters
    ----------
    text : str
        As `svg_text` gives it.
    name : str
        Prefix of the ids.
    title : str
        What a screen reader says; must be escaped already.
    """
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


def save_panels(panels: Sequence[Panel], folder: Path) -> dict[str, str]:
    """Write every panel as SVG and PNG, on white ground; return the SVG texts, without ground, by name."""
    folder.mkdir(exist_ok=True)
    texts = {panel.name: svg_text(panel.figure, panel.name) for panel in panels}
    for panel in panels:
        write_text(folder / f"{panel.name}.svg", _on_white(texts[panel.name]))
        write_atomic(folder / f"{panel.name}.png", functools.partial(_save_png, panel.figure))
    return texts


def _on_white(svg: str) -> str:
    """Give a file of its own a ground: dark viewers would swallow the ink."""
    start = svg.index(">", svg.index("<svg")) + 1
    return f'{svg[:start]}<rect width="100%" height="100%" fill="white"/>{svg[start:]}'


def _save_png(figure: Figure, path: Path) -> None:
    figure.savefig(path, format="png", dpi=PNG_DPI, facecolor="white", pil_kwargs={"compress_level": 4})
