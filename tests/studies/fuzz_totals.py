"""Sum up `fuzz_record.json`: cases that every reader has stood as its source is now, and before.

``python tests/studies/fuzz_totals.py`` prints a table in Markdown. A case counts for the present source as long as
the SHA-256 of the reader's files is the one it was recorded with.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fuzz_targets import TARGETS, source_hash

RECORD = Path(__file__).with_name("fuzz_record.json")


def totals(record: list[dict[str, Any]], name: str) -> dict[str, Any]:
    """Figures of one target: cases now and before, and of those on the present source what they took and gave."""
    mine = [entry for entry in record if entry["target"] == name]
    now = source_hash(name)
    present = [entry for entry in mine if entry["source_sha256"] == now]
    cases = sum(entry["cases"] for entry in present)
    return {
        "cases": cases,
        "before": sum(entry["cases"] for entry in mine) - cases,
        "accepted": sum(entry["accepted"] for entry in present),
        "cpu": sum(entry["cpu_seconds"] for entry in present),
        "slowest": max((entry["slowest"] for entry in present), default=0.0),
        "peak": max((entry["peak_MB"] for entry in present), default=0),
        "findings": sum(sum(entry["findings"].values()) for entry in present),
    }


def main() -> None:
    """Print the table."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    print("| reader | cases | taken | CPU s | slowest | peak memory | findings | with earlier sources |")
    print("|---|---|---|---|---|---|---|---|")
    for name in TARGETS:
        t = totals(record, name)
        print(
            f"| {name} | {t['cases']:,} | {t['accepted']:,} | {t['cpu']:,.0f} | {t['slowest']:.1f} s "
            f"| {t['peak']} MB | {t['findings']} | {t['before']:,} |"
        )


if __name__ == "__main__":
    main()
