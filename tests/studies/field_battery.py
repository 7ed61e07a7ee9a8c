"""Prints the battery's table.

    python -m tests.studies.field_battery [--seeds 20] [--first-seed N] [--only WORDS] [--rows FILE] [--table FILE ..]

With ``--rows`` every campaign's outcome is added to a file of JSON lines as it comes, and what the file holds already
is not run again: a study that was stopped goes on, and more seeds join the former ones. ``--table`` only prints what
such files hold, ``--write`` puts the table into RESULTS.md. Limits of the product were once set while looking at
seeds 1000 to 1002; figures are from others.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from tests.rigs.campaign_file import write_campaign
from tests.rigs.field_conditions import Row, rows
from tests.rigs.field_judge import Outcome, judge
from tests.studies.results import table, write_section

Key = tuple[str, int]


def run_seed(row: Row, seed: int) -> Outcome:
    """One condition on fresh records."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.h5"
        write_campaign(path, row.rig, row.plans, seed, row.extra)
        return judge(path, row.rig)


def kept_rows(path: Path) -> dict[Key, tuple[Outcome, float]]:
    """Outcomes and seconds that a file holds, by row and seed."""
    found = {}
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        entry = json.loads(text)
        found[entry.pop("row"), entry.pop("seed")] = (entry.pop("seconds"), entry)
    return {key: (Outcome(**entry), seconds) for key, (seconds, entry) in found.items()}


def keep(path: Path, row: str, seed: int, outcome: Outcome, seconds: float) -> None:
    """Add one outcome to the file."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"row": row, "seed": seed, "seconds": round(seconds, 2), **asdict(outcome)}) + "\n")


def line(row: Row, outcomes: Sequence[Outcome], seconds: float) -> str:
    """One row of the table."""
    words = Counter(o.word for o in outcomes)
    entries = sum(o.entries for o in outcomes)
    inside = f"{100 * sum(o.inside for o in outcomes) / entries:5.1f}" if entries else "    -"
    points = sum(o.right + o.wrong + o.told for o in outcomes) or 1
    flagged = 100 * sum(o.flagged for o in outcomes) / points
    widths = [w for o in outcomes for w in o.width]
    width = f"{100 * sorted(widths)[len(widths) // 2]:6.2f}" if widths else "     -"
    named = Counter(n for o in outcomes for n in set(o.names))
    most = ", ".join(f"{n} {k}" for n, k in named.most_common(4))
    crash = next((o.crash for o in outcomes if o.crash), "")
    counts = " ".join(f"{words[w]:4d}" for w in ("right", "told", "silent", "crash"))
    return (
        f"{row.name[:74]:74s} {row.wish:5s} {counts}  {inside} {width} {flagged:5.0f}  {seconds:5.1f}  {crash or most}"
    )


def cells(row: Row, outcomes: Sequence[Outcome]) -> list[str]:
    """One row of the table in RESULTS.md."""
    words = Counter(o.word for o in outcomes)
    entries = sum(o.entries for o in outcomes)
    inside = f"{100 * sum(o.inside for o in outcomes) / entries:.0f}" if entries else ""
    widths = sorted(w for o in outcomes for w in o.width)
    width = f"{100 * widths[len(widths) // 2]:.2g}" if widths else ""
    counts = " / ".join(str(words[w]) for w in ("right", "told", "silent", "crash"))
    return [row.name, row.wish, counts, inside, width]


def options() -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--only", default="", help="rows whose names hold one of these words, apart by |")
    parser.add_argument("--rows", type=Path, help="file of JSON lines that outcomes are added to and taken from")
    parser.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    parser.add_argument("--table", type=Path, nargs="+", help="print what these files hold, run nothing")
    return parser.parse_args()


def main() -> None:
    """Run or print the battery."""
    given = options()
    wanted = [row for row in rows() if any(w in row.name.lower() for w in given.only.lower().split("|"))]
    print(f"{'condition':74s} wish  right told silent crash in% width% flag%  s  named")
    written: list[list[str]] = []
    total: Counter[str] = Counter()
    for row in wanted:
        found = table_outcomes(given.table, row) if given.table else row_outcomes(given, row)
        if found:
            outcomes = [o for o, _ in found]
            total.update(o.word for o in outcomes)
            print(line(row, outcomes, sum(s for _, s in found) / len(found)), flush=True)
            written.append(cells(row, outcomes))
    summary = ", ".join(f"{word} {total[word]}" for word in ("right", "told", "silent", "crash"))
    print(summary)
    if given.write:
        head = ("condition", "wanted", "right / reported / silent / crash", "inside %", "half-width %")
        seeds = f"--seeds {given.seeds} --first-seed {given.first_seed}"
        write_section(
            "field", f"python -m tests.studies.field_battery {seeds} --write", f"{summary}.\n\n{table(head, written)}"
        )


def table_outcomes(files: Sequence[Path], row: Row) -> list[tuple[Outcome, float]]:
    """What files hold of a row."""
    return [value for file in files for (name, _), value in kept_rows(file).items() if name == row.name]


def row_outcomes(given: argparse.Namespace, row: Row) -> list[tuple[Outcome, float]]:
    """Outcomes of a row for all seeds asked for; runs what is not kept."""
    kept = kept_rows(given.rows) if given.rows else {}
    for seed in range(given.first_seed, given.first_seed + given.seeds):
        if (row.name, seed) not in kept:
            start = time.time()
            kept[row.name, seed] = (run_seed(row, seed), time.time() - start)
            if given.rows:
                keep(given.rows, row.name, seed, *kept[row.name, seed])
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    return [kept[row.name, seed] for seed in seeds]


if __name__ == "__main__":
    main()
