"""The second field battery: conditions x seeds through `identify` and `check` of one checkout, or of two side by side.

    python -P -m tests.studies.field.battery [--only WORDS] [--seeds N] [--first-seed N] [--jobs J] [--checkout PATH]
        [--other PATH] [--rows FILE] [--write]

Of good data (wanted: right) the word is *right*, *alarm* (refused, or an error of `check`), *wide* (an interval or an
error beyond the condition's bound) or *silent*; of bad data *reported*, *right* (the interval allows for the fault),
*wide* (by half of |h_ii| or more) or *silent*. Silent: exit code 0, and a direct coefficient further off than chance
has it in one campaign of 200. *Crash*: an exit code but 0, 2, 3. Errors and half-widths are in % of |h_ii|.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from scipy.stats import norm

from tests.studies.field.acquisition import Array, Campaign, write_campaign
from tests.studies.field.conditions import Condition, conditions
from tests.studies.results import Rows, study_parser, table, typed, write_section

ROOT = Path(__file__).resolve().parents[3]
WORDS = ("right", "reported", "silent", "alarm", "wide", "crash")
HEAD = ("condition", "wanted", "became", "exit, check", "inside %", "error %, worst", "half-width %", "flags")
ENTRIES = ("xx", "xy", "yx", "yy")
#: Runs commands of one checkout, each in a fork of a process that has loaded everything.
SERVER = """
import importlib, json, os, pkgutil, sys, traceback
import rigdata, tpjb_ident
for package in (rigdata, tpjb_ident):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if "__main__" not in module.name and "view" not in module.name:
            try:
                importlib.import_module(module.name)
            except ImportError:
                pass
from tpjb_ident.cli import main
for line in sys.stdin:
    job = json.loads(line)
    child = os.fork()
    if child == 0:
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        sys.argv = ["tpjb", *job["command"]]
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1 if end.code else 0
        except BaseException:
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(json.dumps([status, os.times().children_user + os.times().children_system]), flush=True)
"""


class Checkout:
    """A process with the packages of one checkout."""

    def __init__(self, path: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(path), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen([sys.executable, "-P", "-c", SERVER], env=environment, cwd=path, **pipes)
        self.seconds = 0.0

    def run(self, command: list[str], log: Path) -> tuple[int, float]:
        """Exit code and processor seconds of one command."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(json.dumps({"command": command, "log": str(log)}), file=self.process.stdin, flush=True)
        code, total = json.loads(self.process.stdout.readline())
        spent, self.seconds = total - self.seconds, total
        return int(code), float(spent)


@dataclass
class Figures:
    """A campaign's result against its truth: errors and half-intervals of direct coefficients in % of |h_ii|."""

    error: list[float] = field(default_factory=list)
    half: list[float] = field(default_factory=list)
    inside: list[bool] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)

    def add(self, value: Array, low: Array, high: Array, truth: Array) -> None:
        """One point, each (2, 2, 2): real and imaginary part of h [N/m]."""
        if not np.isfinite(value).all():
            return
        self.inside += list(((truth >= low) & (truth <= high)).ravel())
        for i in (0, 1):
            percent = np.hypot(*truth[:, i, i]) / 100
            half = np.where(value < truth, high - value, value - low)[:, i, i] / percent
            self.error += list(np.abs(value - truth)[:, i, i] / percent)
            self.half += list(np.where(np.isfinite(half), half, np.inf))

    @property
    def wrong(self) -> bool:
        """Whether a direct coefficient is further off than its interval says."""
        ratio = np.array(self.error) / np.maximum(self.half, 1e-12)
        return bool(self.error) and float(ratio.max()) > norm.isf(0.0025 / len(self.error)) / 1.96


def stiffness(row: Any, ending: str, omega: float) -> Array:
    """Re h and Im h (2, 2, 2) of a row of `frf` or `coefficients`."""
    if f"hxx_real_N_per_m{ending}" in row:
        names = [f"h{e}_{part}_N_per_m{ending}" for part in ("real", "imag") for e in ENTRIES]
        return np.array(row[names], dtype=float).reshape(2, 2, 2)
    names = [f"k{e}_N_per_m{ending}" for e in ENTRIES] + [f"c{e}_Ns_per_m{ending}" for e in ENTRIES]
    return np.array(row[names], dtype=float).reshape(2, 2, 2) * np.array([1.0, omega])[:, None, None]


def figures(folder: Path, campaign: Campaign) -> Figures:
    """Hold the table of `identify` against the truth."""
    result = Figures()
    tables = [folder / name for name in ("frf.csv", "coefficients.csv") if (folder / name).exists()]
    for _, row in pd.read_csv(tables[0]).iterrows() if tables else ():
        result.flags += [flag.strip() for flag in str(row["quality"]).split(";") if flag.strip() != "ok"]
        stated = float(row["excitation_Hz"])
        h = campaign.truth(float(row["static_load_N"]), stated)
        low, value, high = (stiffness(row, end, 2 * np.pi * campaign.real(stated)) for end in ("_lo", "", "_hi"))
        result.add(value, low, high, np.array([h.real, h.imag]))
    return result


def verdict(condition: Condition, identified: int, checked: int, result: Figures) -> str:
    """What became of a campaign."""
    if not {identified, checked} <= {0, 2, 3}:
        return "crash"
    silent, half = identified == 0 and result.wrong, float(np.median(result.half or [np.inf]))
    if condition.wanted == "reported":
        return "reported" if identified else "silent" if silent else "right" if half < 50 else "wide"
    if silent or identified or checked or not result.error:
        return "silent" if silent else "alarm"
    return "right" if max(result.error) <= condition.bound and half <= condition.width else "wide"


