"""Colours that colour-blind readers can tell apart, and the lines and markers that need no colour."""

from __future__ import annotations

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
#: How each pivot model is drawn everywhere: colour, line, marker. Line and marker tell them apart without colour.
VARIANT_STYLE: dict[str, tuple[str, Any, str]] = {
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
_PAD_STYLE: tuple[tuple[str, Any, str], ...] = (
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


def style_of_pad(pad: int) -> tuple[str, Any, str]:
    """Colour, line style and marker of a pad (from 1)."""
    colour, dashes, marker = _PAD_STYLE[(pad - 1) % len(_PAD_STYLE)]
    return LIGHT[colour], dashes, marker
