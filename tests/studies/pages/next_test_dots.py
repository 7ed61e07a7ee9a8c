"""Next tests: what was foretold, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures
from tpjb_ident.rounding import MINUS

if TYPE_CHECKING:
    import pandas as pd

STYLE = {"suggested": ("blue", "o", "full"), "random": ("orange", "^", "none")}
#: Share that a next test is meant to settle.
MEANT = 0.8


def next_tests(
    table: pd.DataFrame, separations: Mapping[str, Sequence[tuple[float, float]]], *, title: str | None = None
) -> Figure:
    """Draw shares settled by the suggested and by a random test, and achieved against expected separations.

    Parameters
    ----------
    table : DataFrame
        As of `tests.studies.evidence.next_tests.next_test_table`.
    separations : mapping of str to sequence of (expected, achieved)
        By ``"suggested"`` and ``"random"`` [standard deviations].
    title : str, optional

    Returns
    -------
    Figure
    """
    whole = table[table["size_sigma"] == "all"]
    if not len(whole):
        raise ValueError("the table is empty; there is nothing to draw")
    figure, ((left, right),) = new_pictures(1, 2, title=title, height=3.9)
    _shares(left, whole)
    _scatter(right, separations)
    return figure


def _shares(axes: Axes, whole: pd.DataFrame) -> None:
    label(axes, "data set (ambiguous campaigns)", "share of campaigns")
    x = np.arange(len(whole))
    for offset, value, ends, words, name in (
        (-0.1, "settled", "settled", "truth alone named after the suggested test", "suggested"),
        (0.1, "settled_by_random", "random", "after a random one", "random"),
    ):
        colour, marker, fill = STYLE[name]
        y = whole[value].to_numpy(dtype=float)
        bars = np.abs(np.array([y - whole[f"{ends}_lo"], whole[f"{ends}_hi"] - y], dtype=float))
        axes.errorbar(x + offset, y, yerr=bars, fmt=marker, color=LIGHT[colour], fillstyle=fill, markersize=6,
                      capsize=3, linewidth=1.1, label=words)  # fmt: skip
    axes.plot(x - 0.1, whole["settled_expected"], "_", color=LIGHT["ink"], markersize=14, label="foretold")
    axes.axhline(MEANT, color=LIGHT["ink"], linestyle=(0, (2, 2)), linewidth=0.9, label=f"meant: {MEANT:g}")
    names = [f"{a} ({n:.0f})" for a, n in zip(whole["data_set"], whole["ambiguous_campaigns"], strict=True)]
    axes.set_xticks(x, names)
    axes.set_xlim(-0.5, len(x) - 0.5)
    axes.set_ylim(-0.03, 1.03)
    add_legend(axes)


def _scatter(axes: Axes, separations: Mapping[str, Sequence[tuple[float, float]]]) -> None:
    label(axes, "expected separation, standard deviations", "achieved separation, standard deviations")
    top, bottom = 1.0, 0.0
    for name, pairs in separations.items():
        colour, marker, fill = STYLE[name]
        points = np.array(pairs)
        axes.plot(points[:, 0], points[:, 1], marker, color=LIGHT[colour], fillstyle=fill, markersize=4.5,
                  label=f"{name} ({len(points)})")  # fmt: skip
        top, bottom = max(top, 1.1 * float(points.max())), min(bottom, 1.1 * float(points.min()))
    axes.plot([0.0, top], [0.0, top], color=LIGHT["ink"], linestyle=(0, (2, 2)), linewidth=0.9, label="as expected")
    axes.axhline(3.0, color=LIGHT["red"], linewidth=0.9, label="told apart above")
    axes.set_xscale("symlog", linthresh=3.0)
    axes.set_yscale("symlog", linthresh=3.0)
    both = sorted({sign * t for t in (0, 1, 2, 3, 6, 10, 20, 50, 100, 200, 500) for sign in (-1, 1)})
    for axis, low in ((axes.xaxis, 0.0), (axes.yaxis, bottom)):
        ticks = [t for t in both if low <= t <= top]
        axis.set_ticks(ticks, [f"{t:g}".replace("-", MINUS) for t in ticks])
        axis.set_minor_locator(NullLocator())
    axes.set_xlim(-0.3, top)
    axes.set_ylim(bottom - 0.3, top)
    add_legend(axes)
