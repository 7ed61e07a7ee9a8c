"""The sample campaigns of another program, diagnosed: what was said, what is true, what it took.

python -m tests.studies.diagnosis.samples [--only NAME] [--write]
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import tpjb_ident as ti
from tests.studies.results import report, study_parser, table
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.verdict.verdict import FoundEffect, Verdict

SHARED = Path(__file__).parents[4] / "shared"
BEARINGS = {"spherical-baseline": "spherical", "effect-b": "spherical", "mixture-a": "spherical"}


def row(name: str) -> tuple[str, ...]:
    """One line of the table."""
    path = next(p for p in (SHARED / "samples" / f"{name}.h5", SHARED / "samples" / name) if p.exists())
    bearing = SHARED / "bearings" / f"{BEARINGS.get(name, 'rocker')}.toml"
    began = time.process_time()
    verdict = ti.diagnose(path, bearing, settings=DiagnoseSettings(workers=1)).diagnosis.verdict
    seconds = time.process_time() - began
    hidden = json.loads((SHARED / "samples" / "truth" / f"{name}.json").read_text(encoding="utf-8")).get("effects", [])
    return (
        name, "; ".join(_hidden(effect) for effect in hidden) or "nothing", verdict.verdict,
        "; ".join(_said(effect) for effect in verdict.effects), _gaps(verdict), f"{seconds:.0f}",
    )  # fmt: skip


def _hidden(effect: dict) -> str:  # type: ignore[type-arg]
    return f"{effect['name']} {', '.join(f'{v:.3g}' for v in effect['parameters'].values())}"


def _said(effect: FoundEffect) -> str:
    sizes = [f"{p.lo:.3g} to {p.hi:.3g}" for p in effect.parameters.values() if p.lo < p.hi]
    return f"{effect.label} {', '.join(sizes)}"


def _gaps(verdict: Verdict) -> str:
    return f"{verdict.gap['heldout_before']:.2f} -> {verdict.gap['heldout_after']:.2f}"


def main() -> None:
    """Diagnose all and print the table."""
    asked = study_parser(__doc__, only="").parse_args()
    rows = []
    for path in sorted((SHARED / "samples" / "truth").glob("*.json")):
        if asked.only in path.stem:
            rows.append(row(path.stem))
            print(*rows[-1], sep=" | ", flush=True)
    head = ("campaign", "hidden", "verdict", "said, 95 %", "held-out gap as stated", "processor, s")
    report(asked, "diagnosis-samples", table(head, rows))


if __name__ == "__main__":
    main()
