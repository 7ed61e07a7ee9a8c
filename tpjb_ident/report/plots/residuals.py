"""Pictures of residuals: over load or frequency, as a map, by observable; and what a plan could tell apart."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import symbol
from tpjb_ident.compare.comparison import Comparison
from tpjb_ident.compare.effect_words import label_in_words
from tpjb_ident.diagnosis.diagnose import Diagnosis
from tpjb_ident.diagnosis.observations.gap import gap_at, residuals
from tpjb_ident.diagnosis.plan import CampaignPlan
from tpjb_ident.diagnosis.verdict.verdict import Verdict
from tpjb_ident.report.drawing.picture import (
    BLUE,
    CHARACTER,
    COEFFICIENTS,
    CURVE,
    DIVERGING,
    INK,
    LEFT,
    LIGHT,
    MODEL_LABELS,
    PAPER,
    RED,
    RULE,
    SEQUENTIAL,
    SMALL,
    Style,
    add_colour_bar,
    add_legend,
    as_table,
    axis_label,
    label,
    longest_series,
    new_picture,
    new_pictures,
    plot,
    set_point_ticks,
    shrink,
    style_of,
)
from tpjb_ident.rounding import plain
from tpjb_ident.schema import POINT_KEY, coefficient_column

_COLUMNS = ("model", "entry", *POINT_KEY, "z")
_TWO_SIDED_95 = 1.959964


def residual_frame(source: Diagnosis | Comparison | pd.DataFrame) -> pd.DataFrame:
    """Give (measured - predicted) / sigma of every coefficient: a row per model, coefficient and point.

    Parameters
    ----------
    source : Diagnosis, Comparison or DataFrame
        Or a table of comparison.csv.
    """
    if hasattr(source, "problem"):
        return _of_diagnosis(source)  # type: ignore[arg-type]
    table = as_table(source)
    return table if {"model", "entry", "z"} <= set(table.columns) else _of_comparison(table)


def _of_diagnosis(diagnosis: Diagnosis) -> pd.DataFrame:
    rows = []
    models = [("before", diagnosis.problem.base)]
    models += [("after", diagnosis.after)] if diagnosis.verdict.effects else []
    for model, prediction in models:
        z = residuals(diagnosis.observations, prediction)
        for element, value in zip(diagnosis.observations.elements, z, strict=True):
            if element.family == "h":
                direction = round(math.degrees(element.place("direction")), 6)
                speed, excitation = (round(element.place(name) / (2 * np.pi), 6) for name in ("speed", "excitation"))
                point = (element.place("load"), direction, abs(speed), excitation, ROTATIONS[speed < 0.0])
                rows.append((model, element.observable, *point, value))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _of_comparison(table: pd.DataFrame) -> pd.DataFrame:
    frames = []
    for entry in COEFFICIENTS:
        key = coefficient_column(entry)
        sigma = (table[f"{key}_hi"] - table[f"{key}_lo"]) / (2 * _TWO_SIDED_95)
        place = table[[name for name in POINT_KEY if name in table]]
        residual = (table[key] - table[f"{key}_predicted"]) / sigma
        frames.append(place.assign(model=table["pivots"], entry=entry, z=residual))
    return pd.concat(frames, ignore_index=True)


_ON_COLOUR = "#1b1f23"  # ink that stays dark on its coloured ground when the page turns dark
_CELL, _SHORTEST, _HEIGHT = 0.42, 4.4, 2.9  # width of a cell, least width of the picture, height of a panel [inches]
_LINEAR = 2.0  # within two standard deviations the colour hardly changes: that is noise


@plot
def residual_map(source: Diagnosis | Comparison | pd.DataFrame) -> Figure:
    """Draw (measured - predicted) / sigma as a heat map: coefficients by rows, operating points by columns.

    Operating points stand in order of load, then of excitation frequency. One panel per model: baseline and model with
    the effects found, of a diagnosis; one per pivot law, of a comparison. The colours are the same in all panels;
    they grow with the logarithm beyond 2 sigma.

    Parameters
    ----------
    source : Diagnosis, Comparison or DataFrame
        See `residual_frame`.
    """
    frame = residual_frame(source)
    models = list(dict.fromkeys(frame["model"]))
    if not models:
        raise ValueError("there are no residuals of coefficients to draw")
    place = [name for name in ("static_load_N", "excitation_Hz", *POINT_KEY[1:3], "rotation") if name in frame]
    points = frame[place].drop_duplicates().sort_values(place)
    width = max(_SHORTEST, _CELL * len(points) + 1.9)
    figure, grid = new_pictures(len(models), 1, width=width, height=_HEIGHT)
    limit = max(frame["z"].abs().max(), 3.0 * _LINEAR)
    norm = SymLogNorm(linthresh=_LINEAR, linscale=0.6, vmin=-limit, vmax=limit, base=10)
    ticks = [t for t in (-1000, -100, -30, -10, -2, 0, 2, 10, 30, 100, 1000) if abs(t) <= limit]
    for (axes,), model in zip(grid, models, strict=True):
        rows = frame[frame["model"] == model]
        cells = rows.pivot_table(index="entry", columns=list(points), values="z", dropna=False)
        table = cells.reindex(index=COEFFICIENTS, columns=pd.MultiIndex.from_frame(points)).to_numpy()
        size = np.sqrt(np.nanmean(table**2))
        heading = f"{MODEL_LABELS.get(model, model)}: root mean square {size:.3g} sigma"
        label(axes, f"static load, {symbol('load')}, and excitation, Hz", "", heading)
        image = axes.imshow(table, cmap=DIVERGING, norm=norm)
        axes.grid(False)
        axes.set_yticks(range(len(COEFFICIENTS)), COEFFICIENTS)
        set_point_ticks(axes, points)
        axes.axhline(3.5, color=INK, linewidth=0.8)
        for (i, j), z in np.ndenumerate(table):
            if np.isfinite(z):
                colour, text = "white" if abs(norm(z) - 0.5) > 0.3 else _ON_COLOUR, plain(z, 0 if abs(z) >= 9.95 else 1)
                axes.text(j, i, text, ha="center", va="center", fontsize=SMALL, color=colour)
        bar = add_colour_bar(axes, image, "(measured - predicted) / sigma")
        bar.set_yticks(ticks, [plain(t, 0) for t in ticks])
        bar.minorticks_off()
    return figure


#: Coefficients that are drawn: those that disagree most.
_WORST = 3


@plot
def residual_series(
    source: Diagnosis | Comparison | pd.DataFrame, over: str = "load", *, entries: Sequence[str] | None = None
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

    Raises
    ------
    ValueError
        When nothing varies over `over`.
    """
    frame = residual_frame(source)
    series = longest_series(frame, over)
    if series is None:
        raise ValueError(f"there are no two points that differ in {over} alone")
    models = list(dict.fromkeys(frame["model"]))
    squares = (frame["z"] ** 2).groupby(frame["entry"].where(frame["model"] == models[0])).sum()
    chosen = list(entries or squares.sort_values(ascending=False).index[:_WORST])
    figure, axes = new_picture(axis_label(over), "(measured - predicted) / sigma", width=5.2, height=3.4)
    axes.axhspan(-2, 2, color=RULE, alpha=0.6, linewidth=0)
    for number, entry in enumerate(chosen):
        style = dict(style_of(number))
        for k, model in enumerate(models):
            rows = series[(series["entry"] == entry) & (series["model"] == model)]
            style["linestyle"] = style_of(len(models) - 1 - k)["linestyle"] if len(rows) >= CURVE else "none"
            face = style["color"] if model == models[-1] else PAPER
            name = f"{entry}, {MODEL_LABELS.get(model, model)}"
            axes.plot(rows["at"], rows["z"], **style, markerfacecolor=face, markersize=4.5, label=name)
    add_legend(axes)
    return figure


