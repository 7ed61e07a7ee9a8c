"""Outcome: whether one trial was right, wrong or abstained.

A row is *right* when the verdict names exactly what was hidden, pad and direction too, or a group of at most three
that holds it; *wrong* when it names something else without a doubt; abstaining is neither.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]
#: Members up to which a group counts as an answer.
SMALL = 3
OUTCOMES = (
    "named right", "group right", "large group", "part of it", "consistent", "unexplained", "named wrong",
    "group wrong",
)  # fmt: skip
#: Kinds of trials that are judged; other rows tell of next tests, and of one case.
KINDS = ("hidden", "two", "none", "left out")
RIGHT = frozenset({"named right", "group right"})
#: Verdicts of trials that never came to a diagnosis: no such size within bounds, no equilibrium.
NOT_RUN = frozenset({"unreachable", "no baseline"})


def outcome(row: Row) -> str:
    """Judge a trial; one of `OUTCOMES` or `NOT_RUN`."""
    spelt = "alternatives" in row  # another pad of the right effect is not what was hidden
    truth, said = (row["truth"], row["labels"]) if spelt else (row["names"], row.get("found", ()))
    verdict, names, found = row["verdict"], sorted(truth), sorted(said)
    if verdict in NOT_RUN or verdict in {"consistent", "unexplained"}:
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


def rung(row: Row) -> str:
    """Where a trial began: ``"surrogate"``, ``"raw volts"``, or the latter with the name of another plan."""
    return str(row.get("rung", "surrogate"))


def run(rows: Sequence[Row], *kinds: str) -> list[Row]:
    """Rows of some kinds that came to a diagnosis."""
    return [row for row in rows if row["kind"] in kinds and row["verdict"] not in NOT_RUN]
