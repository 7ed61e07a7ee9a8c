"""Colours that colour-blind readers can tell apart, and the lines and markers that need no colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.colors import LinearSegmentedColormap

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
#: Colour, line and marker.
Style = tuple[str, Any, str]
#: How each pivot model is drawn everywhere: colour, line, marker. Line and marker tell them apart without colour.
VARIANT_STYLE: dict[str, Style] = {
    "rigid": ("grey", (0, (1, 1.5)), "s"),
    "kirk": ("orange", (0, (5, 2)), "^"),
    "kirk-secant": ("purple", (0, (3, 1, 1, 1)), "v"),
    "measured": ("blue", "-", "D"),
    "model before": ("orange", (0, (5, 2)), "^"),
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
    ("red", (0, (5, 2)), "s"),
    ("green", (0, (3, 1, 1, 1)), "^"),
    ("purple", (0, (1, 1.5)), "D"),
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
