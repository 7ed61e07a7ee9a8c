"""`tpjb check`: read everything, report every problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigdata.problem import Problem, RigDataError, gathered
from tpjb_ident.cli.command import Command, command
from tpjb_ident.columns import Column, words
from tpjb_ident.conditions import SEVERITIES
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted

if TYPE_CHECKING:
    from rigdata.campaign import Campaign


def span(*values: float) -> str:
    """Range of finite values."""
    finite = sorted({f"{v:.4g}" for v in values if math.isfinite(v)}, key=float) or ["-"]
    return finite[0] if len(finite) == 1 else f"{finite[0]}..{finite[-1]}"


RANGES = ("rate {frequency}", "load {load}", "direction {angle}", "speed {speed}", "excitation {frequency}")


@command("tpjb check {DEMO}", "tpjb check {DEMO} --json > findings.json")
def check(c: Command, campaign: Path) -> None:
    """Report every problem of a campaign, not just the first.

    Reads all records. Writes check.json. Exit code 2 if there is an error that makes a run unusable.
    """
    from rigdata.campaign import campaign_place
    from tpjb_ident.check.campaign import check_campaign

    if not campaign.exists():
        raise BadInputError(f"{campaign}: no such file or folder. Give a campaign folder or an HDF5 file.")
    c.options["campaign"] = path = campaign_place(campaign)
    source = None
    with c.progress(f"reading {path.name}") as show:
        problems = check_campaign(path, lambda done, total: show("runs", done, total))
        with suppress(RigDataError):  # what it says is among the problems already
            source = c.open(path)
        if source is not None:
            problems += _drawing_problems(c, source, problems)
            problems.sort(key=lambda p: SEVERITIES.index(p.severity))
    summary = check_summary(c, source.id if source else path.name, problems, source)
    with c.results():
        c.json("check.json", summary)
    errors = summary["counts"]["error"]
    c.print(f"{summary['campaign']}: {', '.join(counted(n, severity) for severity, n in summary['counts'].items())}")
    for problem in gathered(problems):
        c.print(f"{problem.severity}: {problem}")
    if source is not None:
        rows = []
        for kind in dict.fromkeys(run.kind for run in source.runs):
            runs = source.of_kind(kind)
            places = {run.pad if kind == "dry_pivot" else run.point.key for run in runs}
            figures = []
            for run in runs:
                rate = math.nan
                with suppress(RigDataError):  # a record that cannot be read is among the problems already
                    rate = run.sample_rate
                figures.append((rate, *run.point.static_key[:3], run.point.excitation_hz or math.nan))
            rows.append([kind, len(runs), len(places), *zip(*figures, strict=True)])
        columns = [*words("kind"), "runs", "points, pads", *(Column(title, span) for title in RANGES)]
        c.show(f"{source.id}: what it covers", columns, rows)
    if any("open (??)" in p.what for p in problems):
        c.next("init", path if path.is_dir() else path.parent, "--update")
    elif path.is_dir() and not (path / "campaign.toml").exists():
        c.next("init", path)
    else:
        dynamic = source is not None and source.of_kind("dynamic")
        c.next("show" if errors and source else "check" if errors else "identify" if dynamic else "pivot", campaign)
    if errors:
        findings = c.target / "check.json"
        raise BadInputError(
            f"{path}: {counted(errors, 'error')}, told above and listed in {findings}. Mend them, then check again."
        )


def check_summary(c: Command, name: str, problems: Sequence[Problem], campaign: Campaign | None) -> dict[str, Any]:
    """Gather the content of check.json; without a campaign, where it could not even be opened."""
    from rigdata.manifest.fields import KINDS

    counts = dict.fromkeys(SEVERITIES, 0)
    for problem in problems:
        counts[problem.severity] += 1
    return {
        "schema": "tpjb-check/1",
        "campaign": name,
        "ok": not counts["error"],
        "runs": {kind: len(campaign.of_kind(kind)) for kind in KINDS} if campaign else {},
        "counts": counts,
        "problems": [asdict(problem) for problem in problems],
        "files_sha256": c.inputs,
    }


def _drawing_problems(c: Command, campaign: Campaign, problems: list[Problem]) -> list[Problem]:
    """What contradicts the drawing, where the campaign carries its bearing."""
    if not campaign.bearing_text:
        return []
    from model.bearing import BearingError
    from tpjb_ident.compare.static_tests import bearing_problems

    try:
        return bearing_problems(campaign, c.bearing_of(campaign), problems)
    except BearingError as error:
        file = campaign.bearing_name
        fault, _, remedy = str(error).partition("\n")[0].removeprefix(file).lstrip(",: ").partition(". ")
        cure = f"{remedy} Or give --bearing FILE where one is needed".strip()
        return [Problem("warning", file, "", fault.rstrip("."), cure)]
