"""Pictures of coefficients over load or frequency, measured and predicted (the paper's Fig. 15 to 20), and of h."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigdata.arrays import FloatArray
from tpjb_ident.columns import per, size, symbol
from tpjb_ident.report.drawing.picture import (
    DASH_DOTTED,
    DOTTED,
    INK,
    LIGHT,
    SHORT_DASHED,
    VARIANT_LABEL,
    Style,
    add_legend,
    from_zero,
    label,
    new_picture,
    new_pictures,
    style_of_variant,
)
from tpjb_ident.report.drawing.series import COEFFICIENTS, CURVE, DIRECT, as_table, axis_of, longest_series, with_errors
from tpjb_ident.schema import KINDS, STATIC_KEY, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.results.band_result import BandResult
    from tpjb_ident.results.frequency_model import FrequencyModel
    from tpjb_ident.results.identification import Identification

#: Intervals of a smaller share [%] are hidden by their marks: then differences get a panel of their own.
_SMALL = 5.0
#: A prediction nearer than this [%] is the measurement itself: it sets no scale.
_EXACT = 1e-3
_BARS: dict[str, Any] = {"fmt": "o", "color": INK, "markersize": 5, "capsize": 3, "linewidth": 1.2, "zorder": 5}


def coefficient(
    comparison: Comparison | pd.DataFrame,
    name: str,
    *,
    over: str = "load",
    title: str | None = None,
) -> Figure:
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
    title : str, optional

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
    column, axis_scale, axis_label = axis_of(over)
    measured = series.drop_duplicates(column).dropna(subset=[key]).sort_values(column)
    value, errors = with_errors(measured, key, scale)
    shares = 100.0 * errors / np.maximum(np.abs(value), np.finfo(float).tiny)
    apart = len(value) > 0 and float(np.median(shares)) < _SMALL
    figure, grid = new_pictures(2 if apart else 1, 1, title=title, height=(2.3, 1.5) if apart else 3.1)
    axes = grid[0][0]
    label(axes, axis_label, f"{name}, {kind.display_unit}")
    variants = {str(pivots): rows.sort_values(column) for pivots, rows in series.groupby("pivots", sort=False)}
    styles = {variant: style_of_variant(variant, list(variants)) for variant in variants}
    for variant, rows in variants.items():
        _draw_predicted(axes, rows[f"{key}_predicted"].to_numpy(float) / scale, rows, styles[variant], over)
    axes.errorbar(measured[column] / axis_scale, value, yerr=errors, label="measured, 95 %", **_BARS)
    axes.margins(x=0.06, y=0.1)
    if name in DIRECT:
        from_zero(axes)
    add_legend(axes)
    if apart:
        below = grid[1][0]
        label(below, axis_label, "off measured, %")
        reach = [_draw_deviations(below, rows, styles[variant], key, over) for variant, rows in variants.items()]
        below.errorbar(measured[column] / axis_scale, np.zeros_like(value), yerr=shares, **_BARS)
        below.margins(x=0.06)
        limit = 1.4 * max(float(np.max(shares)), min((r for r in reach if r > _EXACT), default=1.0))
        below.set_ylim(-limit, limit)
    return figure


def _draw_deviations(axes: Axes, rows: pd.DataFrame, style: Style, key: str, over: str) -> float:
    """Draw predicted / measured - 1 [%] of one prediction; how far it reaches."""
    off = 100.0 * (rows[f"{key}_predicted"] / rows[key] - 1.0).to_numpy(float)
    _draw_predicted(axes, off, rows, style, over)
    return float(np.max(np.abs(off), where=np.isfinite(off), initial=0.0))


def _draw_predicted(axes: Axes, y: FloatArray, rows: pd.DataFrame, style: Style, over: str) -> None:
    column, size, _ = axis_of(over)
    variant, (colour, dashes, marker) = str(rows["pivots"].iloc[0]), style
    x = rows[column].to_numpy(float) / size
    line = dashes if len(x) >= CURVE else "none"
    axes.plot(x, y, color=LIGHT[colour], linestyle=line, linewidth=1.6, marker=marker, markersize=4,
              label=VARIANT_LABEL.get(variant, variant))  # fmt: skip
    if variant == "measured" and "pivot_extrapolated" in rows:
        extrapolated = rows["pivot_extrapolated"].to_numpy(bool)
        if extrapolated.any():
            axes.plot(x[extrapolated], y[extrapolated], linestyle="none", marker=marker, markersize=8.5,
                      color=LIGHT[colour], markerfacecolor="none", label="beyond the dry tests")  # fmt: skip


_BEARING_COLOURS = ("blue", "red", "green", "purple")

#: Marker, line and fill of the entry: full lines for the loaded direction.
_ENTRY_STYLE: dict[str, tuple[str, Any, str | None]] = {
    "xx": ("s", SHORT_DASHED, "paper"),
    "yy": ("o", "-", None),
    "xy": ("<", DOTTED, "paper"),
    "yx": (">", DASH_DOTTED, "paper"),
}


def direct_coefficients(
    bearings: Mapping[str, Identification | pd.DataFrame],
    part: Literal["k", "c"] = "k",
    *,
    over: str = "load",
    entries: tuple[str, ...] = ("xx", "yy"),
    title: str | None = None,
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
    title : str, optional

    Raises
    ------
    ValueError
        When no bearing was measured at two loads or frequencies.
    """
    kind = KINDS[part]
    column, axis_scale, axis_label = axis_of(over)
    figure, axes = new_picture(axis_label, f"{kind.quantity}, {kind.display_unit}", title=title)
    drawn = False
    for (name, source), colour in zip(bearings.items(), _BEARING_COLOURS * len(bearings), strict=False):
        series = longest_series(as_table(source), over)
        if series is None:
            continue
        drawn = True
        rows = series.drop_duplicates(column).sort_values(column)
        for entry in entries:
            marker, dashes, face = _ENTRY_STYLE[entry]
            key = kind.column(entry)
            value, errors = with_errors(rows, key, kind.display_scale)
            axes.errorbar(
                rows[column] / axis_scale, value, yerr=errors, marker=marker,
                markersize=5, markerfacecolor=LIGHT[face or colour], color=LIGHT[colour],
                linestyle=dashes if len(rows) >= CURVE else "none",
                linewidth=1.3, capsize=3, label=f"{name}, {part}{entry}",
            )  # fmt: skip
    if not drawn:
        raise ValueError(f"no bearing was measured at two points over {over}: give a campaign with a series over it")
    axes.margins(x=0.06)
    if set(entries) <= {"xx", "yy"}:
        from_zero(axes)
    add_legend(axes)
    return figure


