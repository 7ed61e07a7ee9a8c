"""The page of an evaluation: how often a diagnosis is right, in words, pictures and tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.studies.evidence.measures import no_effect_p
from tests.studies.evidence.outcome import Row, run, rung
from tests.studies.pages.evidence_panels import evidence_panels
from tpjb_ident.report.figure import save_panels
from tpjb_ident.report.page import Page, Section, Table, render_page
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.report.figure import Panel

#: Heading of every section, the tables and the pictures (by the beginning of their names) that stand in it, and notes.
SECTIONS: tuple[tuple[str, tuple[str, ...], tuple[str, ...], str], ...] = (
    ("Outcomes", ("summary",), ("outcomes",),
     "An answer is right if it names exactly what was hidden, pad and direction too, or a group of at most three that "
     "holds it. Sizes are d', standard deviations of noise, tolerance and calibration errors together."),
    ("Power", ("power",), ("power",), "Bars are 95 % intervals of binomial shares (Clopper and Pearson)."),
    ("False alarms", ("p_values",), ("p-values",),
     "Campaigns with calibration errors and nothing hidden. A right test gives uniform p-values; below the diagonal it "
     "is shyer than stated."),
    ("What was hidden, what was said", (), ("confusion",),
     "Counts; shades are shares of a row. Framed on the diagonal: right. Framed red: a wrong single name."),
    ("With the true effect left out of the library", ("abstention", "impostors"), ("left-out",),
     "Right answers are unexplained and, less so, ambiguous: no name in the library can be true."),
    ("Intervals", ("coverage",), ("coverage",), "Of parameters whose effect was rightly named."),
    ("The gap, on points that no fit has seen", ("closure",), ("closure",),
     "1 is what noise and tolerance leave. The Gaussian process closes what can be closed and names nothing."),
    ("One case, entry by entry", ("case",), ("case",),
     "A campaign of the surrogate whose pivots are softer than the formula says; points that no fit has seen, "
     "less the calibration errors that the fitted points show. The placebo is a campaign that hides nothing."),
    ("Next tests", ("next_tests", "next_test_pairs"), ("next-test",),
     "What the suggested test settles, by simulation: campaigns that came out ambiguous and the test after "
     "them are drawn with the same calibration errors and diagnosed together. Settled: the truth alone is named."),
    ("Plans", ("plans",), (), "Campaigns written as raw volts, by what was measured."),
    ("Simple rules on the same campaigns", ("rules",), ("rules",),
     "By names alone; a wrong pad of a right name counts as right here."),
)  # fmt: skip


def write_evidence_report(
    folder: Path,
    rows: Sequence[Row],
    tables: Mapping[str, pd.DataFrame],
    about: tuple[str, Mapping[str, Any], Mapping[str, str]],
) -> Path:
    """Write report.html and its figures into an existing folder.

    Parameters
    ----------
    folder : Path
    rows : sequence of Row
    tables : mapping of str to DataFrame
        As of `tests.studies.evidence.tables.evidence_tables`.
    about : (title, settings, inputs)
        What was evaluated, how, and the SHA-256 of what from.
    """
    panels = evidence_panels(rows, tables)
    texts = save_panels(panels, folder / "figures")
    title, settings, inputs = about
    page = Page(
        title=f"How often the diagnosis is right: {title}",
        subtitle=_subtitle(rows),
        answer=_answer(tables),
        more=_more(rows, tables),
        sections=_sections(tables, panels),
        settings={k: str(v) for k, v in settings.items()},
        inputs=dict(inputs),
    )
    path = folder / "report.html"
    write_text(path, render_page(page, texts))
    return path


def _subtitle(rows: Sequence[Row]) -> str:
    counts: dict[str, int] = {}
    for row in run(rows, "none", "hidden", "left out", "two"):
        counts[rung(row)] = counts.get(rung(row), 0) + 1
    plans = sum(n for name, n in counts.items() if name.startswith("raw volts, "))
    parts = [f"{n} campaigns ({name})" for name, n in counts.items() if not name.startswith("raw volts, ")]
    return ", ".join(parts + ([f"{plans} campaigns of other plans (raw volts)"] if plans else []))


def _answer(tables: Mapping[str, pd.DataFrame]) -> str:
    """The numbers that the targets are about, of the rung that stands first."""
    table = tables.get("power")
    if table is None:
        return "No campaign with a hidden effect has been diagnosed."
    first = table[(table["rung"] == table["rung"].iloc[0])]
    parts = []
    for size in dict.fromkeys(first["size_sigma"]):
        mine = first[first["size_sigma"] == size].iloc[0]
        parts.append(f"{100 * mine['right']:.1f} % at d' = {size:g}")
    return (
        f"Named rightly, or in a group of at most three that holds the truth ({table['rung'].iloc[0]}): "
        f"{', '.join(parts)}."
    )


def _more(rows: Sequence[Row], tables: Mapping[str, pd.DataFrame]) -> list[str]:
    out = []
    summary = tables.get("summary")
    if summary is not None:
        hidden = summary[summary["kind"] == "hidden"]
        if len(hidden):
            out.append(f"Wrong single names with one effect hidden: {hidden['named_wrong'].sum():.0f} of "
                       f"{hidden['trials'].sum():.0f}.")  # fmt: skip
    for where, values in no_effect_p(rows).items():
        alarms = sum(r["verdict"] != "consistent" for r in run(rows, "none") if _family(r) == where)
        out.append(f"False alarms ({where}): {alarms} of {len(values)}; the smallest p-value is {values[0]:.2g}.")
    out += [
        f"True effect left out, d' = {line['size_sigma']:g} ({line['rung']}): {100 * line['abstained_share']:.0f} % of "
        f"{line['trials']} abstain."
        for line in _lines(tables, "abstention")
    ]
    out += [
        f"Ambiguous campaigns with data set {line['data_set']} that the suggested next test settles: "
        f"{100 * line['settled']:.0f} % of {line['ambiguous_campaigns']}; a random test: "
        f"{100 * line['settled_by_random']:.0f} %."
        for line in _lines(tables, "next_tests")
        if line["size_sigma"] == "all"
    ]
    return out + [
        f"95 % intervals of right names hold the truth in {line['hold_truth']} of {line['intervals']}."
        for line in _lines(tables, "coverage")
        if "and more" in line["effect"]
    ]


def _family(row: Row) -> str:
    return "raw volts, other plans" if rung(row).startswith("raw volts, ") else rung(row)


def _lines(tables: Mapping[str, pd.DataFrame], name: str) -> list[dict[Any, Any]]:
    return tables[name].to_dict("records") if name in tables else []


def _sections(tables: Mapping[str, pd.DataFrame], panels: Sequence[Panel]) -> list[Section]:
    out = []
    for heading, names, starts, note in SECTIONS:
        mine = [p for p in panels if p.name.startswith(starts)] if starts else []
        shown = [page_table(name, tables[name]) for name in names if name in tables]
        if mine or shown:
            out.append(Section(heading, [note], mine, shown))
    return out


def page_table(name: str, frame: pd.DataFrame) -> Table:
    """A table of results as cells of text: shares and numbers to three digits, words to the left."""
    words = frozenset(i for i, kind in enumerate(frame.dtypes) if not np.issubdtype(_plain(kind), np.number))
    rows = [[_cell(value) for value in line] for line in frame.itertuples(index=False)]
    columns = [str(column).replace("_", " ") for column in frame.columns]
    return Table(f"{name.replace('_', ' ').capitalize()} ({name}.csv)", columns, rows, words)


def _plain(kind: Any) -> Any:
    return kind if isinstance(kind, np.dtype) else np.dtype(object)


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if math.isnan(value) else f"{value:.3g}"
    return str(value)