@plot
def gap(source: Diagnosis | Verdict | Mapping[str, Mapping[str, float]]) -> Figure:
    """Draw the root mean square of (measured - predicted) / sigma per observable, before and after.

    Observables that got worse say so; those that no held-out point shows are marked with an asterisk.

    Parameters
    ----------
    source : Diagnosis, Verdict or mapping
        Or ``gap_by_observable`` of ``diagnosis.json``: ``{"kxx": {"heldout_before": 9.1, "heldout_after": 1.0}}``.
    """
    if isinstance(source, Diagnosis):
        source = source.verdict
    gaps = source if isinstance(source, Mapping) else source.gap_by_observable
    if not gaps:
        raise ValueError("there is no gap by observable to draw")
    before = np.array([gap_at(g, "_before") for g in gaps.values()])
    after = np.array([gap_at(g, "_after") for g in gaps.values()])
    words = []
    for (name, values), old, new in zip(gaps.items(), before, after, strict=True):
        star = "" if any(key.startswith("heldout") for key in values) else "*"
        worse = " (worse)" if new > max(1.05 * old, 1.0) else ""
        words.append(f"{name.replace('_', ' ')}{star}{worse}")
    figure, axes = new_picture("gap, sigma", "", height=0.2 * len(words) + 1.3)
    shrink(axes, left=max(CHARACTER * max(map(len, words)) + 0.2 - LEFT, 0.0))
    y = np.arange(len(words))
    added = not np.array_equal(before, after)  # else there is no after
    baseline: Style = {"color": PAPER, "edgecolor": LIGHT["orange"], "hatch": "////", "label": "as stated"}
    axes.barh(y - 0.2 * added, before, 0.38, linewidth=0.8, **baseline)
    if added:
        axes.barh(y + 0.2, after, 0.38, color=BLUE, label="with the effects found")
    axes.set_yticks(y, words)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.axvline(1.0, color=INK, linewidth=0.9, linestyle=":", label="noise and tolerance")
    add_legend(axes, across=True)
    return figure