_FRF_STYLE = {"xx": ("blue", "o"), "yy": ("red", "s"), "xy": ("green", "^"), "yx": ("ink", "v")}


def frf(
    source: BandResult | Identification | pd.DataFrame,
    *,
    entries: tuple[str, ...] = ("xx", "yy"),
    title: str | None = None,
) -> Figure:
    """Draw the real and the imaginary part of h over frequency with 95 % intervals, over a band the coherence below.

    Parameters
    ----------
    source : BandResult, Identification or DataFrame
        One operating point of ``Identification.bands`` or its rows of ``frf.csv``; or points shaken by sines, or their
        ``coefficients.csv``: then the longest series over frequency. With a result the model that its frequencies
        support is drawn through them.
    entries : tuple of str
        Of ``"xx"``, ``"xy"``, ``"yx"``, ``"yy"``.
    title : str, optional

    Raises
    ------
    ValueError
        No line, an unknown entry, or the rows of several operating points.
    """
    unknown = [entry for entry in entries if entry not in _FRF_STYLE]
    if unknown or not entries:
        raise ValueError(f"entries must be some of {', '.join(_FRF_STYLE)}; got {entries}")
    table, model = _frf_rows(source)
    if table is None or not len(table):
        raise ValueError("there is no line to draw, or no two excitation frequencies at one load")
    over_band = "coherence_x" in table
    if over_band and table.filter([*STATIC_KEY, "excitation"]).nunique().max() > 1:
        raise ValueError("the table holds several operating points; give the rows of one")
    figure, ((real,), (imag,), *below) = new_pictures(3 if over_band else 2, 1, title=title, height=2.3)
    for axes, part, name in ((real, "real", "Re h"), (imag, "imag", "Im h")):
        label(axes, "frequency, Hz", f"{name}, {symbol('stiffness')}")
        for entry in entries:
            _draw_measured(axes, table, f"h{entry}_{part}_N_per_m", entry)
            _draw_model(axes, model, entry, part, label=entry == entries[0])
        axes.margins(x=0.05, y=0.1)
    add_legend(real)
    for (axes,) in below:
        _draw_coherence(axes, table)
    return figure


