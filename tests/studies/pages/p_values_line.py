"""P-values of campaigns that hide nothing, beside those that a perfect test would give."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, new_picture

#: Kolmogorov's 95 % quantile (Annals of Mathematical Statistics 12 (1941) 461).
KOLMOGOROV = 1.358
STYLE = (("blue", "-"), ("red", (0, (5, 2))), ("purple", (0, (3, 1, 1, 1))))


def p_values(values: Mapping[str, Sequence[float]], alarm: float | None = None, *, title: str | None = None) -> Figure:
    """Draw the distribution of no-effect p-values against the uniform one (P-P plot).

    Below the diagonal a test is shyer than stated, above it alarms too often.

    Parameters
    ----------
    values : mapping of str to sequence of float
        p-values by where they come from; up to three.
    alarm : float, optional
        Level at which the diagnosis sounds the alarm.
    title : str, optional

    Returns
    -------
    Figure
    """
    if not any(len(v) for v in values.values()):
        raise ValueError("there are no p-values to draw")
    figure, axes = new_picture("p-value", "share of campaigns at or below it", title=title, height=4.2)
    most = max(len(v) for v in values.values())
    width = KOLMOGOROV / math.sqrt(most)
    line = np.array([0.0, 1.0])
    axes.fill_between(line, np.clip(line - width, 0, 1), np.clip(line + width, 0, 1), color=LIGHT["rule"], alpha=0.6,
                      linewidth=0, label=f"where {most} uniform ones lie, 95 %")  # fmt: skip
    axes.plot(line, line, color=LIGHT["ink"], linewidth=0.9, linestyle=(0, (2, 2)), label="uniform")
    for (name, found), (colour, dashes) in zip(values.items(), STYLE, strict=False):
        p = np.sort(np.asarray(found, dtype=float))
        share = np.arange(1, len(p) + 1) / len(p)
        axes.step(np.r_[0.0, p, 1.0], np.r_[0.0, share, 1.0], where="post", color=LIGHT[colour], linestyle=dashes,
                  linewidth=1.5, label=f"{name} ({len(p)})")  # fmt: skip
    if alarm is not None:
        axes.axvline(alarm, color=LIGHT["orange"], linewidth=1.2, label=f"alarm below {alarm:g}")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    add_legend(axes)
    return figure
