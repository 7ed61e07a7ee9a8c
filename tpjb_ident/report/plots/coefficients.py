"""Pictures of coefficients over load or frequency, measured and predicted (the paper's Fig. 15 to 20), and of h."""

import itertools
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.columns import size, symbol
from tpjb_ident.compare.comparison import Comparison
from tpjb_ident.report.drawing.picture import (
    COEFFICIENTS,
    CURVE,
    DIRECT,
    ENTRY_STYLES,
    INK,
    MODEL_LABELS,
    PAPER,
    add_legend,
    as_table,
    axis_label,
    from_zero,
    label,
    longest_series,
    model_styles,
    new_picture,
    new_pictures,
    plot,
    style_of,
    with_errors,
)
from tpjb_ident.results.frequency_model import FrequencyModel
from tpjb_ident.results.identification import BandResult, Identification
from tpjb_ident.schema import ENTRIES, KINDS, STATIC_KEY, coefficient_column

#: Intervals of a smaller share [%] are hidden by their marks: then differences get a panel of their own.
_SMALL = 5.0
#: A prediction nearer than this [%] is the measurement itself: it sets no scale.
_EXACT = 1e-3
_BARS: dict[str, Any] = {"fmt": "o", "color": INK, "markerfacecolor": "none", "zorder": 5, "label": "measured, 95 %"}


@plot
def coefficient(comparison: Comparison | pd.DataFrame, name: str, over: str = "load") -> Figure:
    """Draw one coefficient over load or frequency (the paper's Fig. 17 to 20).

    Parameters
    ----------
    comparison : Comparison or DataFrame
        What `compare_campaign` gives, or its table (``comparison.csv``). A prediction that needed a pivot beyond its
        measured loads stands in a frame. Where intervals are smaller than their marks, a second panel shows the
        deviations, as far as the closest prediction reaches.
    name : str
        ``"kxx"``, ``"kxy"``, .. ``"cyy"``.
    over : {"load", "frequency"}
        The longest series over it is drawn.

    Raises
    ------
    ValueError
        For an unknown coefficient, or when nothing varies over `over`.
    """
    if name not in COEFFICIENTS:
        raise ValueError(f"name must be one of {', '.join(COEFFICIENTS)}; got {name!r}")
    series = longest_series(as_table(comparison), over)
    if series is None:
        raise ValueError(f"the campaign has no two points that differ in {over} alone")
    kind = KINDS[name[0]]
    scale, key = kind.display_scale, coefficient_column(name)
    predicted = series[f"{key}_predicted"]
    deviation = 100.0 * (predicted / series[key] - 1.0)
    series = series.assign(predicted=predicted / scale, off=deviation)
    series["beyond"] = series.get("pivot_extrapolated", False) & (series["pivots"] == "measured")
    measured = series.drop_duplicates("at").dropna(subset=[key])
    value, errors = with_errors(measured, key, scale)
    shares = 100.0 * errors / np.maximum(np.abs(value), np.finfo(float).tiny)
    is_split = len(value) > 0 and np.median(shares) < _SMALL
    figure, grid = new_pictures(2 if is_split else 1, 1, height=(2.3, 1.5) if is_split else 3.1)
    axes = grid[0, 0]
    label(axes, axis_label(over), f"{name}, {kind.display_unit}")
    _draw_predictions(axes, series, "predicted")
    axes.errorbar(measured["at"], value, yerr=errors, **_BARS)
    axes.margins(x=0.06, y=0.1)
    if name in DIRECT:
        from_zero(axes)
    add_legend(axes)
    if is_split:  # predicted / measured - 1, as far as the closest prediction reaches
        axes = grid[1, 0]
        label(axes, axis_label(over), "deviation, %")
        _draw_predictions(axes, series, "off")
        axes.errorbar(measured["at"], np.zeros(len(measured)), yerr=shares, **_BARS)
        axes.margins(x=0.06)
        reach = deviation.abs().groupby(series["pivots"], sort=False).max()
        limit = 1.4 * max(np.max(shares), reach[reach > _EXACT].min() if (reach > _EXACT).any() else 1.0)
        axes.set_ylim(-limit, limit)
        colours = model_styles(list(reach.index))
        for row in series[deviation.abs() > limit].to_dict("records"):  # on which side what is out of reach lies
            colour, is_above = colours[row["pivots"]]["color"], row["off"] > 0.0
            side, arrow = (0.85 * limit, r"$\uparrow$") if is_above else (-0.85 * limit, r"$\downarrow$")
            axes.plot(row["at"], side, marker=arrow, color=colour)  # a mark, not text, which colours leave too pale
    return figure


def _draw_predictions(axes: Axes, series: pd.DataFrame, column: str) -> None:
    """Draw one column of every prediction over the places of its points."""
    predictions = {str(name): rows for name, rows in series.groupby("pivots", sort=False)}
    styles = model_styles(list(predictions))
    for name, rows in predictions.items():
        style = styles[name] | ({} if len(rows) >= CURVE else {"linestyle": "none"})
        axes.plot(rows["at"], rows[column], **style, markersize=4, label=MODEL_LABELS.get(name, name))
        overloads = rows[rows["beyond"]]
        if len(overloads):
            frame = style | {"linestyle": "none", "markerfacecolor": "none", "markersize": 8.5}
            axes.plot(overloads["at"], overloads[column], **frame, label="beyond the dry tests")


