"""Prints the battery's table: ``python -m tests.studies.field [--seeds 20] [--only WORDS] [--csv FILE]``."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.studies.field.campaign_file import write_campaign
from tests.studies.field.conditions import Row, rows
from tests.studies.field.judge import Outcome, judge


def run_row(row: Row, seeds: int, first: int = 1000) -> list[Outcome]:
    """One condition on fresh records per seed."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + seeds):
            path = Path(folder) / "field.h5"
            write_campaign(path, row.rig, row.plans, seed, row.extra)
            found.append(judge(path, row.rig))
            path.unlink()
    return found


def line(row: Row, outcomes: list[Outcome], seconds: float) -> str:
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
        f"{row.name[:58]:58s} {row.wish:5s} {counts}  {inside} {width} {flagged:5.0f}  {seconds:5.1f}  {crash or most}"
    )


def main() -> None:
    """Command line."""
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--only", default="")
    given = options.parse_args()
    print(f"{'condition':58s} wish  right told silent crash in% width% flag%  s  named")
    for row in rows():
        if given.only.lower() in row.name.lower():
            start = time.time()
            outcomes = run_row(row, given.seeds)
            print(line(row, outcomes, time.time() - start), flush=True)


if __name__ == "__main__":
    main()
