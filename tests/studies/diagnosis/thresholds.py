"""What the constants of the decision do: every one at half, as it is and at double, on the same mixtures.

    python -m tests.studies.diagnosis.thresholds --rows FILE [--bearing rocker] [--count 100] [--seed 90000]
    python -m tests.studies.diagnosis.thresholds --tables ROWS.jsonl [MORE.jsonl ..]

Campaigns as of `mixtures`, with seeds of their own. A search is run again only where a constant has decided: the
comparisons with it are watched, and where none of them would have gone otherwise the search is the same to the last
bit. Rows go to a JSON-lines file; rows that are there are not drawn again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.studies.diagnosis.mixtures import KINDS, SKIPPED, Bench, bench, draw, hidden, said
from tests.studies.diagnosis.tables import standing
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.search import Search, search
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings
from tpjb_ident.diagnosis.verdict.decide import decide

#: Constants that a search asks, and those that only the verdict asks; `alike` and `spare` act together in a search.
SEARCHED, DECIDED = ("wanted", "exceeds", "alike", "spare"), ("most", "alarm")
FACTORS = (0.5, 2.0)
#: No share is larger.
LARGEST = {"most": 0.95}


class Watched(float):
    """A constant that remembers what it was compared with, and whether it was used otherwise."""

    def __new__(cls, value: float) -> Watched:
        """Begin with nothing seen."""
        new = super().__new__(cls, value)
        new.seen = []  # type: ignore[attr-defined]
        new.used = False  # type: ignore[attr-defined]
        return new

    def __lt__(self, other: float) -> bool:
        """As a float; what is greater than this asks here."""
        self.seen.append(float(other))  # type: ignore[attr-defined]
        return float(self) < other

    def __mul__(self, other: float) -> float:
        """As a float."""
        self.used = True
        return float(self) * other

    def decides(self, value: float) -> bool:
        """Whether another value would have changed an answer."""
        own = float(self)
        return self.used or any((x > own) != (x > value) for x in self.seen)  # type: ignore[attr-defined]


def run(one: Bench, kind: str, seed: int) -> dict[str, Any] | None:
    """Draw one campaign and diagnose it with every constant at every value.

    Parameters
    ----------
    one : Bench
    kind : str
    seed : int
    """
    drawn = draw(one, kind, np.random.default_rng([seed, 20190761]))
    if drawn is None:
        return None
    plain = DiagnoseSettings(workers=1, skip=SKIPPED)
    watched = {name: Watched(getattr(plain, name)) for name in ("wanted", "exceeds", "spare")}
    found = _found(one, drawn.problem, replace(plain, **watched))
    out = {"as it is": said(decide(drawn.problem, found, plain))}
    again = []
    for name in (*SEARCHED, *DECIDED):
        for factor in FACTORS:
            value = min(factor * getattr(plain, name), LARGEST.get(name, np.inf))
            other = replace(plain, **{name: value})
            asked = watched["spare" if name == "alike" else name] if name in SEARCHED else None
            anew = asked is not None and asked.decides(value)
            if anew:
                again.append(f"{name} x {factor:g}")
            there = _found(one, drawn.problem, other) if anew else found
            out[f"{name} x {factor:g}"] = said(decide(drawn.problem, there, other))
    return {"kind": kind, "seed": seed, **hidden(drawn), "said": out, "again": again}


def _found(one: Bench, problem: Problem, settings: DiagnoseSettings) -> Search:
    with workers(one.forward, problem, 1) as run_:
        return search(run_, problem, settings)


def tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """How names and intervals move with every constant, as Markdown.

    Parameters
    ----------
    rows : sequence of mapping
        As of `run`.
    """
    plain = DiagnoseSettings()
    lines = [
        f"{len(rows)} campaigns; counts of those that are asked.", "",
        "| constant | value | scatter alone: no name | dominant cause named, size inside | every effect named "
        "| no false name | intervals hold | outside: described | clean cause named |", "|---" * 9 + "|",
    ]  # fmt: skip
    for name in ("as it is", *(f"{n} x {f:g}" for n in (*SEARCHED, *DECIDED) for f in FACTORS)):
        flat = [{**row, **row["said"][name]} for row in rows]
        asked, _, factor = name.partition(" x ")
        value = min(getattr(plain, asked, 0.0) * float(factor or 1), LARGEST.get(asked, np.inf)) if factor else None
        shown = f"{asked} | {value:g}" if value is not None else "all | as it is"
        lines.append(f"| {shown} | " + " | ".join(f"{sum(held)} of {len(held)}" for held in standing(flat)) + " |")
    return "\n".join(lines)


def main() -> None:
    """Draw, diagnose, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bearing", default="rocker")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=90000)
    parser.add_argument("--rows", type=Path, default=Path("thresholds.jsonl"))
    parser.add_argument("--tables", type=Path, nargs="+", default=())
    asked = parser.parse_args()
    if asked.tables:
        print(tables([json.loads(line) for path in asked.tables for line in path.read_text("utf-8").splitlines()]))
        return
    rows = [json.loads(line) for line in asked.rows.read_text("utf-8").splitlines()] if asked.rows.exists() else []
    done = {(row["bearing"], row["seed"]) for row in rows}
    one = bench(asked.bearing, asked.rows.parent)
    for number in range(asked.count):
        seed = asked.seed + number
        row = None if (asked.bearing, seed) in done else run(one, KINDS[number % len(KINDS)], seed)
        if row is not None:
            rows.append({"bearing": asked.bearing, **row})
            with asked.rows.open("a", encoding="utf-8") as out:
                out.write(json.dumps(rows[-1], default=float) + "\n")
    print(tables(rows))


if __name__ == "__main__":
    main()