@plot
def direct_coefficients(
    bearings: Mapping[str, Identification | pd.DataFrame],
    part: Literal["k", "c"] = "k",
    over: str = "load",
    *,
    entries: tuple[str, ...] = ("xx", "yy"),
) -> Figure:
    """Draw measured coefficients of one or several bearings with their 95 % intervals (the paper's Fig. 15, 16).

    Parameters
    ----------
    bearings : mapping of str to Identification or DataFrame
        By name; a table as ``coefficients.csv`` or ``comparison.csv``.
    part : {"k", "c"}
        Stiffness or damping.
    over : {"load", "frequency"}
        The longest series over it is drawn; the points that lie apart from it are not.
    entries : tuple of str
        Out of ``"xx"``, ``"xy"``, ``"yx"``, ``"yy"``.

    Raises
    ------
    ValueError
        When no bearing was measured at two loads or frequencies.
    """
    kind = KINDS[part]
    figure, axes = new_picture(axis_label(over), f"{kind.quantity}, {kind.display_unit}")
    for number, (name, source) in enumerate(bearings.items()):
        series = longest_series(as_table(source), over)
        if series is None:
            continue
        rows = series.drop_duplicates("at")
        for entry in entries:
            colour = style_of(number)["color"]
            style = ENTRY_STYLES[entry] | {"color": colour, "markerfacecolor": colour if entry == "yy" else PAPER}
            style |= {} if len(rows) >= CURVE else {"linestyle": "none"}
            value, errors = with_errors(rows, kind.column(entry), kind.display_scale)
            axes.errorbar(rows["at"], value, yerr=errors, **style, label=f"{name}, {part}{entry}")
    if not axes.lines:
        raise ValueError(f"no bearing was measured at two points over {over}: give a campaign with a series over it")
    axes.margins(x=0.06)
    if set(entries) <= {"xx", "yy"}:
        from_zero(axes)
    add_legend(axes)
    return figure


@plot
def frf(source: BandResult | Identification | pd.DataFrame, *, entries: tuple[str, ...] = ("xx", "yy")) -> Figure:
    """Draw the real and the imaginary part of h over frequency with 95 % intervals, over a band the coherence below.

    Parameters
    ----------
    source : BandResult, Identification or DataFrame
        One operating point of ``Identification.bands`` or its rows of ``frf.csv``; or points shaken by sines, or their
        ``coefficients.csv``: then the longest series over frequency. With a result the model that its frequencies
        support is drawn through them.
    entries : tuple of str
        Of ``"xx"``, ``"xy"``, ``"yx"``, ``"yy"``.

    Raises
    ------
    ValueError
        No line, an unknown entry, or the rows of several operating points.
    """
    if not entries or not set(entries) <= set(ENTRIES):
        raise ValueError(f"entries must be some of {', '.join(ENTRIES)}; got {entries}")
    table, model = _frf_rows(source)
    if table is None or not len(table):
        raise ValueError("there is no line to draw, or no two excitation frequencies at one load")
    over_band = "coherence_x" in table
    if over_band and table.filter([*STATIC_KEY, "excitation"]).nunique().max() > 1:
        raise ValueError("the table holds several operating points; give the rows of one")
    figure, grid = new_pictures(3 if over_band else 2, 1, height=2.3)
    for axes, part in zip(grid[:2, 0], ("real", "imag"), strict=True):
        label(axes, "frequency, Hz", f"{part.capitalize()[:2]} h, {symbol('stiffness')}")
        for entry in entries:
            value, errors = with_errors(table, f"h{entry}_{part}_N_per_m", size("stiffness"))
            style = ENTRY_STYLES[entry] | {"linestyle": "none", "markersize": 3, "capsize": 1.5, "linewidth": 0.8}
            axes.errorbar(table["excitation_Hz"], value, yerr=errors, **style, label=f"h{entry}, 95 %")
            if model is not None:
                f = np.linspace(*model.band, 200)
                h = model.h(2 * np.pi * f)[:, "xy".index(entry[0]), "xy".index(entry[1])]
                name = f"{model.model} model" if entry == entries[0] else None
                axes.plot(f, getattr(h, part) / size("stiffness"), color=style["color"], label=name)
        axes.margins(x=0.05, y=0.1)
    add_legend(grid[0, 0])
    if over_band:
        axes = grid[2, 0]
        label(axes, "frequency, Hz", "multiple coherence")
        for number, axis in enumerate("xy"):
            style = style_of(number) | {"marker": ""}
            axes.plot(table["excitation_Hz"], table[f"coherence_{axis}"], **style, label=f"force along {axis}")
        axes.set_ylim(min(0.9, 0.98 * table[["coherence_x", "coherence_y"]].min().min()), 1.01)
        axes.margins(x=0.05)
        add_legend(axes)
    return figure


def _frf_rows(source: Any) -> tuple[pd.DataFrame | None, FrequencyModel | None]:
    """Rows as in ``frf.csv`` (without coherence where sines were run), and the model through them."""
    if hasattr(source, "supported"):  # one band
        from tpjb_ident.results.identification import frf_frame

        return frf_frame([source]), source.models.get(source.supported)
    table = as_table(source)
    if "hxx_real_N_per_m" in table:
        return table.sort_values("excitation_Hz", kind="stable"), None
    series = longest_series(table, "frequency")
    if series is None:
        return None, None
    rows = series.drop_duplicates("excitation_Hz")
    omega = 2 * np.pi * rows["excitation_Hz"]
    columns = {}
    for entry, end in itertools.product(ENTRIES, ("", "_lo", "_hi")):  # h = K + i omega C
        columns[f"h{entry}_real_N_per_m{end}"] = rows[f"k{entry}_N_per_m{end}"]
        columns[f"h{entry}_imag_N_per_m{end}"] = rows[f"c{entry}_Ns_per_m{end}"] * omega
    key, model = tuple(series.iloc[0].reindex(list(STATIC_KEY))), None
    for group in getattr(source, "frequency_fits", list)():  # a table has none
        if group.points[0].point.static_key == key:
            model = model or group.fits.get(group.supported)
    return rows[["excitation_Hz"]].assign(**columns), model
