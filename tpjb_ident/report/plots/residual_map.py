"""Draw (measured - predicted) / sigma as a heat map: coefficients by rows, operating points by columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from tpjb_ident.columns import symbol
from tpjb_ident.report.drawing.colours import DIVERGING, INK, VARIANT_LABEL
from tpjb_ident.report.drawing.picture import FONT_SIZE, add_colour_bar, label, new_pictures
from tpjb_ident.report.drawing.residual_frame import residual_frame
from tpjb_ident.report.drawing.series import COEFFICIENTS, set_point_ticks
from tpjb_ident.schema import POINT_KEY

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.diagnosis.diagnose import Diagnosis

_ON_COLOUR = "#1b1f23"  # ink that stays dark on its coloured ground when the page turns dark

_CELL, _SHORTEST = 0.42, 4.4  # width of a cell and of the whole picture [inches]

_HEIGHT = 2.9

_LINEAR = 2.0  # within two standard deviations the colour hardly changes: that is noise


def residual_map(source: Diagnosis | Comparison | pd.DataFrame, *, title: str | None = None) -> Figure:
    """Draw (measured - predicted) / sigma as a heat map: coefficients by rows, operating points by columns.

    Operating points stand in order of load, then of excitation frequency. One panel per model: baseline and model with
    the effects found, of a diagnosis; one per pivot law, of a comparison. The colours are the same in all panels;
    they grow with the logarithm beyond 2 sigma.

    Parameters
    ----------
    source : Diagnosis, Comparison or DataFrame
        See `residual_frame`.
    title : str, optional
    """
    frame = residual_frame(source)
    models = list(dict.fromkeys(frame["model"]))
    if not models:
        raise ValueError("there are no residuals of coefficients to draw")
    place = [name for name in ("static_load_N", "excitation_Hz", *POINT_KEY[1:3], "rotation") if name in frame]
    points = frame[place].drop_duplicates().sort_values(place)
    width = max(_SHORTEST, _CELL * len(points) + 1.9)
    figure, grid = new_pictures(len(models), 1, title=title, width=width, height=_HEIGHT)
    limit = max(float(np.nanmax(np.abs(frame["z"].to_numpy(float)))), 3.0 * _LINEAR)
    norm = SymLogNorm(linthresh=_LINEAR, linscale=0.6, vmin=-limit, vmax=limit, base=10)
    for (axes,), model in zip(grid, models, strict=True):
        _draw_map(axes, frame[frame["model"] == model], points, norm, VARIANT_LABEL.get(model, str(model)))
    return figure


def _draw_map(axes: Axes, frame: pd.DataFrame, points: pd.DataFrame, norm: Any, name: str) -> None:
    cells = frame.pivot_table(index="entry", columns=list(points), values="z", dropna=False)
    table = cells.reindex(index=COEFFICIENTS, columns=pd.MultiIndex.from_frame(points)).to_numpy()
    size = float(np.sqrt(np.nanmean(table**2)))
    label(axes, f"static load, {symbol('load')}, and excitation, Hz", "", f"{name}: root mean square {size:.3g} sigma")
    image = axes.imshow(table, cmap=DIVERGING, norm=norm, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.set_yticks(range(len(COEFFICIENTS)), COEFFICIENTS)
    set_point_ticks(axes, points)
    axes.axhline(3.5, color=INK, linewidth=0.8)
    for (i, j), z in np.ndenumerate(table):
        if np.isfinite(z):
            strong = abs(norm(z) - 0.5) > 0.3
            axes.text(j, i, _short(z), ha="center", va="center", fontsize=FONT_SIZE - 1.0,
                      color="white" if strong else _ON_COLOUR)  # fmt: skip
    add_colour_bar(axes, image, "(measured - predicted) / sigma")
    bar = axes.figure.axes[-1]
    ticks = [t for t in (-1000, -100, -30, -10, -2, 0, 2, 10, 30, 100, 1000) if abs(t) <= norm.vmax]
    bar.set_yticks(ticks, [str(t) for t in ticks])
    bar.minorticks_off()


def _short(z: float) -> str:
    return f"{z:.0f}" if abs(z) >= 9.95 else f"{z:.1f}".replace("-0.0", "0.0")
