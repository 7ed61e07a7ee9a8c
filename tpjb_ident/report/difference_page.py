"""The page of two campaigns held against each other: what changed, by how much, and how sure that is."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tpjb_ident.columns import place_of, size, spinning, symbol
from tpjb_ident.compare.difference import Difference, changed_column, difference_sentences
from tpjb_ident.conditions import KINDS, Condition
from tpjb_ident.report.drawing.picture import (
    ENTRY_STYLES,
    INK,
    PAPER,
    add_legend,
    label,
    new_pictures,
    plot,
    point_labels,
    set_point_ticks,
    with_errors,
)
from tpjb_ident.report.figure import Panel
from tpjb_ident.report.page import Page, Section, Table, table_of, write_page
from tpjb_ident.report.sections import coefficient_cells, flags_line, interval_cells, set_points
from tpjb_ident.schema import DAMPING, POINT_KEY, STIFFNESS, TANGENT, Coefficient

_TITLE = (
    "Differences, 95 % intervals; full marks changed beyond what both allow (logarithmic beyond the widest interval)"
)
_POINTS = "operating point: load in {}, excitation in Hz"
#: How many times the widest interval a difference is at least where the scale is logarithmic outside.
_BEYOND = 5.0
_SIDES = {"a": "first", "b": "second", "difference": "difference"}


def write_difference_report(folder: Path, difference: Difference, origin: Mapping[str, Any]) -> Path:
    """Write report.html and its figure into an existing folder."""
    points = difference.points
    flags = [Condition(name) for name in "; ".join(_flags(points)).split("; ") if name in KINDS]
    facts = {}
    for name, side in (("First", difference.a), ("Second", difference.b)):
        parts, campaign = [side.name, "a folder of results"], side.campaign
        if campaign is not None:
            parts[1:] = campaign.description, f"{len(campaign.runs)} runs", campaign.date, campaign.by
        facts[name] = ", ".join(filter(None, parts))
    page = Page(
        title=f"{difference.a.name} and {difference.b.name}: what changed",
        subtitle="Second less first, with 95 % intervals",
        facts=facts | set_points(list(points.reindex(columns=POINT_KEY).itertuples(index=False, name=None))),
        values=_values_table(difference) if len(points) else None,
        flags=flags_line([flags], len(points)),
        lead="difference",
        sentences=difference_sentences(difference),
        sections=_sections(difference),
        **origin,
    )
    return write_page(folder, page)


def _values_table(difference: Difference) -> Table:
    """K and C of both sides at the point in the middle, and what changed."""
    middle = difference.points.iloc[[len(difference.points) // 2]]
    point = middle.iloc[0]
    cells: dict[str, list[str]] = {}
    for side, title in _SIDES.items():
        of_side = coefficient_cells(middle, (STIFFNESS, DAMPING), f"_{side}")
        cells |= {"": list(of_side), title: [text for (text,) in of_side.values()]}
    cells["changed"] = [point[f"{heading[:3]}_changed"] for heading in cells[""]]
    place = place_of(point["static_load_N"], point["excitation_Hz"])
    shaft = spinning(point["shaft_speed_Hz"], point["rotation"])
    return table_of(f"At {place}, shaft at {shaft}; 95 % intervals", cells)


def _flags(points: pd.DataFrame) -> pd.Series:
    """Names of the flags of both sides at every common point, in one text."""
    return points.reindex(columns=["quality_a", "quality_b"], fill_value="ok").astype(str).agg("; ".join, axis=1)


def _sections(difference: Difference) -> list[Section]:
    points, pivots, clearance = difference.points, difference.pivots, difference.clearance
    sections = []
    if len(points):
        tables = [_coefficient_table(points, kind) for kind in (STIFFNESS, DAMPING)]
        sections.append(Section("Coefficients", panels=[Panel("difference", _TITLE, _drawn, points)], tables=tables))
    for heading, caption, frame, name, quantity in (
        ("Pivots", "Tangent stiffness of the pivots, where both were measured; 95 %", pivots, TANGENT, "stiffness"),
        ("Clearance", "Assembled clearance at zero push load, 95 %", clearance, "clearance_m", "length"),
    ):
        if frame.empty:
            continue
        cells: dict[str, Iterable[str]] = {"pad": frame["pad"].map("#{:g}".format)}
        if "force_N" in frame:
            cells[f"load, {symbol('load')}"] = (frame["force_N"] / size("load")).map("{:.3g}".format)
        for side, title in _SIDES.items():
            cells[f"{title}, {symbol(quantity)}"] = interval_cells(frame, f"{name}_{side}", size(quantity))
        cells["changed"] = frame[changed_column(name)]
        sections.append(Section(heading, tables=[table_of(caption, cells)]))
    return sections


def _coefficient_table(points: pd.DataFrame, kind: Coefficient) -> Table:
    """Differences of K or of C at every point, and which of them changed."""
    cells = {"point": point_labels(points), **coefficient_cells(points, [kind], "_difference")}
    for heading in list(cells)[1:]:
        star = points[f"{heading[:3]}_changed"].map({"yes": " *"}).fillna("")
        cells[heading] = list(cells[heading] + star)
    cells["flags of both"] = []
    for text in _flags(points):
        flags = dict.fromkeys(flag for flag in text.split("; ") if flag != "ok")
        cells["flags of both"].append(", ".join(flags) or "ok")
    return table_of(f"Difference of {kind.quantity}, 95 %; * changed beyond what both intervals allow", cells)


@plot
def _drawn(points: pd.DataFrame) -> Figure:
    """Draw differences of K and C with their intervals, point by point; logarithmic beyond the widest interval."""
    figure, grid = new_pictures(2, 1, height=2.7)
    place = np.arange(len(points), dtype=float)
    for axes, kind in zip(grid[:, 0], (STIFFNESS, DAMPING), strict=True):
        label(axes, _POINTS.format(symbol("load")), f"difference of {kind.symbol.upper()}, {kind.display_unit}")
        axes.axhline(0.0, color=INK, linewidth=1.0)
        half = 0.0
        for k, (entry, look) in enumerate(ENTRY_STYLES.items()):
            style = look | {"linestyle": "none"}
            value, errors = with_errors(points, f"{kind.column(entry)}_difference", kind.display_scale)
            half = max(half, np.max(errors, where=np.isfinite(errors), initial=0.0))
            x = place + 0.16 * (k - 1.5)
            axes.errorbar(x, value, yerr=errors, **style, markerfacecolor=PAPER, capsize=2.5, label=entry)
            changed = (points[f"{kind.symbol}{entry}_changed"] == "yes").to_numpy()
            axes.plot(x[changed], value[changed], **style, zorder=3)
        if np.max(np.abs(axes.dataLim.intervaly)) > _BEYOND * half > 0.0:
            axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(half)), linscale=0.7)
            axes.yaxis.set_major_formatter("{x:g}")
        set_point_ticks(axes, points)
    add_legend(grid[0, 0], across=True)
    return figure
