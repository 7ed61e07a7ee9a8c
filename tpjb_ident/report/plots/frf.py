"""Dynamic stiffness over the band of a broadband excitation, with intervals, and the coherence below it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.broadband.band_result import BandModel, BandResult

ENTRIES = {"xx": ("blue", "o"), "yy": ("red", "s"), "xy": ("green", "^"), "yx": ("ink", "v")}


def frf(
    band: BandResult | pd.DataFrame, *, entries: tuple[str, ...] = ("xx", "yy"), title: str | None = None
) -> Figure:
    """Draw the real and the imaginary part of h over frequency with 95 % intervals, and the coherence below.

    Parameters
    ----------
    band : BandResult or DataFrame
        One operating point of ``Identification.bands``, or the rows of one in ``frf.csv``. With a `BandResult` the
        model that its lines support is drawn through them.
    entries : tuple of str
        Of ``"xx"``, ``"xy"``, ``"yx"``, ``"yy"``.
    title : str, optional

    Returns
    -------
    Figure

    Raises
    ------
    ValueError
        No line, an unknown entry, or the rows of several operating points.
    """
    unknown = [entry for entry in entries if entry not in ENTRIES]
    if unknown or not entries:
        raise ValueError(f"entries must be some of {', '.join(ENTRIES)}; got {entries}")
    table, model = _table(band)
    if not len(table):
        raise ValueError("there is no line to draw")
    if table[["static_load_N", "static_load_direction_deg", "shaft_speed_Hz", "excitation"]].nunique().max() > 1:
        raise ValueError("the table holds several operating points; give the rows of one")
    figure, ((real,), (imag,), (below,)) = new_pictures(3, 1, title=title, width=6.4, height=2.6)
    for axes, part, name in ((real, "real", "Re h, MN/m"), (imag, "imag", "Im h, MN/m")):
        label(axes, "frequency, Hz", name)
        for entry in entries:
            _part(axes, table, f"h{entry}_{part}_N_per_m", entry)
            _through(axes, table, model, entry, part)
        axes.margins(x=0.02, y=0.1)
    add_legend(real)
    label(below, "frequency, Hz", "multiple coherence")
    for axis, colour, dashes in (("x", "blue", "-"), ("y", "red", (0, (4, 2)))):
        below.plot(table["excitation_Hz"], table[f"coherence_{axis}"], color=LIGHT[colour], linestyle=dashes,
                   linewidth=1.2, label=f"force along {axis}")  # fmt: skip
    below.set_ylim(min(0.9, 0.98 * float(table[["coherence_x", "coherence_y"]].min().min())), 1.01)
    below.margins(x=0.02)
    add_legend(below)
    return figure


def _table(band: BandResult | pd.DataFrame) -> tuple[pd.DataFrame, BandModel | None]:
    import pandas as pd

    if isinstance(band, pd.DataFrame):
        return band.sort_values("excitation_Hz", kind="stable"), None
    from tpjb_ident.dynamic.broadband.band_result import frf_frame

    return frf_frame([band]), band.models.get(band.supported)


def _part(axes: Axes, table: pd.DataFrame, column: str, entry: str) -> None:
    colour, marker = ENTRIES[entry]
    value, low, high = (table[f"{column}{end}"].to_numpy(float) / 1e6 for end in ("", "_lo", "_hi"))
    axes.errorbar(
        table["excitation_Hz"], value, yerr=np.abs([value - low, high - value]), fmt=marker, color=LIGHT[colour],
        markersize=3, capsize=1.5, linewidth=0.8, linestyle="none", label=f"h{entry}, 95 %",
    )  # fmt: skip


def _through(axes: Axes, table: pd.DataFrame, model: BandModel | None, entry: str, part: str) -> None:
    """The model over the band as a line."""
    if model is None:
        return
    f = np.linspace(*model.band, 200)
    i, j = ("xy".index(letter) for letter in entry)
    h = model.h(2 * np.pi * f)[:, i, j]
    values = (h.real if part == "real" else h.imag) / 1e6
    axes.plot(f, values, color=LIGHT[ENTRIES[entry][0]], linewidth=1.4, label=model.model if entry == "xx" else None)
