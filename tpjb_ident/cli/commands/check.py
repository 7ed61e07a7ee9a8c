"""`tpjb check`: read everything, report every problem."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.command import Command, campaign_place, command
from tpjb_ident.cli.options import DEMO
from tpjb_ident.columns import Column, words
from tpjb_ident.conditions import SEVERITIES
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted, listed

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.problem import Problem
    from rigdata.run import Run

#: Kinds of run in the order of the summary.
KINDS = ("dynamic", "locus", "clearance", "dry_pivot")
#: From as many problems of one sort on they are counted, not listed.
ALIKE = 4


def span(*values: float) -> str:
    """Range of finite values."""
    finite = [v for v in values if math.isfinite(v)]
    if not finite:
        return "-"
    low, high = min(finite), max(finite)
    return f"{low:.4g}" if low == high else f"{low:.4g}..{high:.4g}"


RANGES = ("rate {frequency}", "load {load}", "direction {angle}", "speed {frequency}", "excitation {frequency}")


@command(f"tpjb check {DEMO}", f"tpjb check {DEMO} --json > findings.json")
def check(c: Command, campaign: Path) -> None:
    """Report every problem of a campaign, not just the first.

    Reads all records. Writes check.json. Exit code 2 if there is an error that makes a run unusable.
    """
    from rigdata import RigDataError
    from tpjb_ident.check.campaign import check_campaign

    if not campaign.exists():
        raise BadInputError(f"{campaign}: no such file or folder. Give a campaign folder or an HDF5 file.")
    c.options["campaign"] = path = campaign_place(campaign)
    source = None
    with c.progress(f"reading {path.name}") as show:
        problems = check_campaign(path, lambda done, total: show("runs", done, total))
        try:
            source = c.open(path)
        except RigDataError:  # what it says is among the problems already
            pass
        else:
            problems = sorted(
                [*problems, *_drawing_problems(c, source, problems)], key=lambda p: SEVERITIES.index(p.severity)
            )
    summary = check_summary(c, source.id if source else path.name, problems, source)
    with c.results():
        c.json("check.json", summary)
    counts = summary["counts"]
    c.print(f"{summary['campaign']}: {', '.join(counted(counts[severity], severity) for severity in SEVERITIES)}")
    for line in problem_lines(problems):
        c.print(line)
    if source is not None:
        _show_coverage(c, source)
    if any("open (??)" in p.what for p in problems):
        c.next("init", path if path.is_dir() else path.parent, "--update")
    else:
        dynamic = source is not None and source.of_kind("dynamic")
        c.next("check" if counts["error"] else "identify" if dynamic else "pivot", campaign)
    if not summary["ok"]:
        raise BadInputError(
            f"{path}: {counted(counts['error'], 'error')}, listed above and in {c.target / 'check.json'}: to be mended."
        )


def check_summary(c: Command, name: str, problems: Sequence[Problem], campaign: Campaign | None) -> dict[str, Any]:
    """Gather the content of check.json; without a campaign, where it could not even be opened."""
    counts = {severity: sum(p.severity == severity for p in problems) for severity in SEVERITIES}
    keys = ("severity", "file", "place", "run", "what", "cure")
    return {
        "schema": "tpjb-check/1",
        "campaign": name,
        "ok": not counts["error"],
        "runs": {kind: len(campaign.of_kind(kind)) for kind in KINDS} if campaign else {},
        "counts": counts,
        "problems": [{key: getattr(p, key) for key in keys} for p in problems],
        "files_sha256": c.inputs,
    }


def problem_lines(problems: Sequence[Problem]) -> list[str]:
    """One line per problem; what is the same but for its numbers in many runs is printed once, with their count."""
    groups: dict[tuple[str, ...], list[Problem]] = {}
    for p in problems:
        pattern = re.sub(r"[-+]?\d[\d.e+-]*", "#", p.what)
        groups.setdefault((p.severity, pattern, p.place if p.severity == "error" else ""), []).append(p)
    lines = []
    for group in groups.values():
        severity = group[0].severity
        if severity == "error" or len(group) < ALIKE:
            lines += [f"{severity}: {p}" for p in group]
            continue
        runs = list(dict.fromkeys(p.run or p.file for p in group[1:]))
        times = f"{len(group) - 1} more times: {listed(runs, 3)}; see check.json"
        lines.append(f"{severity}: {group[0]} (the like {times})")
    return lines


def _drawing_problems(c: Command, campaign: Campaign, problems: list[Problem]) -> list[Problem]:
    """What the clearance sweeps say of the probes, where the campaign carries its bearing."""
    if not campaign.bearing_text or not campaign.of_kind("clearance"):
        return []
    from model.bearing import BearingError
    from rigdata.problem import Problem
    from tpjb_ident.compare.static_tests import bearing_problems

    try:
        return bearing_problems(campaign, c.bearing_of(campaign), problems)
    except BearingError as error:
        what = str(error).partition("\n")[0]
        return [Problem("warning", campaign.bearing_name, "", what, "Mend it, or give --bearing where one is needed")]


def _show_coverage(c: Command, campaign: Campaign) -> None:
    """Print what the campaign holds: runs, points, rates and the range that they cover."""
    rows = []
    for kind in KINDS:
        runs = campaign.of_kind(kind)
        if not runs:
            continue
        points = [run.point for run in runs]
        places = len({run.pad for run in runs}) if kind == "dry_pivot" else len({p.key for p in points})
        ranges = [
            [_rate(run) for run in runs],
            [p.static_load for p in points],
            [p.static_load_direction_deg for p in points],
            [p.shaft_speed_hz for p in points],
            [p.excitation_hz for p in points if p.excitation],
        ]
        rows.append([kind, str(len(runs)), str(places), *ranges])
    columns = [*words("kind"), "runs", "points, pads", *(Column(title, span) for title in RANGES)]
    c.show(f"{campaign.id}: what it covers", columns, rows)


def _rate(run: Run) -> float:
    """Sample rate [Hz]; NaN where the record cannot be read, which is among the problems already."""
    from rigdata import RigDataError

    try:
        return run.sample_rate
    except RigDataError:
        return math.nan
