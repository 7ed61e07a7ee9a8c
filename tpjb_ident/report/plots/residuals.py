"""Pictures of where model and measurement disagree, by coefficient, load and frequency; and the table behind them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import DIVERGING, INK, LIGHT, PAPER, RULE, VARIANT_LABEL
from tpjb_ident.report.drawing.picture import (
    FONT_SIZE,
    add_colour_bar,
    add_legend,
    label,
    new_picture,
    new_pictures,
    shrink,
)
from tpjb_ident.report.drawing.series import AXES
from tpjb_ident.schema import COEFFICIENT_COLUMNS, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.diagnosis.diagnose import Diagnosis


_ENTRIES = tuple(column[:3] for column in COEFFICIENT_COLUMNS)
_COLUMNS = ("model", "entry", "static_load_N", "excitation_Hz", "z")
_TWO_SIDED_95 = 1.959964
_ON_COLOUR = "#1b1f23"  # ink that stays dark on its coloured ground when the page turns dark
_CELL, _SHORTEST = 0.42, 4.4  # width of a cell and of the whole picture [inches]
_HEIGHT = 2.9
_LINEAR = 2.0  # within two standard deviations the colour hardly changes: that is noise


def residual_frame(source: Diagnosis | Comparison | pd.DataFrame) -> pd.DataFrame:
    """(measured - predicted) / sigma of every coefficient, what the pictures of residuals draw.

    Parameters
    ----------
    source : Diagnosis, Comparison or DataFrame
        Or ``comparison.csv``.

    Returns
    -------
    DataFrame
        ``model``, ``entry``, ``static_load_N``, ``excitation_Hz``, ``z``: one row per model, coefficient and point.
    """
    import pandas as pd

    if isinstance(source, pd.DataFrame):
        return source if set(_COLUMNS) <= set(source.columns) else _of_comparison(source)
    from tpjb_ident.compare.comparison import Comparison

    if isinstance(source, Comparison):
        from tpjb_ident.compare.comparison import comparison_frame

        return _of_comparison(comparison_frame(source))
    return _of_diagnosis(source)


def _of_diagnosis(diagnosis: Diagnosis) -> pd.DataFrame:
    import pandas as pd

    from tpjb_ident.diagnosis.observations.gap import residuals

    rows = []
    for model, prediction in (("before", diagnosis.problem.base), ("after", diagnosis.after)):
        z = residuals(diagnosis.observations, prediction)
        for element, value in zip(diagnosis.observations.elements, z, strict=True):
            if element.family == "h":
                frequency = element.place("excitation") / (2 * np.pi)
                rows.append((model, element.observable, element.place("load"), round(frequency, 6), float(value)))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _of_comparison(table: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    frames = []
    for entry in _ENTRIES:
        key = coefficient_column(entry)
        sigma = (table[f"{key}_hi"] - table[f"{key}_lo"]) / (2 * _TWO_SIDED_95)
        frames.append(
            pd.DataFrame(
                {
                    "model": table["pivots"],
                    "entry": entry,
                    "static_load_N": table["static_load_N"],
                    "excitation_Hz": table["excitation_Hz"],
                    "z": (table[key] - table[f"{key}_predicted"]) / sigma,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


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
    points = sorted(set(zip(frame["static_load_N"], frame["excitation_Hz"], strict=True)))
    width = max(_SHORTEST, _CELL * len(points) + 1.9)
    figure, grid = new_pictures(len(models), 1, title=title, width=width, height=_HEIGHT)
    limit = max(float(np.nanmax(np.abs(frame["z"].to_numpy(float)))), 3.0 * _LINEAR)
    norm = SymLogNorm(linthresh=_LINEAR, linscale=0.6, vmin=-limit, vmax=limit, base=10)
    for (axes,), model in zip(grid, models, strict=True):
        _draw_map(axes, frame[frame["model"] == model], points, norm, VARIANT_LABEL.get(model, str(model)))
    return figure


def _draw_map(axes: Axes, frame: pd.DataFrame, points: list[tuple[float, float]], norm: Any, name: str) -> None:
    table = np.full((len(_ENTRIES), len(points)), np.nan)
    column = {point: j for j, point in enumerate(points)}
    for entry, load, frequency, z in frame[["entry", "static_load_N", "excitation_Hz", "z"]].to_numpy():
        table[_ENTRIES.index(entry), column[load, frequency]] = z
    size = float(np.sqrt(np.nanmean(table**2)))
    label(axes, "static load, kN, and excitation, Hz", "", f"{name}: root mean square {size:.3g} sigma")
    shrink(axes, bottom=0.25)
    image = axes.imshow(table, cmap=DIVERGING, norm=norm, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.set_yticks(range(len(_ENTRIES)), _ENTRIES)
    axes.set_xticks(range(len(points)), [f"{w / 1e3:g}\n{f:g}" for w, f in points], fontsize=FONT_SIZE - 1.5)
    axes.axhline(3.5, color=INK, linewidth=0.8)
    for (i, j), z in np.ndenumerate(table):
        if np.isfinite(z):
            strong = abs(norm(z) - 0.5) > 0.3
            axes.text(j, i, _short(z), ha="center", va="center", fontsize=FONT_SIZE - 2.5,
                      color="white" if strong else _ON_COLOUR)  # fmt: skip
    add_colour_bar(axes, image, "(measured - predicted) / sigma")
    bar = axes.figure.axes[-1]
    ticks = [t for t in (-1000, -100, -30, -10, -2, 0, 2, 10, 30, 100, 1000) if abs(t) <= norm.vmax]
    bar.set_yticks(ticks, [str(t) for t in ticks])
    bar.minorticks_off()


def _short(z: float) -> str:
    return f"{z:.0f}" if abs(z) >= 9.95 else f"{z:.1f}".replace("-0.0", "0.0")


_STYLE = (("blue", "o"), ("red", "s"), ("green", "^"), ("purple", "D"))
_DASHES: tuple[Any, ...] = ((0, (4, 2)), "-", (0, (1, 1.5)), (0, (3, 1, 1, 1)))


def residual_series(
    source: Diagnosis | Comparison | pd.DataFrame,
    over: Literal["load", "frequency"] = "load",
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
    column, scale, text = AXES[over]
    fixed_column = AXES["frequency" if over == "load" else "load"][0]
    counts = frame.groupby(fixed_column)[column].nunique()
    if frame.empty or counts.max() < 2:
        raise ValueError(f"there are no two points that differ in {over} alone")
    series = frame[frame[fixed_column] == counts.idxmax()]
    models = list(dict.fromkeys(frame["model"]))
    chosen = list(entries or _worst(frame[frame["model"] == models[0]]))
    figure, axes = new_picture(text, "(measured - predicted) / sigma", title=title)
    axes.axhspan(-2, 2, color=RULE, alpha=0.6, linewidth=0)
    for entry, (colour, marker) in zip(chosen, _STYLE, strict=False):
        for number, model in enumerate(models):
            rows = series[(series["entry"] == entry) & (series["model"] == model)].sort_values(column)
            last = number == len(models) - 1
            axes.plot(
                rows[column] / scale, rows["z"], color=LIGHT[colour], linestyle=_DASHES[number % len(_DASHES)],
                marker=marker, markersize=4.5, markerfacecolor=LIGHT[colour] if last else PAPER, linewidth=1.3,
                label=f"{entry}, {VARIANT_LABEL.get(model, str(model))}",
            )  # fmt: skip
    add_legend(axes)
    return figure


def _worst(frame: pd.DataFrame, count: int = 3) -> list[str]:
    size = (frame["z"] ** 2).groupby(frame["entry"]).sum()
    return [str(name) for name in size.sort_values(ascending=False).index[:count]]
