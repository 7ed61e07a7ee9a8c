"""All tables of an evaluation by name, and tables as markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.studies.evidence.case import case_table
from tests.studies.evidence.counts import (
    abstention_table,
    confusion_matrix,
    confusion_table,
    impostors_table,
    plans_table,
    summary_table,
)
from tests.studies.evidence.measures import closure_table, coverage_table, p_value_table, power_table, rules_table
from tests.studies.evidence.next_tests import next_test_pairs, next_test_table
from tests.studies.evidence.outcome import KINDS, Row, outcome, run, rung

if TYPE_CHECKING:
    import pandas as pd


def evidence_tables(rows: Sequence[Row]) -> dict[str, pd.DataFrame]:
    """Every table that rows can fill; those without a line are left out.

    Returns
    -------
    dict of str to DataFrame
        By file name: summary, power, p_values, coverage, closure, abstention, impostors, plans, rules, confusion,
        and a confusion matrix per size.
    """
    tables = {
        "summary": summary_table(rows),
        "power": power_table(rows),
        "p_values": p_value_table(rows),
        "coverage": coverage_table(rows),
        "closure": closure_table(rows),
        "abstention": abstention_table(rows),
        "impostors": impostors_table(rows),
        "plans": plans_table(rows),
        "rules": rules_table(rows),
        "case": case_table(rows),
        "next_tests": next_test_table(rows),
        "next_test_pairs": next_test_pairs(rows),
        **matrices(rows),
        "confusion": confusion_table(rows),
    }
    return {name: frame for name, frame in tables.items() if len(frame)}


def matrices(rows: Sequence[Row]) -> dict[str, pd.DataFrame]:
    """Confusion matrices by name: per size of hidden effects and of effects that were left out; raw volts apart."""
    out = {}
    for kind, name in (("hidden", "confusion_matrix"), ("left out", "left_out_matrix")):
        for raw in (False, True):
            mine = [r for r in rows if rung(r).startswith("raw volts") == raw]
            for size in sorted({float(r["size"]) for r in run(mine, kind)}):
                out[f"{'raw_' if raw else ''}{name}_{size:g}"] = confusion_matrix(mine, kind, size)
    return out


def trials_table(rows: Sequence[Row]) -> pd.DataFrame:
    """One line per trial, groups joined, with its outcome; simple rules and tests that followed are left out."""
    import pandas as pd

    flat: list[Mapping[str, Any]] = []
    for row in rows:
        if row["kind"] in KINDS:
            cells = {k: _flat(v) for k, v in row.items() if k != "naive"}
            flat.append({**cells, "outcome": outcome(row)})
    return pd.DataFrame(flat)


def _flat(value: Any) -> Any:
    if not isinstance(value, tuple):
        return value
    return " | ".join(" / ".join(v) if isinstance(v, tuple) else str(v) for v in value)


def markdown(frame: pd.DataFrame) -> str:
    """Format a table as markdown; numbers with three digits, empty cells for not-a-number."""

    def cell(value: Any) -> str:
        if isinstance(value, (float, np.floating)):
            return "" if math.isnan(value) else f"{value:.3g}"
        return str(value).replace("|", "\\|")

    lines = ["| " + " | ".join(map(str, frame.columns)) + " |", "|" + "---|" * len(frame.columns)]
    lines += ["| " + " | ".join(cell(v) for v in row) + " |" for row in frame.itertuples(index=False)]
    return "\n".join(lines) + "\n"
