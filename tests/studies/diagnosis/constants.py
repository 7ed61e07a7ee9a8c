"""Constants of the decision, each at half and at double of its value, on campaigns of `strangers`.

    python -m tests.studies.diagnosis.constants [--bearings 12] [--count 6] [--seed 302] [--rows FILE] [--write]

Every campaign is searched once, with the constants as they stand; what was fitted is then weighed and judged again with
one constant changed: the decision alone. An answer is its verdict with its names. The share that a name takes keeps
half or twice its distance from one; of the prior each further fault has half or twice its odds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.studies import results
from tests.studies.diagnosis.bench import SKIPPED, hidden, said
from tests.studies.diagnosis.strangers import Stranger, drawn_again, every_row
from tests.studies.diagnosis.tables import all_there, no_false
from tpjb_ident.diagnosis.comparison.search import Comparison, _Search
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.verdict.decide import decide

#: Constants that act on what was fitted.
JUDGED = (
    "prior", "term", "untenable", "included", "nothing", "family", "right", "quiet", "halved", "rest", "drifting",
)  # fmt: skip
ENDS = {"half": 0.5, "double": 2.0}


def changed(settings: DiagnoseSettings, name: str, factor: float) -> DiagnoseSettings:
    """Settings with one constant changed; a probability near one keeps its distance to one times the factor."""
    value: Any = getattr(settings, name)
    if name == "prior":  # of one fault and more, beside none
        value = (value[0], *(factor**count * share for count, share in enumerate(value[1:], 1)))
    elif name == "included":
        value = round(1.0 - (1.0 - value) * factor, 6)
    else:
        value = type(value)(max(round(value * factor), 1) if isinstance(value, int) else value * factor)
    return replace(settings, **{name: value})


def run(one: Stranger, number: int, seed: int) -> dict[str, Any] | None:
    """Draw and search a campaign; what is said of it with every constant changed."""
    kind, drawn = drawn_again(one, number, seed)
    if drawn is None:
        return None
    settings = DiagnoseSettings(workers=1, skip=SKIPPED)
    with workers(one.bench.forward, drawn.problem, 1) as processes:
        search = _Search(processes, drawn.problem, settings, lambda text, share: None)

        def answer(comparison: Comparison, chosen: DiagnoseSettings) -> dict[str, Any]:
            return said(decide(processes, drawn.problem, comparison, chosen).verdict)

        answers = {"as it is": answer(search.result(), settings)}
        for name in JUDGED:
            for end, factor in ENDS.items():
                search.settings = changed(settings, name, factor)
                answers[f"{name} {end}"] = answer(search._weighed(), search.settings)
    return {"bearing": number, "seed": seed, "kind": kind, **hidden(drawn), "answers": answers}


def report(rows: Sequence[dict[str, Any]]) -> str:
    """The table: answers that change, and where to."""
    lines = [_line(rows, "as it stands", "", "as it is")]
    for name in JUDGED:
        lines += [
            _line(rows, name, str(getattr(changed(DiagnoseSettings(), name, factor), name)), f"{name} {end}")
            for end, factor in ENDS.items()
        ]
    head = ["constant", "value", "answers that change", "all that is hidden listed", "a wrong name listed", "named"]
    return f"{len(rows)} campaigns.\n\n" + results.table([*head, "a name where scatter is all"], lines)


def _line(rows: Sequence[dict[str, Any]], name: str, value: str, key: str) -> list[object]:
    known = [{**row, **row["answers"][key]} for row in rows]
    inside = [row for row in known if row["truth"] and not row["outside"]]
    moved = sum(_answer(row["answers"][key]) != _answer(row["answers"]["as it is"]) for row in rows)
    return [
        name, value, moved, sum(map(all_there, inside)), sum(not no_false(row) for row in known),
        sum(row["verdict"] == "named" for row in known),
        sum(bool(row["named"]) for row in known if row["kind"] == "scatter"),
    ]  # fmt: skip


def _answer(row: dict[str, Any]) -> tuple[str, list[str]]:
    return row["verdict"], sorted(effect["name"] for effect in row["named"])


def main() -> None:
    """Search, judge with every constant, and print the table."""
    options = {"bearings": 12, "count": 6, "seed": 302, "rows": Path("constants.jsonl")}
    asked = results.study_parser(__doc__, **options).parse_args()
    results.report(asked, "constants", report(every_row(asked, run)))


if __name__ == "__main__":
    main()
