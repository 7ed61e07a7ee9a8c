"""Exports of six laboratories, each from its files to the coefficients by the README and the guide alone.

    python -m tests.rigs.laboratories [--docs]

Every folder holds the records of `strange_exports` and the bearing's file, nothing else. What a person types is here:
commands, and lines of the drafted manifest. Printed: lines edited by hand, messages, seconds that the commands took,
largest difference of a direct coefficient from the numbers that the rig was made of; ``--docs`` puts the table into
the tutorial.
"""

import difflib
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from tests.command_line import ended
from tests.rigs.strange_exports import LABORATORIES, Laboratory, damping, stiffness, write_exports

ROOT = Path(__file__).resolve().parents[2]
BEARING = ROOT / "model" / "bearings" / "rocker.toml"
PAGE = ROOT / "docs" / "guide" / "tutorial.md"
BEGIN, END = "<!-- laboratories: begin -->\n", "<!-- laboratories: end -->"
HEAD = "| export | lines typed | marked (guess) | messages | seconds | worst K | worst C |\n"
HEAD += "|---" * HEAD.count(" | ") + "|---|\n"
#: What a person fills in: (channel or table, key) -> value; the mark of comment before the key goes.
Edits = Mapping[tuple[str, str], str]


def fill_in(text: str, edits: Edits) -> str:
    """The manifest as a person leaves it: values at the marks, a comment sign taken off, lines added."""
    for (table, key), value in edits.items():
        header = re.compile(rf'^\[(?:channels\.)?"?{re.escape(table)}"?\]$', re.MULTILINE)
        start = header.search(text)
        assert start, f"no table {table} in the draft"
        end = text.find("\n[", start.end())
        block = text[start.start() : end]
        line = f"{key} = {value}" if value == "-1" else f'{key} = "{value}"'
        new, count = re.subn(rf"^(?:# )?{key} = .*$", lambda _, put=line: put, block, flags=re.MULTILINE)
        new = new if count else f"{block.rstrip()}\n{line}\n"
        text = text[: start.start()] + new + text[end:]
    return text


def edited_lines(before: str, after: str) -> int:
    """Lines that were typed: new ones and changed ones."""
    lines = difflib.ndiff(before.splitlines(), after.splitlines())
    return sum(line.startswith("+ ") for line in lines)


def through(laboratory: Laboratory, folder: Path, last: str = "identify") -> dict[str, float]:
    """One laboratory's way from its records to its results, and how it went; every command has to end well."""
    records, out = folder / "records", folder / "out"
    write_exports(records, laboratory)
    shutil.copy(BEARING, records)
    messages, lines, guesses, began = 0, 0, 0, time.perf_counter()
    for command in (("init",), ("init", "--update"), ("check",), (last,)):
        name, *options = command
        done = ended(0, name, records, *options, *(() if name == "init" else ("--out", out)))
        said = done.stdout + done.stderr
        messages += len(re.findall(r"^(?:tpjb: )?(?:error|warning|note): ", said, re.MULTILINE))
        if command == ("init",):
            manifest = records / "campaign.toml"
            before = manifest.read_text("utf-8")
            manifest.write_text(fill_in(before, laboratory.edits), "utf-8")
            lines = edited_lines(before, manifest.read_text("utf-8"))
            guesses = sum("(guess)" in line for line in before.splitlines()[3:])
    worst = worst_errors(out / "coefficients.csv") if (out / "coefficients.csv").exists() else {}
    seconds = time.perf_counter() - began
    return {"lines": lines, "guesses": guesses, "messages": messages, "seconds": seconds, **worst}


def worst_errors(table: Path) -> dict[str, float]:
    """Largest differences of direct stiffness and damping from the rig's own numbers, in per cent."""
    errors: dict[str, list[float]] = {"K": [], "C": []}
    for row in pd.read_csv(table).to_dict("records"):
        k, c = stiffness(row["static_load_N"]), damping(row["static_load_N"])
        for i, entry in enumerate(("xx", "yy")):
            errors["K"].append(abs(row[f"k{entry}_N_per_m"] / k[i, i] - 1.0))
            errors["C"].append(abs(row[f"c{entry}_Ns_per_m"] / c[i, i] - 1.0))
    return {entry: 100.0 * float(np.max(values)) for entry, values in errors.items()}


def main(folder: Path, docs: bool) -> None:
    """Print the table of all laboratories, and put it into the tutorial with `docs`."""
    rows = []
    for number, laboratory in enumerate(LABORATORIES):
        way = through(laboratory, folder / str(number), last="compare")
        row = "| {name} | {lines} | {guesses} | {messages} | {seconds:.0f} | {K:.2f} % | {C:.2f} % |"
        rows.append(row.format(name=laboratory.name, **way))
        print(rows[-1], flush=True)
    if docs:
        before, rest = PAGE.read_text("utf-8").split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}{HEAD}" + "\n".join(rows) + f"\n{END}{rest.split(END)[1]}", "utf-8")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        main(Path(scratch), "--docs" in sys.argv)
