"""Draw the root mean square of (measured - predicted) / sigma per observable, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.diagnosis.observations.gap import gap_at
from tpjb_ident.report.drawing.colours import INK, LIGHT, PAPER
from tpjb_ident.report.drawing.picture import CHARACTER, LEFT, add_legend, new_picture, shrink

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.diagnose import Diagnosis
    from tpjb_ident.diagnosis.verdict.verdict import Verdict


def gap(
    source: Diagnosis | Verdict | Mapping[str, Mapping[str, float]],
    *,
    title: str | None = None,
) -> Figure:
    """Draw the root mean square of (measured - predicted) / sigma per observable, before and after.

    Observables that got worse have their name in brackets with a minus; those that no held-out point shows are
    marked with an asterisk.

    Parameters
    ----------
    source : Diagnosis, Verdict or mapping
        Or ``gap_by_observable`` of ``diagnosis.json``: ``{"kxx": {"heldout_before": 9.1, "heldout_after": 1.0}}``.
    title : str, optional
    """
    gaps = _gaps(source)
    if not gaps:
        raise ValueError("there is no gap by observable to draw")
    before, after = (np.array([gap_at(g, end) for g in gaps.values()]) for end in ("_before", "_after"))
    words = [_row_label(name, g, b, a) for (name, g), b, a in zip(gaps.items(), before, after, strict=True)]
    figure, axes = new_picture("gap, sigma", "", title=title, height=0.2 * len(words) + 1.3)
    shrink(axes, left=max(CHARACTER * max(len(w) for w in words) + 0.2 - LEFT, 0.0))
    y = np.arange(len(words))
    bars = [(before, "orange", "////", "baseline"), (after, "blue", None, "with the effects found")]
    bars = bars[:1] if np.array_equal(before, after) else bars  # nothing was added: there is no after
    for number, (values, colour, hatch, name) in enumerate(bars):
        places = y + 0.4 * number - 0.2 * (len(bars) - 1)
        axes.barh(places, values, 0.38, color=LIGHT[colour] if hatch is None else PAPER, hatch=hatch,
                  edgecolor=LIGHT[colour], linewidth=0.8, label=name)  # fmt: skip
    axes.set_yticks(y, words)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.axvline(1.0, color=INK, linewidth=0.9, linestyle=(0, (2, 2)), label="noise and tolerance")
    handles = axes.get_legend_handles_labels()[0]
    add_legend(axes, 2, [*handles[1:], handles[0]], across=True)
    return figure


def _gaps(source: Diagnosis | Verdict | Mapping[str, Mapping[str, float]]) -> Mapping[str, Mapping[str, float]]:
    if isinstance(source, Mapping):
        return source
    # a diagnosis holds a verdict, whose own `verdict` is a word
    return source.gap_by_observable if hasattr(source, "gap_by_observable") else source.verdict.gap_by_observable


def _row_label(name: str, gaps: Mapping[str, float], before: float, after: float) -> str:
    star = "" if any(k.startswith("heldout") for k in gaps) else "*"
    worse = " (worse)" if after > max(1.05 * before, 1.0) else ""
    return f"{name.replace('_', ' ')}{star}{worse}"
