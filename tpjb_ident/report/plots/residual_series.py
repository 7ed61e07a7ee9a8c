"""Draw (measured - predicted) / sigma over load or frequency, one line per coefficient and model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT, PAPER, RULE, VARIANT_LABEL
from tpjb_ident.report.drawing.picture import add_legend, new_picture
from tpjb_ident.report.drawing.residual_frame import residual_frame
from tpjb_ident.report.drawing.series import CURVE, axis_of, longest_series

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.diagnosis.diagnose import Diagnosis

_STYLE = (("blue", "o"), ("red", "s"), ("green", "^"), ("purple", "D"))

_DASHES: tuple[Any, ...] = ((0, (4, 2)), "-", (0, (1, 1.5)), (0, (3, 1, 1, 1)))


def residual_series(
    source: Diagnosis | Comparison | pd.DataFrame,
    over: str = "load",
    *,
    entries: Sequence[str] | None = None,
    title: str | None = None,
) -> Figure:
    """Draw (measured - predicted) / sigma over load or frequency, one line per coefficient and model.

    The grey band holds two standard deviations: residuals inside say nothing.

    Parameters
    ----------
    source : Diagnosis, Comparison or DataFrame
        See `residual_frame`.
    over : {"load", "frequency"}
        The longest series over it is drawn.
    entries : sequence of str, optional
        Coefficients, four at most; default: the three that disagree most with the first model.
    title : str, optional

    Raises
    ------
    ValueError
        When nothing varies over `over`.
    """
    frame = residual_frame(source)
    column, scale, text = axis_of(over)
    series = longest_series(frame, over)
    if series is None:
        raise ValueError(f"there are no two points that differ in {over} alone")
    models = list(dict.fromkeys(frame["model"]))
    chosen = list(entries or _worst(frame[frame["model"] == models[0]]))
    figure, axes = new_picture(text, "(measured - predicted) / sigma", title=title, width=5.2, height=3.4)
    axes.axhspan(-2, 2, color=RULE, alpha=0.6, linewidth=0)
    for entry, (colour, marker) in zip(chosen, _STYLE, strict=False):
        for number, model in enumerate(models):
            rows = series[(series["entry"] == entry) & (series["model"] == model)].sort_values(column)
            last = number == len(models) - 1
            axes.plot(
                rows[column] / scale, rows["z"], color=LIGHT[colour],
                linestyle=_DASHES[number % len(_DASHES)] if len(rows) >= CURVE else "none",
                marker=marker, markersize=4.5, markerfacecolor=LIGHT[colour] if last else PAPER, linewidth=1.3,
                label=f"{entry}, {VARIANT_LABEL.get(model, str(model))}",
            )  # fmt: skip
    add_legend(axes)
    return figure


def _worst(frame: pd.DataFrame, count: int = 3) -> list[str]:
    size = (frame["z"] ** 2).groupby(frame["entry"]).sum()
    return [str(name) for name in size.sort_values(ascending=False).index[:count]]
