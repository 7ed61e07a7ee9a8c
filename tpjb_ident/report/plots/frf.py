"""Draw the real and the imaginary part of h over frequency with 95 % intervals, over a band the coherence below."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.columns import per, size, symbol
from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures
from tpjb_ident.report.drawing.series import longest_series, with_errors
from tpjb_ident.schema import STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.band_result import BandResult
    from tpjb_ident.dynamic.results.frequency_model import FrequencyModel
    from tpjb_ident.dynamic.results.identification import Identification

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
    for axis, colour, dashes in (("x", "blue", "-"), ("y", "red", (0, (4, 2)))):
        axes.plot(table["excitation_Hz"], table[f"coherence_{axis}"], color=LIGHT[colour], linestyle=dashes,
                  linewidth=1.2, label=f"force along {axis}")  # fmt: skip
    axes.set_ylim(min(0.9, 0.98 * float(table[["coherence_x", "coherence_y"]].min().min())), 1.01)
    axes.margins(x=0.05)
    add_legend(axes)


def _frf_rows(source: BandResult | Identification | pd.DataFrame) -> tuple[pd.DataFrame | None, FrequencyModel | None]:
    """Rows as in ``frf.csv`` (without coherence where sines were run), and the model through them."""
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification

    if isinstance(source, Identification):
        series = longest_series(source.to_frame(), "frequency")
        return _rows_of_sines(series), _model_of_sines(source, series)
    if isinstance(source, pd.DataFrame):
        if "hxx_real_N_per_m" in source:
            return source.sort_values("excitation_Hz", kind="stable"), None
        return _rows_of_sines(longest_series(source, "frequency")), None
    from tpjb_ident.dynamic.results.band_result import frf_frame

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
