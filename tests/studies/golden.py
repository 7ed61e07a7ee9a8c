"""Golden results: fifty commands on nine campaigns, run in one checkout and held against another's, number by number.

    python -m tests.studies.golden run OUT [--only identify,pivot] [--campaign rocker-baseline]
    python -m tests.studies.golden compare BEFORE AFTER

`run` writes the results folder and the printed text of each command below OUT. `compare` prints each file that is not
the same to the bit, with the largest difference of its numbers and where it is; above 1e-9 of the value, or of its
interval's half width, it ends with exit code 1. An older checkout runs a copy of this file in its own folder.
"""

import argparse
import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from tpjb_ident.runtime.differences import compared

CHECKOUT = Path(__file__).resolve().parents[2]
SAMPLES = (CHECKOUT.parent / "shared" / "samples").resolve()
CAMPAIGNS = (
    "rocker-baseline", "spherical-baseline.h5", "rocker-measured-pivots.h5", "effect-a.h5", "effect-b.h5",
    "effect-c.h5", "mixture-a.h5", "mixture-b.h5", "mixture-c.h5",
)  # fmt: skip
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"
#: Files that say when and where a command ran, or that a library writes.
PASSING = re.compile(r"(run\.json|\.png|\.svg|\.parquet|\.h5|\.xlsx|\.mat|\.html)$")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
LIMIT = 1e-9


def commands() -> dict[str, list[str]]:
    """Name every command, with its words."""
    table: dict[str, list[str]] = {}
    for campaign in CAMPAIGNS:
        path, name = str(SAMPLES / campaign), campaign.removesuffix(".h5")
        table[f"check {name}"] = ["check", path]
        table[f"identify {name}"] = ["identify", path, "--plain"]
        table[f"pivot {name}"] = ["pivot", path]
        table[f"locus {name}"] = ["locus", path]
        if name != "rocker-measured-pivots":
            table[f"diagnose {name}"] = ["diagnose", path]
    table["compare demo"] = ["compare", DEMO]
    table["compare tehd"] = ["compare", str(SAMPLES / "effect-a.h5"), "--pivots", "kirk, measured", "--thermal", "tehd"]
    table["identify rlm"] = ["identify", DEMO, "--method", "rlm", "--norm", "tukey"]
    table["predict loads"] = ["predict", ROCKER, "--load", "2.5..8.75:1.25 kN", "--excitation", "25 Hz"]
    table["predict rigid"] = ["predict", ROCKER, "--pivots", "rigid", "--speed", "1000, 2000, 3000 rpm"]
    table["predict tehd"] = ["predict", ROCKER, "--load", "5 kN", "--thermal", "tehd", "--excitation", "10..50:10 Hz"]
    table["plan"] = ["plan", ROCKER, "--locus", "10"]
    table["show"] = ["show", DEMO, "--run", "d-05000-25-01"]
    table["export"] = ["export", "{identify rocker-baseline}", "--to", "csv"]
    table["export ross"] = ["export", "{identify rocker-baseline}", "--to", "ross"]
    table["simulate"] = ["simulate", "model/bearings/spherical.toml", "--plan", "short", "--seed", "1"]
    return table


def run(out: Path, only: list[str], campaigns: list[str]) -> None:
    """Run the commands into one folder each; `{name}` in a command's words is the folder of a former one."""
    for name, words in commands().items():
        if only and words[0] not in only:
            continue
        if campaigns and not any(campaign in name for campaign in campaigns):
            continue
        folder = out / name.replace(" ", "-")
        folder.mkdir(parents=True, exist_ok=True)
        filled = [str(out / w[1:-1].replace(" ", "-") / "out") if w.startswith("{") else w for w in words]
        target = [] if words[0] in ("show",) else ["--out", str(folder / "out")]
        began = time.perf_counter()
        environment = {**os.environ, "COLUMNS": "120"}
        call = [sys.executable, "-P", "-m", "tpjb_ident", *filled, *target]
        ended = subprocess.run(call, capture_output=True, text=True, cwd=CHECKOUT, env=environment, check=False)
        text = ended.stdout.replace(str(out), "OUT")
        (folder / "printed.txt").write_text(f"exit {ended.returncode}\n{text}", encoding="utf-8")
        print(f"{name}: exit {ended.returncode}, {time.perf_counter() - began:.1f} s", flush=True)
        if ended.returncode not in (0, 3):
            print(ended.stderr[-2000:])


def text_difference(before: str, after: str) -> float:
    """Largest relative difference of the numbers in a text; infinity where the words between them differ."""
    if NUMBER.sub("#", before) != NUMBER.sub("#", after):
        return math.inf
    pairs = zip(map(float, NUMBER.findall(before)), map(float, NUMBER.findall(after)), strict=True)
    return max(abs(a - b) / max(abs(a), abs(b)) for a, b in pairs if a != b)


def difference(before: Path, after: Path, name: str) -> tuple[float, str]:
    """How far a file differs, and where: tables as `tpjb rerun` judges them."""
    found = compared(before, after, name, LIMIT)
    if found.state == "not judged":
        old, new = ((folder / name).read_text(encoding="utf-8") for folder in (before, after))
        return text_difference(old, new), "text"
    return (math.inf, found.state) if found.state in ("missing", "new") else (found.size, found.where)


def compare(before: Path, after: Path) -> int:
    """Print each file that differs; 1 if one does by more than the limit."""
    names = {p.relative_to(root).as_posix() for root in (before, after) for p in root.rglob("*") if p.is_file()}
    same = worst = 0
    for name in sorted(names):
        if PASSING.search(name):
            continue
        size, where = difference(before, after, name)
        if where:
            print(f"{name}: {size:.1e}, {where}")
        same += not where
        worst = max(worst, int(size > LIMIT))
    print(f"{same} files the same to the bit")
    return worst


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    action = parser.add_subparsers(dest="action", required=True)
    runs = action.add_parser("run")
    runs.add_argument("out", type=Path)
    runs.add_argument("--only", default="", help="commands, with commas")
    runs.add_argument("--campaign", default="", help="parts of their names, with commas")
    comparison = action.add_parser("compare")
    comparison.add_argument("before", type=Path)
    comparison.add_argument("after", type=Path)
    given = parser.parse_args()
    if given.action == "compare":
        return compare(given.before, given.after)
    run(given.out.resolve(), [w for w in given.only.split(",") if w], [w for w in given.campaign.split(",") if w])
    return 0


if __name__ == "__main__":
    sys.exit(main())
