"""`tpjb check`: read everything, report every problem."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import campaign_place, open_bearing
from tpjb_ident.cli.common.options import CampaignPath, Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.problem import Problem
    from rigdata.run import Run

#: Kinds of run in the order of the summary.
KINDS = ("dynamic", "locus", "clearance", "dry_pivot")
#: From as many problems of one sort on they are counted, not listed.
ALIKE = 4
SEVERITIES = ("error", "warning", "note")


@guarded
def check(campaign: CampaignPath, out: Out = None) -> None:
    """Report every problem of a campaign, not just the first.

    Reads all records. Writes check.json. Exit code 2 if there is an error that makes a run unusable.
    """
    from tpjb_ident.check.campaign import check_campaign

    if not campaign.exists():
        raise BadInputError(f"{campaign}: no such file or folder. Give a campaign folder or an HDF5 file.")
    campaign = campaign_place(campaign)
    with progress(f"reading {campaign.name}") as show:
        problems = check_campaign(campaign, lambda done, of: show("runs", done, of))
        opened = _opened(campaign)
        if opened is not None:
            more = _against_drawing(opened, problems)
            problems = sorted([*problems, *more], key=lambda p: SEVERITIES.index(p.severity))
    errors = [p for p in problems if p.severity == "error"]
    summary = check_summary(campaign, problems, opened)
    target = out_folder(out, "check")
    with output_folder(target, "check", (campaign,)) as folder:
        write_text(folder / "check.json", json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
        write_record(folder, target, "check", {"campaign": campaign}, summary.pop("files_sha256"))
    for sentence in gathered(problems):
        print_line(sentence)
    if opened is not None:
        _show_coverage(opened)
    counts = summary["counts"]
    print_line(f"{summary['campaign']}: {', '.join(counted(counts[s], s) for s in SEVERITIES)}")
    print_line(f"Results: {target}")
    if errors:
        raise BadInputError(
            f"{campaign}: {counted(len(errors), 'error')}, listed above and in {target / 'check.json'}: to be mended."
        )


def gathered(problems: Sequence[Problem]) -> list[str]:
    """One sentence per problem; what is the same but for its numbers in many runs is said once, with their count."""
    groups: dict[tuple[str, str, str], list[Problem]] = {}
    for p in problems:
        alike = re.sub(r"[-+]?\d[\d.e+-]*", "#", p.what)
        groups.setdefault((p.severity, alike, p.place if p.severity == "error" else ""), []).append(p)
    sentences = []
    for (severity, _, _), group in groups.items():
        if severity == "error" or len(group) < ALIKE:
            sentences += [f"{severity}: {p}" for p in group]
        else:
            runs = dict.fromkeys(p.run or p.file for p in group[1:])
            named = ", ".join(list(runs)[:3]) + (", ..." if len(runs) > 3 else "")
            sentences.append(f"{severity}: {group[0]} (the like {len(group) - 1} more times: {named}; see check.json)")
    return sentences


def _show_coverage(campaign: Campaign) -> None:
    """Print what the campaign holds: runs, points, rates and the range that they cover."""
    rows = []
    for kind in KINDS:
        runs = campaign.of_kind(kind)
        if runs:
            points = {(r.point.static_load, r.point.static_load_direction, r.point.shaft_speed, r.point.excitation)
                      for r in runs}  # fmt: skip
            at = [r.point for r in runs]
            rows.append([
                kind, str(len(runs)), str(len({r.pad for r in runs}) if kind == "dry_pivot" else len(points)),
                _range([_rate(r) for r in runs]), _range([p.static_load / 1e3 for p in at]),
                _range([p.static_load_direction_deg for p in at]), _range([p.shaft_speed_hz for p in at]),
                _range([p.excitation_hz for p in at if p.excitation]),
            ])  # fmt: skip
    columns = ["kind", "runs", "points, pads", "rate Hz", "load kN", "direction deg", "speed Hz", "excitation Hz"]
    table(f"{campaign.id}: what it covers", columns, rows, words=(0,))


def _rate(run: Run) -> float:
    """Sample rate [Hz]; NaN where the record cannot be read, which is among the problems already."""
    from rigdata import RigDataError

    try:
        return run.sample_rate
    except RigDataError:
        return math.nan


def _range(values: Sequence[float]) -> str:
    finite = [v for v in values if math.isfinite(v)]
    if not finite:
        return "-"
    low, high = min(finite), max(finite)
    return f"{low:g}" if low == high else f"{low:g}..{high:g}"


def _opened(path: Path) -> Campaign | None:
    from rigdata import RigDataError, load_campaign

    try:
        return load_campaign(path)
    except RigDataError:  # what it says is among the problems already
        return None


def _against_drawing(campaign: Campaign, known: list[Problem]) -> list[Problem]:
    """What the clearance sweeps say of the probes, where the campaign carries its bearing."""
    if not campaign.bearing_text or not campaign.of_kind("clearance"):
        return []
    from model.bearing import BearingError
    from rigdata.problem import Problem
    from tpjb_ident.compare.static_tests import bearing_problems

    try:
        return bearing_problems(campaign, open_bearing(campaign, None)[0], known)
    except BearingError as error:
        what = str(error).partition("\n")[0]
        return [Problem("warning", campaign.bearing_name, "", what, "Mend it, or give --bearing where one is needed")]


def check_summary(path: Path, problems: list[Problem], campaign: Campaign | None) -> dict[str, Any]:
    """Gather the content of check.json; without a campaign, where it could not even be opened."""
    kinds: dict[str, int] = {}
    files: dict[str, str] = {}
    if campaign is not None:
        kinds = {kind: len(campaign.of_kind(kind)) for kind in ("dynamic", "dry_pivot", "locus", "clearance")}
        files = campaign.fingerprint()
    return {
        "schema": "tpjb-check/1",
        "campaign": path.name if campaign is None else campaign.id,
        "ok": not any(p.severity == "error" for p in problems),
        "runs": kinds,
        "counts": {s: sum(p.severity == s for p in problems) for s in SEVERITIES},
        "problems": [
            {"severity": p.severity, "file": p.file, "place": p.place, "run": p.run, "what": p.what, "cure": p.cure}
            for p in problems
        ],
        "files_sha256": files,
    }
