"""Constants of a diagnosis, each at half and at double of its value, on campaigns of `strangers`.

    python -m tests.studies.diagnosis.constants [--bearing 53] [--bearings 3] [--count 8] [--seed 990] [--write]

Every campaign is searched and judged anew with one constant changed; an answer is its verdict with its names. Of a
probability near one the distance to one is changed, of the prior each further fault's odds.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.studies.diagnosis.bench import SKIPPED
from tests.studies.diagnosis.strangers import run, stranger
from tests.studies.diagnosis.tables import all_there, no_false
from tests.studies.results import Rows, report, study_parser, table
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.observations.constants import Deciding

#: Constants that weigh, search and judge; the others act where observations are made, a plan is drawn, or words chosen.
CONSTANTS = (
    "prior", "term", "untenable", "included", "nothing", "family", "right", "halved", "rest", "drifting",
    "near", "most_fits", "width", "turn", "reach", "usual", "silent", "followed", "mistaken", "better",
    "worth_derivatives", "surprise", "suspect", "coarse", "held", "visible", "same",
)  # fmt: skip
FACTORS = (0.5, 2.0)


def changed(name: str, factor: float) -> Any:
    """One constant at another size."""
    value: Any = getattr(Deciding, name)
    if name == "prior":
        return (value[0], *(factor**count * share for count, share in enumerate(value[1:], 1)))
    if name == "included":
        return round(1.0 - (1.0 - value) * factor, 6)
    return max(round(value * factor), 1) if isinstance(value, int) else value * factor


@contextmanager
def deciding(name: str, value: Any) -> Iterator[None]:
    """With one constant at a value."""
    before = getattr(Deciding, name)
    setattr(Deciding, name, value)
    try:
        yield
    finally:
        setattr(Deciding, name, before)


def answer(row: dict[str, Any]) -> list[Any]:
    """What a campaign is answered with."""
    return [row["verdict"], sorted(effect["name"] for effect in row["named"])]


def line(rows: list[dict[str, Any]], usual: list[dict[str, Any]], name: str, value: Any) -> list[object]:
    """How answers move with a constant."""
    inside = [row for row in rows if row["truth"] and not row["outside"]]
    moved = sum(answer(row) != answer(other) for row, other in zip(rows, usual, strict=True))
    return [
        name, json.dumps(value), moved, sum(map(all_there, inside)), sum(not no_false(row) for row in rows),
        sum(row["verdict"] == "named" for row in rows),
        sum(bool(row["named"]) for row in rows if row["kind"] == "scatter"),
        f"{sum(row['seconds'] for row in rows):.0f}",
    ]  # fmt: skip


def main() -> None:
    """Diagnose with every constant, and print the table; rows that are there are not made again."""
    options = {"bearing": 53, "bearings": 3, "count": 8, "seed": 990, "rows": Path("constants.jsonl")}
    asked = study_parser(__doc__, **options).parse_args()
    settings = DiagnoseSettings(workers=1, skip=SKIPPED)
    changes: list[tuple[str, Any]] = [("right", Deciding.right)]
    changes += [(name, changed(name, factor)) for name in CONSTANTS for factor in FACTORS]
    stored = Rows(asked.rows, "constant", "value", "bearing", "seed")
    for number in range(asked.bearing, asked.bearing + asked.bearings):
        one = stranger(number, asked.rows.parent)
        for name, value in changes:
            for seed in range(asked.seed, asked.seed + asked.count):
                if (name, json.dumps(value), number, seed) not in stored.known:
                    with deciding(name, value):
                        row = run(one, number, seed, settings)
                    if row is not None:
                        stored.add({**row, "constant": name, "value": json.dumps(value)})
    by_change: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in stored.known.values():
        by_change.setdefault((row["constant"], row["value"]), []).append(row)
    usual = by_change[changes[0][0], json.dumps(changes[0][1])]
    lines = [line(by_change[name, json.dumps(value)], usual, name, value) for name, value in changes]
    head = ["constant", "value", "answers that change", "all that is hidden listed", "a wrong name listed", "named"]
    head += ["a name where scatter is all", "processor, s"]
    lines[0][0] = "as it stands"
    report(asked, "constants", f"{len(usual)} campaigns.\n\n" + table(head, lines))


if __name__ == "__main__":
    main()
