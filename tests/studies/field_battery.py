"""The field battery: campaigns of rigs in closed form, one condition per row; right, reported, silent or crash.

    python -m tests.studies.field_battery [--seeds 20] [--first-seed N] [--only WORDS] [--rows FILE] [--write]

With ``--rows`` every campaign's outcome is added to a file of JSON lines as it comes, and what the file holds already
is not run again. Limits of the product were once set while looking at seeds 1000 to 1002; figures are from others.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.rigs.campaign_file import write_campaign
from tests.rigs.field_conditions import Row, rows
from tests.rigs.field_judge import Outcome, judge
from tests.studies.results import Rows, study_parser, table, typed, write_section

WORDS = ("right", "told", "silent", "crash")


def run_seed(row: Row, seed: int) -> dict[str, Any]:
    """One condition on fresh records."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.h5"
        write_campaign(path, row.rig, row.plans, seed, row.extra)
        return {"row": row.name, "seed": seed, **asdict(judge(path, row.rig))}


def cells(row: Row, outcomes: Sequence[Outcome]) -> list[str]:
    """One row of the table."""
    words = Counter(o.word for o in outcomes)
    entries = sum(o.entries for o in outcomes)
    inside = f"{100 * sum(o.inside for o in outcomes) / entries:.0f}" if entries else ""
    widths = sorted(w for o in outcomes for w in o.width)
    width = f"{100 * widths[len(widths) // 2]:.2g}" if widths else ""
    return [row.name, row.wish, " / ".join(str(words[w]) for w in WORDS), inside, width]


def main() -> None:
    """Run the battery."""
    parser = study_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--only", default="", help="rows whose names hold one of these words, separated by |")
    parser.add_argument("--rows", type=Path, help="file of JSON lines that outcomes are added to and taken from")
    asked = parser.parse_args()
    stored = Rows(asked.rows, "row", "seed")
    entries: list[list[str]] = []
    total: Counter[str] = Counter()
    for row in rows():
        if not any(word in row.name.lower() for word in asked.only.lower().split("|")):
            continue
        outcomes = []
        for seed in range(asked.first_seed, asked.first_seed + asked.seeds):
            if (row.name, seed) not in stored.known:
                stored.add(run_seed(row, seed))
            figures = {k: v for k, v in stored.known[row.name, seed].items() if k not in ("row", "seed", "seconds")}
            outcomes.append(Outcome(**figures))
        total.update(o.word for o in outcomes)
        entries.append(cells(row, outcomes))
        named = Counter(name for o in outcomes for name in {*o.names, o.crash} - {""})
        print(*entries[-1], dict(named.most_common(4)), sep=" | ", flush=True)
    summary = ", ".join(f"{word} {total[word]}" for word in WORDS)
    print(summary)
    if asked.write:
        head = ("condition", "wanted", "right / reported / silent / crash", "inside %", "half-width %")
        write_section("field", typed(), f"{summary}.\n\n{table(head, entries)}")


if __name__ == "__main__":
    main()
