"""Tables of diagnosed campaigns, from their rows.

python -m tests.studies.diagnosis.tables [--section strangers-unseen] [--write] ROWS.jsonl [MORE.jsonl ..]
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from scipy.stats import beta

from tests.studies.results import report, study_parser

Row = Mapping[str, Any]
VERDICTS = ("consistent", "named", "ambiguous", "partly-explained", "unexplained")
#: A group of more members than this says nothing.
FEW = 3


def tables(rows: Sequence[Row]) -> str:
    """Every table as Markdown."""
    mixed = [r for r in rows if r["truth"] and not r["outside"] and r["kind"] != "clean"]
    scatter, sized, there, no_false, intervals, described, clean = standing(rows)
    outside = [r for r in rows if r["kind"] == "outside"]
    lines = [
        *_verdicts(rows),
        "",
        "| asked | wanted | held (95 % interval) |",
        "|---|---|---|",
        _line("scatter alone: no name", "95 %", scatter),
        _line("dominant cause named, its size inside its interval", "90 %", sized),
        _line("dominant cause named, or in a group of three at most", "", [_dominant(r, False) for r in mixed]),
        _line("every hidden effect named, or in such a group", "", there),
        _line("no false name beside or instead", "95 %", no_false),
        _line("intervals of right names hold", "90 to 98 %", intervals),
        _line("outside the library: a term, a drift, or unexplained", "90 %", described),
        _line("outside the library: no wrong name as the whole story", "", [r["verdict"] != "named" for r in outside]),
        _line("one clean cause of d' = 12 named", "98 %", clean),
        "",
        f"Processor seconds of a diagnosis: median {median(r['seconds'] for r in rows):.0f}, largest "
        f"{max(r['seconds'] for r in rows):.0f}.",
    ]
    return "\n".join(lines)


def standing(rows: Sequence[Row]) -> list[list[bool]]:
    """What holds, row by row: by what is asked, in the order of `tables`; groups and elsewhere left out."""
    inside = [r for r in rows if r["truth"] and not r["outside"]]
    mixed = [r for r in inside if r["kind"] != "clean"]
    return [
        [not r["named"] for r in rows if r["kind"] == "scatter"],
        [_dominant(r, True) for r in mixed],
        [all_there(r) for r in mixed],
        [no_false(r) for r in mixed],
        [ok for r in inside for ok in _intervals(r)],
        [_described(r) for r in rows if r["kind"] == "outside"],
        [_dominant(r, False) for r in rows if r["kind"] == "clean"],
    ]


def _verdicts(rows: Sequence[Row]) -> list[str]:
    out = ["| hidden | campaigns | " + " | ".join(VERDICTS) + " |", "|---" * (2 + len(VERDICTS)) + "|"]
    for kind in dict.fromkeys(_shown(r) for r in rows):
        mine = [r for r in rows if _shown(r) == kind]
        counts = Counter(r["verdict"] for r in mine)
        out.append(f"| {kind} | {len(mine)} | " + " | ".join(str(counts[v] or "") for v in VERDICTS) + " |")
    return out


def _shown(row: Row) -> str:
    return row["kind"] if row["kind"] != "outside" else f"outside: {row['outside'].split(':')[0]}"


def _line(what: str, wanted: str, held: Sequence[bool]) -> str:
    if not held:
        return f"| {what} | {wanted} | none drawn |"
    n, k = len(held), sum(held)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return f"| {what} | {wanted} | {k} of {n}: {100 * k / n:.0f} % ({100 * low:.0f} to {100 * high:.0f} %) |"


def _groups(row: Row) -> list[set[str]]:
    return [g for g in ({n.split(" ")[0] for n in names} for names in row["alike"]) if len(g) <= FEW]


def _found(row: Row, name: str) -> bool:
    said = {e["name"] for e in row["named"]}
    return name in said or any(name in g and g & said for g in _groups(row))


def all_there(row: Row) -> bool:
    """Whether every hidden effect of the library is listed, or in a group of three at most."""
    return all(_found(row, e["name"]) for e in row["truth"])


def _dominant(row: Row, sized: bool) -> bool:
    first = max(range(len(row["truth"])), key=lambda i: row["shares"][i])
    true = row["truth"][first]
    if not _found(row, true["name"]):
        return False
    held = _held(row, true)
    # in a group under another name its size is not told
    return all(held) if sized and held else True


def no_false(row: Row) -> bool:
    """Whether every name is that of a hidden effect, or in a group with one."""
    truth = {e["name"] for e in row["truth"]}
    return all(e["name"] in truth or any(e["name"] in g and g & truth for g in _groups(row)) for e in row["named"])


def _described(row: Row) -> bool:
    return row["verdict"] == "unexplained" or bool(row["behaves_like"]) or bool(row["drift"])


def _intervals(row: Row) -> list[bool]:
    return [ok for true in row["truth"] for ok in _held(row, true)]


def _held(row: Row, true: Mapping[str, float]) -> list[bool]:
    """Whether the interval of each parameter of an effect that is named holds the truth; directions are left out."""
    out = []
    for found in row["named"]:
        numbers = found["parameters"]
        if found["name"] == true["name"] and ("pad" not in true or numbers["pad"][0] == true["pad"]):
            out += [lo <= true[k] <= hi for k, (_, lo, hi) in numbers.items()
                    if lo < hi and k in true and k != "direction" and math.isfinite(true[k])]  # fmt: skip
    return out


def main() -> None:
    parser = study_parser(__doc__, section="strangers-unseen")
    parser.add_argument("rows", nargs="+", type=Path)
    asked = parser.parse_args()
    text = tables([json.loads(line) for path in asked.rows for line in path.read_text("utf-8").splitlines()])
    report(asked, asked.section, text)


if __name__ == "__main__":
    main()
