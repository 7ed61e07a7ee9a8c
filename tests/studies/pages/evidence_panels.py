"""Pictures of an evaluation, as many as its tables allow."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from tests.studies.evidence.case import case_residuals
from tests.studies.evidence.counts import SPECIAL
from tests.studies.evidence.measures import no_effect_p
from tests.studies.evidence.next_tests import separations
from tests.studies.evidence.outcome import OUTCOMES, Row
from tests.studies.pages.case_dots import case_gaps
from tests.studies.pages.closure_boxes import closures
from tests.studies.pages.confusion_map import confusion
from tests.studies.pages.coverage_dots import interval_coverage
from tests.studies.pages.next_test_dots import next_tests
from tests.studies.pages.outcome_bars import outcomes
from tests.studies.pages.p_values_line import p_values
from tests.studies.pages.power_curves import power
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.plots.residual_map import residual_map

if TYPE_CHECKING:
    import pandas as pd

GROUP = "Evidence"
ALARM = 0.01
#: Campaigns on which simple rules are drawn, and their order.
SHOWN = (("hidden", 6.0), ("none", 0.0), ("left out", 12.0))
RULES = ("this diagnosis", "largest score", "training chi-square", "BIC", "random")
KINDS = {"hidden": "hidden", "two": "two effects", "none": "nothing hidden", "left out": "left out"}


def evidence_panels(rows: Sequence[Row], tables: Mapping[str, pd.DataFrame]) -> list[Panel]:
    """Draw everything that `tables` (see `tests.studies.evidence.tables.evidence_tables`) can fill."""
    out = _outcomes(tables)
    if "power" in tables:
        table = tables["power"]
        table = table[table["rung"].isin(["surrogate", "raw volts"])]  # other plans have one size each
        if len(table):
            out.append(panel("power", "Detected, named and wrongly named against the size that was hidden",
                             power(table), GROUP))  # fmt: skip
    found = no_effect_p(rows)
    if found:
        title = "p-values of campaigns that hide nothing (P-P plot)"
        out.append(panel("p-values", title, p_values(found, ALARM), GROUP))
    out += _matrices(tables)
    if "coverage" in tables and tables["coverage"]["intervals"].any():
        out.append(panel("coverage", "Intervals that hold the truth, of rightly named effects; right: how many",
                         interval_coverage(tables["coverage"]), GROUP))  # fmt: skip
    out += _closures(tables)
    if "case" in tables:
        out.append(panel("case-gaps", "One case: residual by observable, held-out points, before and after and by "
                         "three controls", case_gaps(tables["case"]), GROUP))  # fmt: skip
        out.append(panel("case-residuals", "One case: residuals of every coefficient and point, before and after",
                         residual_map(case_residuals(rows)), GROUP))  # fmt: skip
    if "next_tests" in tables:
        title = "What the suggested test settles, beside a random one; separations foretold and found"
        out.append(panel("next-tests", title, next_tests(tables["next_tests"], separations(rows)), GROUP))
    return out + _rules(tables)


def _outcomes(tables: Mapping[str, pd.DataFrame]) -> list[Panel]:
    if "summary" not in tables:
        return []
    table, out = tables["summary"], []
    for name, mine in (("surrogate", table["rung"] == "surrogate"), ("raw volts", table["rung"] == "raw volts"),
                       ("raw volts, other plans", table["rung"].str.startswith("raw volts, "))):  # fmt: skip
        bars: dict[str, Counter[str]] = {}
        for line in table[mine].to_dict("records"):
            key = KINDS[line["kind"]] + (f", d' = {line['size_sigma']:g}" if line["kind"] != "none" else "")
            bars.setdefault(key, Counter()).update({o: int(line[o.replace(" ", "_")]) for o in OUTCOMES})
        if bars:
            totals = [sum(bar.values()) for bar in bars.values()]
            out.append(panel(f"outcomes-{_slug(name)}", f"What came out of campaigns: {name}; right: how many",
                             outcomes(bars, totals), GROUP))  # fmt: skip
    return out


def _slug(name: str) -> str:
    return name.replace(", ", "-").replace(" ", "-")


def _matrices(tables: Mapping[str, pd.DataFrame]) -> list[Panel]:
    out = []
    for name, frame in tables.items():
        raw, plain = name.startswith("raw_"), name.removeprefix("raw_")
        absent = plain.startswith("left_out_matrix")
        if not absent and not plain.startswith("confusion_matrix"):
            continue
        size = plain.rsplit("_", 1)[1]
        where = "raw volts" if raw else "surrogate"
        title = f"{'Left out of the library' if absent else 'Hidden'} at d' = {size} ({where})"
        slug = f"{'left-out' if absent else 'confusion'}-{'raw-' if raw else ''}{size}"
        out.append(panel(slug, title, confusion(frame, SPECIAL, absent=absent), GROUP))
    return out


def _closures(tables: Mapping[str, pd.DataFrame]) -> list[Panel]:
    if "closure" not in tables:
        return []
    table, out = tables["closure"], []
    for where in ("surrogate", "raw volts"):
        mine = table[table["rung"] == where]
        if len(mine):
            title = f"Gap closed by the right name and by three controls: {where}"
            out.append(panel(f"closure-{_slug(where)}", title, closures(mine), GROUP))
    return out


def _rules(tables: Mapping[str, pd.DataFrame]) -> list[Panel]:
    if "rules" not in tables:
        return []
    bars: dict[str, dict[str, float]] = {}
    counts = []
    table = tables["rules"]
    for (kind, size), rule in itertools.product(SHOWN, RULES):
        mine = table[(table["kind"] == kind) & (table["size_sigma"] == size) & (table["rule"] == rule)]
        if not len(mine):
            continue
        line = mine.iloc[0]
        key = f"{line['rule']}: {KINDS[line['kind']]}"
        key += f", d' = {line['size_sigma']:g}" if line["size_sigma"] else ""
        bars[key] = {"right": line["right_share"], "wrong": line["wrong_share"], "no name": line["none_share"]}
        counts.append(int(line["trials"]))
    title = "A single name by simple rules and by this diagnosis; right: how many campaigns"
    return [panel("rules", title, outcomes(bars, counts), GROUP)] if bars else []