def outcome(condition: Condition, seed: int, checkout: Checkout) -> dict[str, Any]:
    """One campaign through one checkout."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        campaign, setup = condition.make(seed)
        path = str(write_campaign(folder, campaign, setup, [seed, crc32(condition.name.encode()), 1]))
        logs = [folder / "identify.log", folder / "check.log"]
        identified, seconds = checkout.run(["identify", path, "--out", str(folder / "i"), "--workers", "1"], logs[0])
        checked, _ = checkout.run(["check", path, "--out", str(folder / "c")], logs[1])
        result = figures(folder / "i", campaign)
        texts = [log.read_text(errors="replace") for log in logs]
    flags = [f"{flag} x{n}" for flag, n in Counter(result.flags).most_common(5)]
    errors = re.findall(r"^(?:tpjb: )?error: (.{0,110})", texts[0], re.MULTILINE)
    refused = [line.strip()[:110] for line in texts[0].partition("not to be trusted:")[2].splitlines()[1:3]]
    if checked and not identified:
        errors += ["check: " + text for text in re.findall(r"^(?:tpjb: )?error: (.{0,110})", texts[1], re.MULTILINE)]
    word = verdict(condition, identified, checked, result)
    if word == "crash":
        errors = [text.strip().splitlines()[-1][-110:] for text in texts if "Traceback" in text]
    return {
        "condition": condition.name, "seed": seed, "word": word, "exit": identified, "check": checked,
        "seconds": round(seconds, 2), "inside": sum(result.inside), "entries": len(result.inside),
        "error": float(np.median(result.error or [np.nan])), "worst": max(result.error, default=np.nan),
        "half": float(np.median(result.half or [np.nan])), "flags": refused + errors[:2] + flags,
    }  # fmt: skip


def cells(condition: Condition, rows: list[dict[str, Any]]) -> list[str]:
    """One line of the table."""
    frame = pd.DataFrame(rows)
    words = ", ".join(f"{word} {n}" for word, n in frame["word"].value_counts().items())
    codes = ", ".join("/".join(map(str, sorted(set(frame[name])))) for name in ("exit", "check"))
    entries, middle = frame["entries"].sum(), frame[["error", "worst", "half"]].median()
    inside = f"{100 * frame['inside'].sum() / entries:.0f}" if entries else "-"
    flags = Counter(flag for row in rows for flag in row["flags"]).most_common(3)
    text = "; ".join(flag for flag, _ in flags).replace("|", "/")
    return [condition.name, condition.wanted, words, codes, inside,
            f"{middle['error']:.2g}, {middle['worst']:.2g}", f"{middle['half']:.2g}", text]  # fmt: skip


def campaigns(paths: list[Path], asked: argparse.Namespace) -> Iterator[tuple[Condition, list[list[dict[str, Any]]]]]:
    """Outcomes of each condition, a list by checkout, as they come."""
    stored, guard, local = Rows(asked.rows, "condition", "seed", "checkout"), threading.Lock(), threading.local()

    def work(condition: Condition) -> tuple[Condition, list[list[dict[str, Any]]]]:
        if not hasattr(local, "checkouts"):
            local.checkouts = [Checkout(path) for path in paths]
        rows: list[list[dict[str, Any]]] = [[] for _ in paths]
        for seed in range(asked.first_seed, asked.first_seed + asked.seeds):
            for path, checkout, row in zip(paths, local.checkouts, rows):
                key = (condition.name, seed, str(path))
                if key not in stored.known:
                    result = {**outcome(condition, seed, checkout), "checkout": str(path)}
                    with guard:
                        stored.add(result)
                row.append(stored.known[key])
        return condition, rows

    with ThreadPoolExecutor(asked.jobs) as pool:
        chosen = [c for c in conditions() if any(word in c.name for word in asked.only.split("|"))]
        yield from pool.map(work, chosen)


def summary(path: Path, rows: list[dict[str, Any]]) -> str:
    """Sums over the battery."""
    words, seconds = Counter(row["word"] for row in rows), sum(row["seconds"] for row in rows)
    listed = ", ".join(f"{words[word]} {word}" for word in WORDS)
    return f"{path.name}: {len(rows)} campaigns: {listed}; {seconds:.0f} s of `identify`"


def main() -> None:
    """Run the battery."""
    parser = study_parser(__doc__)
    parser.add_argument("--only", default="", help="conditions whose names hold one of these words, separated by |")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first-seed", type=int, default=38_000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--checkout", type=Path, default=ROOT, help="whose packages run [default: this one]")
    parser.add_argument("--other", type=Path, help="a second checkout, side by side")
    parser.add_argument("--rows", type=Path, help="file of JSON lines that outcomes are added to and taken from")
    asked = parser.parse_args()
    paths = [path.resolve() for path in (asked.checkout, asked.other) if path]
    lines: list[list[str]] = []
    totals: list[list[dict[str, Any]]] = [[] for _ in paths]
    for condition, by_checkout in campaigns(paths, asked):
        for path, rows, total in zip(paths, by_checkout, totals):
            name, *entries = cells(condition, rows)
            lines.append([f"{name} ({path.name})" if asked.other else name, *entries])
            total += rows
            print(" | ".join(lines[-1]), flush=True)
    sums = ".\n".join(summary(path, total) for path, total in zip(paths, totals))
    print(sums)
    if asked.write:
        write_section("second-field", typed(), f"{sums}.\n\n{table(HEAD, lines)}")


if __name__ == "__main__":
    main()
