"""Outcomes: shares of right answers, abstentions and wrong names, one bar per sort of campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import CHARACTER, FONT_SIZE, LEFT, add_legend, new_picture, shrink

#: Colour and hatch of every outcome: right, shy, wrong.
STYLE: dict[str, tuple[str, str | None]] = {
    "named right": ("blue", None),
    "right": ("blue", None),
    "group right": ("blue", "////"),
    "large group": ("green", "...."),
    "ambiguous": ("green", "...."),
    "unexplained": ("purple", "xxxx"),
    "consistent": ("grey", None),
    "no name": ("grey", None),
    "part of it": ("orange", "////"),
    "group wrong": ("orange", "...."),
    "named wrong": ("red", None),
    "wrong": ("red", None),
    "not settled": ("grey", None),
}


def outcomes(
    shares: Mapping[str, Mapping[str, float]],
    trials: Sequence[int] | None = None,
    *,
    x_label: str = "share of campaigns",
    title: str | None = None,
) -> Figure:
    """Draw one bar per sort of campaign, split by what came out.

    Parameters
    ----------
    shares : mapping of str to mapping of str to float
        Counts or shares of outcomes (`STYLE`), per bar; each bar is drawn to a length of one.
    trials : sequence of int, optional
        Written behind every bar.
    x_label : str
    title : str, optional

    Returns
    -------
    Figure
    """
    if not shares:
        raise ValueError("there is no outcome to draw")
    unknown = {name for bar in shares.values() for name in bar} - STYLE.keys()
    if unknown:
        raise ValueError(f"outcomes must be among {', '.join(STYLE)}, got {', '.join(sorted(unknown))}")
    words = list(shares)
    figure, axes = new_picture(x_label, "", title=title, height=0.3 * len(words) + 1.5)
    shrink(axes, left=max(CHARACTER * max(map(len, words)) + 0.2 - LEFT, 0.0), right=0.35 if trials else 0.1)
    for name, (colour, hatch) in STYLE.items():
        if not any(bar.get(name, 0.0) for bar in shares.values()):
            continue
        widths, starts = [], []
        for bar in shares.values():
            total = sum(bar.values()) or 1.0
            widths.append(bar.get(name, 0.0) / total)
            starts.append(sum(bar.get(other, 0.0) for other in _before(name)) / total)
        axes.barh(range(len(words)), widths, 0.66, left=starts, hatch=hatch, edgecolor=LIGHT[colour],
                  color=LIGHT[colour] if hatch is None else LIGHT["paper"], linewidth=0.8, label=name)  # fmt: skip
    for at, count in enumerate(trials or ()):
        axes.annotate(f"{count:.0f}", (1.0, at), xytext=(5, 0), textcoords="offset points", va="center",
                      fontsize=FONT_SIZE - 1, color=LIGHT["ink"])  # fmt: skip
    axes.set_yticks(range(len(words)), words)
    axes.set_ylim(len(words) - 0.4, -0.6)
    axes.set_xlim(0.0, 1.0)
    axes.grid(axis="y", visible=False)
    add_legend(axes, across=True)
    return figure


def _before(name: str) -> list[str]:
    order = list(STYLE)
    return order[: order.index(name)]