_SQUARE, _TALL = 0.3, 2.0  # side of a cell, and height that the colour bar needs [inches]
_CONFUSABLE, _VISIBLE = 3.0, 6.0  # standard deviations


@plot
def isolability(plan: CampaignPlan | ArrayLike, names: Sequence[str] | None = None) -> Figure:
    """Draw how far each effect stands from what every other one can imitate, in standard deviations.

    Row A, column B: distance of A, at a size that is seen with 6 standard deviations, from all that B can do. Pairs
    below 3 are framed: the campaign could not tell them apart. Blank rows are effects that it does not see at all.

    Parameters
    ----------
    plan : CampaignPlan or (k, k) array_like
        As `tpjb_ident.diagnosis.plan.plan` makes it, or its matrix.
    names : sequence of str, optional
        Of the k effects; default: the plan's own.
    """
    matrix = np.asarray(getattr(plan, "separation", plan), dtype=float)
    names = names or [c.label for c in getattr(plan, "candidates", ())]
    k = len(matrix)
    if matrix.shape != (k, k) or len(names) != k:
        raise ValueError(f"the matrix must be square with one name per row, got shape {matrix.shape}")
    words = [label_in_words(name) for name in names]
    room = CHARACTER * max(map(len, words))
    # the panel's own margins and the colour bar come on top of cells and names
    width, height = _SQUARE * k + room + 2.0, max(_SQUARE * k, _TALL) + room + 1.0
    across, down = "could pass for (framed: closer than 3)", "effect at work"
    figure, axes = new_picture(across, down, width=width, height=height)
    shrink(axes, left=room - 0.1, bottom=room - 0.1)
    image = axes.imshow(matrix, cmap=SEQUENTIAL, vmin=0.0, vmax=_VISIBLE)
    axes.grid(False)
    axes.set_xticks(range(k), words, rotation=90, fontsize=SMALL)
    axes.set_yticks(range(k), words, fontsize=SMALL)
    for i, j in np.argwhere(matrix < _CONFUSABLE):
        axes.add_patch(Rectangle((j - 0.45, i - 0.45), 0.9, 0.9, fill=False, edgecolor=RED, linewidth=1.2))
    add_colour_bar(axes, image, "distance, standard deviations")
    return figure
