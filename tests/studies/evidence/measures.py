"""Measures of what a diagnosis claims: power, p-values, coverage of intervals, closure of the gap, simple rules."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.studies.evidence.outcome import RIGHT, Row, outcome, run, rung
from tests.studies.evidence.shares import quantiles, share_interval

if TYPE_CHECKING:
    import pandas as pd

#: Levels at which the distribution of p-values is told.
LEVELS = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9)
#: d' from which intervals are judged by effect: what is named below was lifted by noise.
JUDGED = 6.0
CLOSERS = {"closed": "effect named", "closed_wrong": "best wrong effect", "closed_ceiling": "Gaussian process"}


def power_table(rows: Sequence[Row]) -> pd.DataFrame:
    """P(detected), P(named or in a small group), P(named) against d' with 95 % intervals, per noise and over all."""
    import pandas as pd

    out = []
    for where, size, noise in _cells(rows):
        mine = [
            r for r in run(rows, "hidden")
            if (rung(r), r["size"]) == (where, size) and noise in {"all", f"{r['noise']:g}"}
        ]  # fmt: skip
        came = [outcome(r) for r in mine]
        line: dict[str, Any] = {"rung": where, "size_sigma": size, "noise_factor": noise, "trials": len(mine)}
        for name, hits in (
            ("detected", sum(c != "consistent" for c in came)),
            ("right", sum(c in RIGHT for c in came)),
            ("named_right", came.count("named right")),
            ("named_wrong", came.count("named wrong")),
        ):
            share, low, high = share_interval(hits, len(mine))
            line |= {name: share, f"{name}_lo": low, f"{name}_hi": high}
        out.append(line)
    return pd.DataFrame(out)


def _cells(rows: Sequence[Row]) -> list[tuple[str, float, str]]:
    """Rung, size and noise of hidden effects; ``"all"`` where there is more than one noise."""
    found = {(rung(r), float(r["size"]), f"{r['noise']:g}") for r in run(rows, "hidden")}
    noises = Counter((where, size) for where, size, _ in found)
    both = {(where, size, "all") for (where, size), count in noises.items() if count > 1}
    return sorted(found | both, key=lambda c: (c[0] != "surrogate", c[0], c[1], c[2] != "all", c[2]))


def no_effect_p(rows: Sequence[Row]) -> dict[str, list[float]]:
    """p-values of campaigns that hide nothing, sorted, per rung; all plans that are not the paper's together."""
    out: dict[str, list[float]] = {}
    for row in run(rows, "none"):
        where = "raw volts, other plans" if rung(row).startswith("raw volts, ") else rung(row)
        if isinstance(row.get("p_before"), float):
            out.setdefault(where, []).append(row["p_before"])
    return {where: sorted(values) for where, values in sorted(out.items(), key=lambda kv: kv[0] != "surrogate")}


def p_value_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Share of no-effect p-values below some levels; a right test has the level itself."""
    import pandas as pd

    out = []
    for where, values in no_effect_p(rows).items():
        shares = {f"below_{level:g}": float(np.mean(np.array(values) < level)) for level in LEVELS}
        out.append({"rung": where, "campaigns": len(values), **shares, "smallest": values[0]})
    return pd.DataFrame(out)


def coverage_table(rows: Sequence[Row]) -> pd.DataFrame:
    """How often the 95 % interval of a right name holds the truth: by effect from d' = 6, and per size over all."""
    import pandas as pd

    known = [r for r in run(rows, "hidden") if outcome(r) == "named right" and "lo" in r]
    strong = [r for r in known if r["size"] >= JUDGED]
    sets: list[tuple[str, list[Row]]] = []
    for raw, where in ((False, "surrogate"), (True, "raw volts")):
        mine = [r for r in known if rung(r).startswith("raw volts") == raw]
        sizes = sorted({r["size"] for r in mine})
        sets += [(f"all, d' = {size:g}, {where}", [r for r in mine if r["size"] == size]) for size in sizes]
    sets.append((f"all, d' = {JUDGED:g} and more", strong))
    names = sorted({str(r["names"][0]) for r in strong})
    sets += [(name, [r for r in strong if r["names"][0] == name]) for name in names]
    out = []
    for name, mine in sets:
        held = sum(r["lo"] <= r["true_value"] <= r["hi"] for r in mine)
        share, low, high = share_interval(held, len(mine))
        out.append({"effect": name, "intervals": len(mine), "hold_truth": held, "share": share,
                    "share_lo": low, "share_hi": high})  # fmt: skip
    return pd.DataFrame([line for line in out if line["intervals"]])


def closure_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Share of the squared gap closed on held-out points by right names, wrong effect and Gaussian process.

    The placebo is the fall of the squared misfit per held-out point where nothing is hidden and the effect of the
    largest score is added all the same.
    """
    import pandas as pd

    out = []
    cells = sorted({(rung(r), r["size"]) for r in run(rows, "hidden")}, key=lambda c: (c[0] != "surrogate", *c))
    for where, size in cells:
        mine = [
            r for r in run(rows, "hidden")
            if (rung(r), r["size"]) == (where, size) and outcome(r) == "named right"
        ]  # fmt: skip
        for key, by in CLOSERS.items():
            out.append(_spread(where, size, by, [r.get(key) for r in mine]))
    for where in dict.fromkeys(rung(r) for r in run(rows, "none")):
        falls = [r.get("placebo_fall") for r in run(rows, "none") if rung(r) == where]
        out.append(_spread(where, 0.0, "placebo: fall per point", falls))
    return pd.DataFrame([line for line in out if line["campaigns"]])


def _spread(where: str, size: float, by: str, values: Sequence[Any]) -> dict[str, Any]:
    known = [v for v in values if isinstance(v, float) and math.isfinite(v)]
    names = ("q05", "q25", "median", "q75", "q95")
    return {"rung": where, "size_sigma": size, "closed_by": by, "campaigns": len(known),
            **dict(zip(names, quantiles(known), strict=True))}  # fmt: skip


def rules_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Compare with naive rules: right and wrong names, per kind and size."""
    import pandas as pd

    table: dict[tuple[str, float, str], Counter[str]] = {}
    for row in run(rows, "hidden", "none", "left out"):
        if "naive" not in row:
            continue
        said = {**row["naive"], "this diagnosis": row["found"][0] if row["verdict"] == "named" and row["found"] else ""}
        truth = row["names"][0] if row["kind"] == "hidden" else None
        for rule, name in said.items():
            kind = "right" if name and name == truth else "wrong" if name else "none"
            table.setdefault((row["kind"], row["size"], rule), Counter())[kind] += 1
    return pd.DataFrame(
        [
            {"kind": kind, "size_sigma": size, "rule": rule, "trials": counts.total(), **_three(counts)}
            for (kind, size, rule), counts in sorted(table.items())
        ]
    )


def _three(counts: Counter[str]) -> dict[str, float]:
    return {f"{name}_share": counts[name] / counts.total() for name in ("right", "wrong", "none")}
