"""Golden results: fifty commands on nine campaigns, run in one checkout and held against another's, number by number.

    python -m tests.studies.golden run OUT [--only identify,pivot] [--campaign rocker-baseline]
    python -m tests.studies.golden compare BEFORE AFTER

`run` writes the results folder and the printed text of each command below OUT. `compare` prints each file that is not
the same to the bit, with the largest difference of its numbers (of the value, or of its standard deviation where the
table has one); above 1e-9 it ends with exit code 1. An older checkout runs a copy of this file in its own folder.
"""

import argparse
import csv
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
SAMPLES = (CHECKOUT.parent / "shared" / "samples").resolve()
CAMPAIGNS = (
    "rocker-baseline", "spherical-baseline.h5", "rocker-measured-pivots.h5", "effect-a.h5", "effect-b.h5",
    "effect-c.h5", "mixture-a.h5", "mixture-b.h5", "mixture-c.h5",
)  # fmt: skip
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"
#: Files that say when and where a command ran, or that a picture library writes.
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


def deviations(cells: dict[str, str]) -> dict[str, float]:
    """Give the standard deviation of each column that has one next to it (`kxx` and `kxx_se`)."""
    spread = {}
    for column in cells:
        text = cells.get(f"{column}_se", "")
        if text and text not in ("nan", "inf"):
            spread[column] = float(text)
    return spread


def differences(before: Path, after: Path) -> Iterator[float]:
    """Give the difference of each number of two texts, or of common columns; infinity where words differ."""
    if before.suffix != ".csv":
        yield from text_differences(before.read_text(encoding="utf-8"), after.read_text(encoding="utf-8"))
        return
    old, new = table(before), table(after)
    if len(old) != len(new):
        yield math.inf
        return
    for first, second in zip(old, new, strict=True):
        spread = deviations(first)
        for column in first.keys() & second.keys():
            a, b = first[column], second[column]
            if a == b:
                continue
            if NUMBER.fullmatch(a) and NUMBER.fullmatch(b):
                size = max(abs(float(a)), abs(float(b)), spread.get(column, 0.0))
                yield abs(float(a) - float(b)) / size
            else:
                yield from text_differences(a, b)


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def columns_of_one(before: Path, after: Path) -> list[str]:
    """List the columns that only one of two tables has, `-` where it went and `+` where it came."""
    headers = [next(csv.reader(path.read_text(encoding="utf-8").splitlines()[:1]), []) for path in (before, after)]
    gone = [f"-{column}" for column in headers[0] if column not in headers[1]]
    return gone + [f"+{column}" for column in headers[1] if column not in headers[0]]


def text_differences(before: str, after: str) -> Iterator[float]:
    """Give relative differences of the numbers in a text, infinity where the words between them differ."""
    if NUMBER.sub("#", before) != NUMBER.sub("#", after):
        yield math.inf
        return
    for a, b in zip(NUMBER.findall(before), NUMBER.findall(after), strict=True):
        if a != b:
            x, y = float(a), float(b)
            yield abs(x - y) / max(abs(x), abs(y))


def compare(before: Path, after: Path) -> int:
    """Print each file that differs; 1 if one does by more than the limit."""
    names = sorted({p.relative_to(root) for root in (before, after) for p in root.rglob("*") if p.is_file()})
    same = worst = 0
    for name in names:
        if PASSING.search(name.name):
            continue
        old, new = before / name, after / name
        if not (old.exists() and new.exists()):
            print(f"{name}: only in {'BEFORE' if old.exists() else 'AFTER'}")
            worst = 1
        elif old.read_bytes() == new.read_bytes():
            same += 1
        else:
            largest = max(differences(old, new), default=0.0)
            word = "words or shape" if math.isinf(largest) else f"{largest:.1e}"
            columns = columns_of_one(old, new) if name.suffix == ".csv" else []
            print(f"{name}: {word}", *columns)
            worst = max(worst, int(largest > LIMIT))
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
