"""The second field battery: conditions x seeds through `identify` and `check`.

    python -P -m tests.studies.field.battery [--only WORDS] [--seeds N] [--first-seed N] [--rows FILE] [--write]

Of good data (wanted: right) the word is *right*, *alarm* (refused, or an error of `check`), *wide* (an interval or an
error beyond the condition's bound) or *silent*; of bad data *reported*, *right* (the interval allows for the fault),
*wide* (by half of |h_ii| or more) or *silent*. Silent: exit code 0, and a direct coefficient further off than chance
has it in one campaign of 200. *Crash*: an exit code but 0, 2, 3. Errors and half-widths are in % of |h_ii|.
"""

import re
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from scipy.stats import norm

from tests.command_line import tpjb
from tests.rigs.acquisition import Array, Campaign, write_campaign
from tests.studies.field.conditions import Condition, conditions
from tests.studies.results import Rows, report, study_parser, table

WORDS = ("right", "reported", "silent", "alarm", "wide", "crash")
HEAD = ("condition", "wanted", "became", "exit, check", "inside %", "error %, worst", "half-width %", "flags")
ENTRIES = ("xx", "xy", "yx", "yy")


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


def outcome(condition: Condition, seed: int) -> dict[str, Any]:
    """One campaign through `identify` and `check`."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        campaign, setup = condition.make(seed)
        path = write_campaign(folder, campaign, setup, [seed, crc32(condition.name.encode()), 1])
        began = time.process_time()
        runs = [tpjb("identify", path, "--out", folder / "i", "--workers", 1)]
        seconds = time.process_time() - began
        runs.append(tpjb("check", path, "--out", folder / "c"))
        result = figures(folder / "i", campaign)
    identified, checked = (run.exit_code for run in runs)
    texts = [run.output for run in runs]
    flags = [f"{flag} x{n}" for flag, n in Counter(result.flags).most_common(5)]
    errors = re.findall(r"^(?:tpjb: )?error: (.{0,110})", texts[0], re.MULTILINE)
    refused = [line.strip()[:110] for line in texts[0].partition("not to be trusted:")[2].splitlines()[1:3]]
    if checked and not identified:
        errors += ["check: " + text for text in re.findall(r"^(?:tpjb: )?error: (.{0,110})", texts[1], re.MULTILINE)]
    word = verdict(condition, identified, checked, result)
    if word == "crash":
        errors = [repr(run.exception)[:110] for run in runs if run.exit_code == 1]
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


def main() -> None:
    """Run the battery."""
    asked = study_parser(__doc__, only="", seeds=1, first_seed=38_000, rows=Path).parse_args()
    stored = Rows(asked.rows, "condition", "seed")
    lines, total = [], []
    for condition in conditions():
        if not any(word in condition.name for word in asked.only.split("|")):
            continue
        rows = []
        for seed in range(asked.first_seed, asked.first_seed + asked.seeds):
            if (condition.name, seed) not in stored.known:
                stored.add(outcome(condition, seed))
            rows.append(stored.known[condition.name, seed])
        lines.append(cells(condition, rows))
        total += rows
        print(" | ".join(lines[-1]), flush=True)
    words, seconds = Counter(row["word"] for row in total), sum(row["seconds"] for row in total)
    listed = ", ".join(f"{words[word]} {word}" for word in WORDS)
    sums = f"{len(total)} campaigns: {listed}; {seconds:.0f} s of `identify`"
    report(asked, "second-field", f"{sums}.\n\n{table(HEAD, lines)}")


if __name__ == "__main__":
    main()