def _draw_coherence(axes: Axes, table: pd.DataFrame) -> None:
    label(axes, "frequency, Hz", "multiple coherence")
    for axis, colour, dashes in (("x", "blue", "-"), ("y", "red", SHORT_DASHED)):
        axes.plot(table["excitation_Hz"], table[f"coherence_{axis}"], color=LIGHT[colour], linestyle=dashes,
                  linewidth=1.2, label=f"force along {axis}")  # fmt: skip
    axes.set_ylim(min(0.9, 0.98 * float(table[["coherence_x", "coherence_y"]].min().min())), 1.01)
    axes.margins(x=0.05)
    add_legend(axes)


def _frf_rows(source: BandResult | Identification | pd.DataFrame) -> tuple[pd.DataFrame | None, FrequencyModel | None]:
    """Rows as in ``frf.csv`` (without coherence where sines were run), and the model through them."""
    import pandas as pd

    from tpjb_ident.results.identification import Identification

    if isinstance(source, Identification):
        series = longest_series(source.to_frame(), "frequency")
        return _rows_of_sines(series), _model_of_sines(source, series)
    if isinstance(source, pd.DataFrame):
        if "hxx_real_N_per_m" in source:
            return source.sort_values("excitation_Hz", kind="stable"), None
        return _rows_of_sines(longest_series(source, "frequency")), None
    from tpjb_ident.results.band_result import frf_frame

    model = source.models.get(source.supported)
    return frf_frame([source]), model


def _rows_of_sines(series: pd.DataFrame | None) -> pd.DataFrame | None:
    """K and C as h = K + i omega C, with the names that ``frf.csv`` has."""
    if series is None:
        return None
    rows = series.drop_duplicates("excitation_Hz").sort_values("excitation_Hz", kind="stable")
    omega = 2 * np.pi * rows["excitation_Hz"]
    columns = {}
    for entry, end in itertools.product(_FRF_STYLE, ("", "_lo", "_hi")):
        columns[f"h{entry}_real_N_per_m{end}"] = rows[f"k{entry}_N_per_m{end}"]
        columns[f"h{entry}_imag_N_per_m{end}"] = rows[f"c{entry}_Ns_per_m{end}"] * omega
    return rows[["excitation_Hz"]].assign(**columns)


def _model_of_sines(source: Identification, series: pd.DataFrame | None) -> FrequencyModel | None:
    """The model that the frequencies of the series support, None where they refuse all."""
    if series is None:
        return None
    wanted = tuple(series.iloc[0][list(STATIC_KEY)])
    for group in source.frequency_fits():
        fit = group.fits.get(group.supported)
        if fit is not None and group.points[0].point.static_key == wanted:
            return fit
    return None


def _draw_measured(axes: Axes, table: pd.DataFrame, column: str, entry: str) -> None:
    colour, marker = _FRF_STYLE[entry]
    value, errors = with_errors(table, column, size("stiffness"))
    axes.errorbar(
        table["excitation_Hz"], value, yerr=errors, fmt=marker, color=LIGHT[colour],
        markersize=3, capsize=1.5, linewidth=0.8, linestyle="none", label=f"h{entry}, 95 %",
    )  # fmt: skip


def _draw_model(axes: Axes, model: FrequencyModel | None, entry: str, part: str, label: bool) -> None:
    """The model over the band as a line."""
    if model is None:
        return
    f = np.linspace(*model.band, 200)
    i, j = ("xy".index(letter) for letter in entry)
    h = model.h(2 * np.pi * f)[:, i, j]
    values = (h.real if part == "real" else h.imag) * per("stiffness")
    axes.plot(f, values, color=LIGHT[_FRF_STYLE[entry][0]], linewidth=1.4, label=model.model if label else None)
