"""Tables of mixtures, from their rows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]


def tables(rows: Sequence[Row]) -> str:
    """Every table as Markdown.

    Parameters
    ----------
    rows : sequence of mapping
        As `mixtures.run` gives them.
    """
    kinds = list(dict.fromkeys(r["kind"] for r in rows))
    verdicts = ("consistent", "named", "ambiguous", "partly-explained", "unexplained")
    out = ["| hidden | campaigns | " + " | ".join(verdicts) + " |", "|---" * (2 + len(verdicts)) + "|"]
    for kind in kinds:
        mine = [r for r in rows if r["kind"] == kind]
        counts = Counter(r["verdict"] for r in mine)
        out.append(f"| {kind} | {len(mine)} | " + " | ".join(str(counts[v] or "") for v in verdicts) + " |")
    out += ["", "| asked | held |", "|---|---|"]
    scatter = [r for r in rows if r["kind"] == "scatter"]
    hidden = [r for r in rows if r["truth"]]
    outside = [r for r in rows if r["kind"] == "outside"]
    out += [
        _line("scatter alone: no name", [not r["named"] for r in scatter]),
        _line("every hidden effect of the library named, or in a group", [_all_there(r) for r in hidden]),
        _line("the same, one hidden", [_all_there(r) for r in hidden if r["kind"] == "one"]),
        _line("some hidden effect named (dominant cause)", [_some_there(r) for r in hidden]),
        _line("no false name beside or instead, library complete", [_no_false(r) for r in hidden if not r["outside"]]),
        _line("outside the library: no single wrong name", [r["verdict"] != "named" for r in outside]),
        _line("outside: described by a term or a drift, or unexplained", [_described(r) for r in outside]),
        _line("intervals of right names hold", [ok for r in hidden for ok in _intervals(r)]),
    ]
    seconds = sorted(r["seconds"] for r in rows)
    out += [
        "",
        f"Processor seconds of a diagnosis: median {seconds[len(seconds) // 2]:.0f}, largest {seconds[-1]:.0f}.",
    ]
    return "\n".join(out)


def _line(what: str, held: Sequence[bool]) -> str:
    share = f"{sum(held)} of {len(held)} ({100 * sum(held) / len(held):.0f} %)" if held else "none drawn"
    return f"| {what} | {share} |"


def _said(row: Row) -> set[str]:
    return {e["name"] for e in row["named"]}


def _names(row: Row) -> set[str]:
    """What is named, with all that cannot be told from it."""
    groups = {n.split(" ")[0] for g in row["alike"] for n in g}
    return _said(row) | groups


def _all_there(row: Row) -> bool:
    return {e["name"] for e in row["truth"]} <= _names(row)


def _some_there(row: Row) -> bool:
    return bool({e["name"] for e in row["truth"]} & _names(row))


def _no_false(row: Row) -> bool:
    truth = {e["name"] for e in row["truth"]}
    groups = [{n.split(" ")[0] for n in g} for g in row["alike"]]
    return all(n in truth or any(n in g and g & truth for g in groups) for n in _said(row))


def _described(row: Row) -> bool:
    return row["verdict"] == "unexplained" or bool(row["behaves_like"]) or bool(row["drift"])


def _intervals(row: Row) -> list[bool]:
    out = []
    for true in row["truth"]:
        for found in row["named"]:
            same = found["name"] == true["name"]
            fixed = all(found["parameters"].get(k, [v])[0] == v for k, v in true.items() if k == "pad")
            if same and fixed:
                out += [lo <= true[k] <= hi for k, (_, lo, hi) in found["parameters"].items()
                        if lo < hi and k in true and k != "direction" and math.isfinite(true[k])]  # fmt: skip
    return out
