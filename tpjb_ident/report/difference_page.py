"""The page of two campaigns held against each other: what changed, by how much, and how sure that is."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tpjb_ident.columns import per, place_of, size, spinning, symbol
from tpjb_ident.compare.difference import Difference, difference_sentences, shown
from tpjb_ident.condition_kinds import KINDS
from tpjb_ident.conditions import Condition
from tpjb_ident.report.drawing.picture import INK, LIGHT, add_legend, label, new_pictures
from tpjb_ident.report.drawing.series import point_labels, set_point_ticks, with_errors
from tpjb_ident.report.figure import panel
from tpjb_ident.report.laboratory_sections import flags_line, set_points
from tpjb_ident.report.page import Page, Section, Table, write_page
from tpjb_ident.rounding import significant
from tpjb_ident.schema import DAMPING, ENTRIES, POINT_KEY, STIFFNESS, TANGENT, Coefficient

_TITLE = (
    "Differences, 95 % intervals; full marks changed beyond what both allow (logarithmic beyond the widest interval)"
)
_POINTS = "operating point: load in {}, excitation in Hz"
#: How many times the widest interval a difference is at least where the scale is logarithmic outside.
_BEYOND = 5.0
_SIDES = ("a", "b", "difference")
_MARKS = (("xx", "blue", "s"), ("yy", "red", "o"), ("xy", "grey", "<"), ("yx", "purple", ">"))


def write_difference_report(
    folder: Path, difference: Difference, settings: Mapping[str, Any], inputs: Mapping[str, str], then: str
) -> Path:
    """Write report.html and its figure into an existing folder."""
    answer, *more = difference_sentences(difference)
    a, b, points = difference.a, difference.b, difference.points
    page = Page(
        title=f"{a.name} and {b.name}: what changed",
        subtitle="Second less first, with 95 % intervals",
        facts=_facts(difference) | set_points(list(points[list(POINT_KEY)].itertuples(index=False, name=None))),
        values=_values_table(difference) if len(points) else None,
        flags=flags_line([_flags(points)], len(points)),
        lead="difference",
        answer=answer,
        more=more,
        then=then,
        sections=_sections(difference),
        settings=settings,
        inputs=inputs,
    )
    return write_page(folder, page)


def _facts(difference: Difference) -> dict[str, str]:
    """What each side is, and when and by whom it was measured."""
    facts = {}
    for name, side in (("First", difference.a), ("Second", difference.b)):
        campaign = side.campaign
        if campaign is None:
            facts[name] = f"{side.name}, a folder of results"
            continue
        parts = (side.name, campaign.description, f"{len(campaign.runs)} runs", campaign.date, campaign.by)
        facts[name] = ", ".join(part for part in parts if part)
    return facts


def _values_table(difference: Difference) -> Table:
    """K and C of both sides at the point in the middle, and what changed."""
    row = difference.points.iloc[len(difference.points) // 2].to_dict()
    rows = []
    for kind, entry in itertools.product((STIFFNESS, DAMPING), ENTRIES):
        name, scale = kind.column(entry), kind.display_scale
        cells = [shown(row, name, scale, side) for side in _SIDES]
        rows.append([f"{kind.symbol}{entry}, {kind.display_unit}", *cells, row[f"{kind.symbol}{entry}_changed"]])
    place = f"{place_of(row['static_load_N'], row['excitation_Hz'])}, shaft at "
    place += spinning(row["shaft_speed_Hz"], row["rotation"])
    columns = ["", "first", "second", "difference", "changed"]
    return Table(f"At {place}; 95 % intervals", columns, rows)


def _flags(points: pd.DataFrame) -> list[Condition]:
    """Flags of both sides at the common points."""
    texts = points.reindex(columns=["quality_a", "quality_b"]).to_numpy(str).ravel()
    return [Condition(name) for name in "; ".join(texts).split("; ") if name in KINDS]


def _sections(difference: Difference) -> list[Section]:
    sections = []
    points = difference.points
    if len(points):
        tables = [_coefficient_table(points, kind) for kind in (STIFFNESS, DAMPING)]
        panels = [panel("difference", _TITLE, _drawn, "", points)]
        sections.append(Section("Coefficients", panels=panels, tables=tables))
    if not difference.pivots.empty:
        rows = [
            _row(row, TANGENT, "stiffness", significant(row["force_N"] * per("load"), ".3g"))
            for row in difference.pivots.to_dict("records")
        ]
        columns = ["pad", f"load, {symbol('load')}", *_columns("stiffness")]
        table = Table("Tangent stiffness of the pivots, where both were measured; 95 %", columns, rows)
        sections.append(Section("Pivots", tables=[table]))
    if not difference.clearance.empty:
        rows = [_row(row, "clearance_m", "length") for row in difference.clearance.to_dict("records")]
        columns = ["pad", *_columns("length")]
        table = Table("Assembled clearance at zero push load, 95 %", columns, rows)
        sections.append(Section("Clearance", tables=[table]))
    return sections


def _columns(quantity: str) -> list[str]:
    return [f"{side}, {symbol(quantity)}" for side in ("first", "second", "difference")] + ["changed"]


def _row(row: Mapping[Any, Any], name: str, quantity: str, *place: str) -> list[str]:
    cells = [shown(row, name, size(quantity), side) for side in _SIDES]
    return [f"#{row['pad']:g}", *place, *cells, row[f"{name.partition('_')[0]}_changed"]]


def _coefficient_table(points: pd.DataFrame, kind: Coefficient) -> Table:
    """Differences of K or of C at every point, and which of them changed."""
    rows = []
    for place, row in zip(point_labels(points), points.to_dict("records"), strict=True):
        cells = []
        for entry in ENTRIES:
            cells.append(shown(row, kind.column(entry), kind.display_scale))
            if row[f"{kind.symbol}{entry}_changed"] == "yes":
                cells[-1] += " *"
        flags = dict.fromkeys(
            f for side in "ab" for f in str(row.get(f"quality_{side}", "ok")).split("; ") if f != "ok"
        )
        rows.append([place, *cells, ", ".join(flags) or "ok"])
    named = [f"{kind.symbol}{entry}, {kind.display_unit}" for entry in ENTRIES]
    caption = f"Difference of {kind.quantity}, 95 %; * changed beyond what both intervals allow"
    return Table(caption, ["point", *named, "flags of both"], rows)


def _drawn(points: pd.DataFrame) -> Figure:
    """Draw differences of K and C with their intervals, point by point; logarithmic beyond the widest interval."""
    figure, grid = new_pictures(2, 1, height=2.7)
    place = np.arange(len(points), dtype=float)
    for (axes,), kind in zip(grid, (STIFFNESS, DAMPING), strict=True):
        label(axes, _POINTS.format(symbol("load")), f"difference of {kind.symbol.upper()}, {kind.display_unit}")
        axes.axhline(0.0, color=INK, linewidth=1.0)
        half = 0.0
        for k, (entry, colour, marker) in enumerate(_MARKS):
            name = f"{kind.column(entry)}_difference"
            value, errors = with_errors(points, name, kind.display_scale)
            half = max(half, float(np.max(errors, where=np.isfinite(errors), initial=0.0)))
            x = place + 0.16 * (k - 1.5)
            axes.errorbar(x, value, yerr=errors, fmt="none", ecolor=LIGHT[colour], capsize=2.5)
            axes.plot(x, value, marker, color=LIGHT[colour], markerfacecolor=LIGHT["paper"], markersize=5, label=entry)
            changed = (points[f"{kind.symbol}{entry}_changed"] == "yes").to_numpy()
            axes.plot(x[changed], value[changed], marker, color=LIGHT[colour], markersize=5)
        if np.max(np.abs(axes.dataLim.intervaly)) > _BEYOND * half > 0.0:
            axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(half)), linscale=0.7)
            axes.yaxis.set_major_formatter("{x:g}")
        set_point_ticks(axes, points)
    add_legend(grid[0][0], across=True)
    return figure
