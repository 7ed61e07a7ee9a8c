"""The page of two campaigns held against each other: what changed, by how much, and how sure that is."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tpjb_ident.columns import per, size, symbol
from tpjb_ident.compare.difference import Difference, difference_sentences, shown_difference
from tpjb_ident.report.drawing.colours import INK, LIGHT
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures
from tpjb_ident.report.drawing.series import point_labels, set_point_ticks
from tpjb_ident.report.figure import panel
from tpjb_ident.report.page import Page, Section, Table, write_page
from tpjb_ident.rounding import significant
from tpjb_ident.schema import DAMPING, ENTRIES, STIFFNESS, TANGENT, Coefficient

_TITLE = "Differences, 95 % intervals; full marks changed beyond what both intervals allow"
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
        facts=_facts(difference),
        picture=panel("difference", _TITLE, functools.partial(_drawn, points), "") if len(points) else None,
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


def _sections(difference: Difference) -> list[Section]:
    sections = []
    points = difference.points
    if len(points):
        tables = [_coefficient_table(points, kind) for kind in (STIFFNESS, DAMPING)]
        sections.append(Section("Coefficients", tables=tables))
    if not difference.pivots.empty:
        rows = [
            _row(row, TANGENT, "stiffness", significant(row["force_N"] * per("load"), ".3g"))
            for row in difference.pivots.to_dict("records")
        ]
        columns = ["pad", f"load, {symbol('load')}", *_columns("stiffness")]
        table = Table("Tangent stiffness of the pivots, where both were measured", columns, rows, frozenset({0, 5}))
        sections.append(Section("Pivots", tables=[table]))
    if not difference.clearance.empty:
        rows = [_row(row, "clearance_m", "length") for row in difference.clearance.to_dict("records")]
        columns = ["pad", *_columns("length")]
        table = Table("Assembled clearance at zero push load", columns, rows, frozenset({0, 4}))
        sections.append(Section("Clearance", tables=[table]))
    return sections


def _columns(quantity: str) -> list[str]:
    return [f"{side}, {symbol(quantity)}" for side in ("first", "second", "difference")] + ["changed"]


def _row(row: Mapping[Any, Any], name: str, quantity: str, *place: str) -> list[str]:
    values = [significant(row[f"{name}_{side}"] * per(quantity)) for side in "ab"]
    difference = shown_difference(row, name, size(quantity))
    return [f"#{row['pad']:g}", *place, *values, difference, row[f"{name.partition('_')[0]}_changed"]]


def _coefficient_table(points: pd.DataFrame, kind: Coefficient) -> Table:
    """Differences of K or of C at every point, and which of them changed."""
    rows = []
    for place, row in zip(point_labels(points), points.to_dict("records"), strict=True):
        cells = []
        for entry in ENTRIES:
            cells.append(shown_difference(row, kind.column(entry), kind.display_scale))
            if row[f"{kind.symbol}{entry}_changed"] == "yes":
                cells[-1] += " *"
        flags = dict.fromkeys(
            f for side in "ab" for f in str(row.get(f"quality_{side}", "ok")).split("; ") if f != "ok"
        )
        rows.append([place, *cells, ", ".join(flags) or "ok"])
    named = [f"{kind.symbol}{entry}, {kind.display_unit}" for entry in ENTRIES]
    caption = f"Difference of {kind.quantity}, 95 %; * changed beyond what both intervals allow"
    return Table(caption, ["point", *named, "flags of both"], rows, frozenset({0, 5}))


def _drawn(points: pd.DataFrame) -> Figure:
    """Draw differences of K and C with their intervals, point by point."""
    figure, ((left, right),) = new_pictures(1, 2, height=3.6)
    place = np.arange(len(points), dtype=float)
    for axes, kind in ((left, STIFFNESS), (right, DAMPING)):
        label(
            axes,
            f"operating point: load in {symbol('load')}, excitation in Hz",
            f"difference of {kind.quantity}, {kind.display_unit}",
        )
        axes.axhline(0.0, color=INK, linewidth=1.0)
        for k, (entry, colour, marker) in enumerate(_MARKS):
            name = f"{kind.column(entry)}_difference"
            value, low, high = (points[name + end].to_numpy(float) / kind.display_scale for end in ("", "_lo", "_hi"))
            x = place + 0.16 * (k - 1.5)
            axes.errorbar(x, value, yerr=[value - low, high - value], fmt="none", ecolor=LIGHT[colour], capsize=2.5)
            axes.plot(x, value, marker, color=LIGHT[colour], markerfacecolor=LIGHT["paper"], markersize=5, label=entry)
            changed = (points[f"{kind.symbol}{entry}_changed"] == "yes").to_numpy()
            axes.plot(x[changed], value[changed], marker, color=LIGHT[colour], markersize=5)
        set_point_ticks(axes, points)
    add_legend(left, across=True)
    box = right.get_position()
    right.set_position((box.x0, box.y0, box.width, left.get_position().height))
    return figure
