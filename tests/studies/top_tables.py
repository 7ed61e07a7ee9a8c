"""Where the time of each command goes: a small table of every row, to read before anything is changed.

    OMP_NUM_THREADS=1 python -m tests.studies.top_tables CAMPAIGN [--rows help predict compare ...] [--lines 8]

Every command runs in a process of its own under Python's profiler, after one run that is thrown away. What is told are
processor times [s] of this process (a second process that works beside it is not in them), by what they are spent for:
imports, the product's rooms by what they do themselves with all that they call outside of the product, and the rest.
The profiler makes Python code some 1.5 times slower; compiled loops and libraries it leaves alone.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BEARING = str(ROOT / "model" / "bearings" / "rocker.toml")
Key = tuple[str, int, str]


def commands(campaign: str, out: str) -> dict[str, list[str]]:
    """Arguments of every row."""
    given = ["--out", out, "-q"]
    return {
        "help": ["--help"],
        "predict": ["predict", BEARING, *given],
        "identify": ["identify", campaign, "--workers", "1", *given],
        "compare": ["compare", campaign, *given],
        "demo": ["demo", *given],
        "diagnose": ["diagnose", campaign, "--workers", "1", *given],
    }


def profiled(arguments: list[str]) -> dict[str, float]:
    """Run a command in this process; processor seconds by room."""
    watch, began = cProfile.Profile(time.process_time), time.process_time()
    watch.enable()
    try:
        from tpjb_ident.cli import main as command_line

        sys.argv = ["tpjb", *arguments]
        command_line()
    except SystemExit:
        pass
    watch.disable()
    whole = time.process_time() - began
    shares = by_room(pstats.Stats(watch).stats)  # type: ignore[attr-defined]
    return {"": whole, **shares}


def by_room(stats: dict[Key, Any]) -> dict[str, float]:
    """Own time of all functions, given to the rooms that called them; what several rooms call is shared by its time."""
    owner: dict[Key, dict[str, float]] = {}

    def rooms(key: Key, path: frozenset[Key]) -> dict[str, float]:
        if key in owner:
            return owner[key]
        own = room(key)
        if own:
            return owner.setdefault(key, {own: 1.0})
        callers = {k: max(v[3], 1e-12) for k, v in stats[key][4].items() if k in stats and k not in path}
        total, found = sum(callers.values()), defaultdict(float)
        for caller, weight in callers.items():
            for name, share in rooms(caller, path | {key}).items():
                found[name] += share * weight / total
        return owner.setdefault(key, dict(found) or {"start": 1.0})

    sys.setrecursionlimit(20_000)
    spent: dict[str, float] = defaultdict(float)
    for key, (_, _, own, _, _) in stats.items():
        for name, share in rooms(key, frozenset()).items():
            spent[name] += own * share
    return dict(spent)


def room(key: Key) -> str:
    """What a function's own time is booked on; "" for a library's, which its callers pay."""
    file, _, function = key
    if "importlib" in file or function in ("<module>", "<built-in method _imp.create_dynamic>"):
        return "imports"
    if "numba" in file or "llvmlite" in file:
        return "numba: loading of compiled code"
    path = Path(file)
    if not path.is_relative_to(ROOT):
        return ""
    parts = path.relative_to(ROOT).parts
    return "/".join(parts[: min(len(parts) - 1, 3)]) if parts[0] in ("model", "rigdata", "tpjb_ident") else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign")
    parser.add_argument("--rows", nargs="*", default=["help", "predict", "identify", "compare", "demo"])
    parser.add_argument("--lines", type=int, default=8)
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.inside:
        Path(given.campaign).write_text(json.dumps(profiled(json.loads(given.inside))), encoding="utf-8")
        return
    with tempfile.TemporaryDirectory() as folder:
        table = commands(given.campaign, str(Path(folder) / "out"))
        for name in given.rows:
            answer = Path(folder) / "answer.json"
            command = [sys.executable, "-m", "tests.studies.top_tables", str(answer), "--inside"]
            for _ in range(2):
                subprocess.run([*command, json.dumps(table[name])], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
            spent = json.loads(answer.read_text(encoding="utf-8"))
            whole = spent.pop("")
            print(f"\n{name}: {whole:.2f} s\n\n| where | s | share |\n|---|---|---|")
            for where, seconds in sorted(spent.items(), key=lambda item: -item[1])[: given.lines]:
                print(f"| {where} | {seconds:.2f} | {seconds / sum(spent.values()):.0%} |", flush=True)


if __name__ == "__main__":
    main()
