"""Evidence: what many trials add up to, as tables and in words.

A row is *right* when the verdict names exactly what was hidden, pad and direction too, or a group of at most three
that holds it; *wrong* when it names something else without a doubt; abstaining is neither.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[str, Any]
#: Members up to which a group counts as an answer.
SMALL = 3
OUTCOMES = (
    "named right", "group right", "large group", "part of it", "consistent", "unexplained", "named wrong",
    "group wrong",
)  # fmt: skip


def outcome(row: Row) -> str:
    """Judge a trial; one of `OUTCOMES`, ``"unreachable"`` or ``"no baseline"`` (the model finds no equilibrium)."""
    spelt = "alternatives" in row  # another pad of the right effect is not what was hidden
    truth, said = (row["truth"], row["labels"]) if spelt else (row["names"], row.get("found", ()))
    verdict, names, found = row["verdict"], sorted(truth), sorted(said)
    if verdict in {"unreachable", "no baseline", "consistent", "unexplained"}:
        return str(verdict)
    if row["kind"] in {"none", "left out"}:
        return "named wrong" if verdict == "named" else "group wrong"
    if verdict == "named":
        if found == names:
            return "named right"
        return "part of it" if found and not Counter(found) - Counter(names) else "named wrong"
    groups = {g[0]: g for g in (row["alternatives"] if spelt else row["groups"])}
    sets = [set(groups.get(name, (name,))) for name in said]
    if len(sets) != len(names) or not _matches(sets, names):
        return "group wrong"
    return "group right" if max(map(len, sets)) <= SMALL else "large group"


def _matches(sets: Sequence[set[str]], names: Sequence[str]) -> bool:
    if not names:
        return True
    first, *rest = names
    return any(first in s and _matches([*sets[:i], *sets[i + 1 :]], rest) for i, s in enumerate(sets))


def summary_table(rows: Iterable[Row]) -> pd.DataFrame:
    """Count outcomes per kind, size and noise, with the share of right answers and the 95 % bounds of errors."""
    import pandas as pd

    groups: dict[tuple[Any, ...], Counter[str]] = {}
    for row in rows:
        key = (row.get("rung", "surrogate"), row["kind"], row["size"], row["noise"])
        groups.setdefault(key, Counter())[outcome(row)] += 1
    out = []
    for (rung, kind, size, noise), counts in sorted(groups.items()):
        total = sum(counts[name] for name in OUTCOMES)
        if not total:
            continue
        right = counts["named right"] + counts["group right"]
        abstained = counts["unexplained"] + sum(counts[k] for k in ("group right", "large group", "group wrong"))
        alarms = total - counts["consistent"] if kind == "none" else counts["named wrong"]
        out.append(
            {
                "rung": rung, "kind": kind, "size_sigma": size, "noise_factor": noise, "trials": total,
                **{name.replace(" ", "_"): counts[name] for name in OUTCOMES}, "unreachable": counts["unreachable"],
                "right_share": right / total if kind in {"hidden", "two"} else math.nan,
                "abstained_share": abstained / total if kind == "left out" else math.nan,
                "errors": alarms, "error_share_upper_95": upper_bound(alarms, total),
            }
        )  # fmt: skip
    return pd.DataFrame(out)


def upper_bound(events: int, trials: int) -> float:
    """Upper one-sided 95 % bound of a share (Clopper and Pearson, Biometrika 26 (1934) 404)."""
    from scipy.stats import beta

    return 1.0 if events >= trials else float(beta.ppf(0.95, events + 1, trials - events))


def confusion_table(rows: Iterable[Row], kind: str = "hidden") -> pd.DataFrame:
    """Hidden effect against what came out, one line per effect and size."""
    import pandas as pd

    cells: dict[tuple[str, float], Counter[str]] = {}
    for row in rows:
        if row["kind"] == kind and row["verdict"] not in {"unreachable", "no baseline"}:
            cells.setdefault((" + ".join(row["truth"]), row["size"]), Counter())[_said(row)] += 1
    return pd.DataFrame(
        [
            {"hidden": truth, "size_sigma": size, "said": said, "count": count}
            for (truth, size), counts in sorted(cells.items())
            for said, count in counts.most_common()
        ]
    )


def _said(row: Row) -> str:
    if row["verdict"] == "named":
        return " + ".join(row["labels"])
    if row["verdict"] == "ambiguous":
        return " / ".join(name for group in row["groups"] for name in group)
    return str(row["verdict"])


def figures_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Coverage of intervals, closure of the gap with its controls, per size."""
    import pandas as pd

    out = []
    rungs = sorted({(r.get("rung", "surrogate"), r["size"]) for r in rows if r["kind"] == "hidden"})
    for rung, size in rungs:
        mine = [r for r in rows if r["kind"] == "hidden" and (r.get("rung", "surrogate"), r["size"]) == (rung, size)]
        named = [r for r in mine if outcome(r) == "named right"]
        known = [r for r in named if "lo" in r]
        covered = [r["lo"] <= r["true_value"] <= r["hi"] for r in known]
        out.append(
            {
                "rung": rung, "size_sigma": size, "named_right": len(named),
                "interval_holds_truth": float(np.mean(covered)) if covered else math.nan,
                "closed_median": _median(named, "closed"),
                "closed_by_wrong_effect_median": _median(named, "closed_wrong"),
                "closed_by_gaussian_process_median": _median(named, "closed_ceiling"),
            }
        )  # fmt: skip
    none = [r for r in rows if r["kind"] == "none"]
    if none:
        out.append(
            {
                "rung": "surrogate",
                "size_sigma": 0.0,
                "named_right": 0,
                "placebo_fall_median": _median(none, "placebo_fall"),
            }
        )
    return pd.DataFrame(out)


def rules_table(rows: Iterable[Row]) -> pd.DataFrame:
    """Compare with naive rules: right and wrong names, per kind and size."""
    import pandas as pd

    table: dict[tuple[str, float, str], Counter[str]] = {}
    for row in rows:
        if "naive" not in row or row["kind"] == "two":
            continue
        said = {**row["naive"], "this diagnosis": row["found"][0] if row["verdict"] == "named" and row["found"] else ""}
        truth = row["names"][0] if row["kind"] == "hidden" else None
        for rule, name in said.items():
            kind = "right" if name and name == truth else "wrong" if name else "none"
            table.setdefault((row["kind"], row["size"], rule), Counter())[kind] += 1
    return pd.DataFrame(
        [
            {"kind": kind, "size_sigma": size, "rule": rule, **_shares(counts)}
            for (kind, size, rule), counts in sorted(table.items())
        ]
    )


def _shares(counts: Counter[str]) -> dict[str, float]:
    total = sum(counts.values())
    return {f"{name}_share": counts[name] / total for name in ("right", "wrong", "none")}


def _median(rows: Sequence[Row], key: str) -> float:
    values = [float(r[key]) for r in rows if r.get(key) is not None and np.isfinite(float(r[key]))]
    return float(np.median(values)) if values else math.nan


def markdown(frame: pd.DataFrame) -> str:
    """Format a table as markdown; numbers with three digits, empty cells for not-a-number."""

    def cell(value: Any) -> str:
        if isinstance(value, (float, np.floating)):
            return "" if math.isnan(value) else f"{value:.3g}"
        return str(value)

    lines = ["| " + " | ".join(map(str, frame.columns)) + " |", "|" + "---|" * len(frame.columns)]
    lines += ["| " + " | ".join(cell(v) for v in row) + " |" for row in frame.itertuples(index=False)]
    return "\n".join(lines) + "\n"
