"""`tpjb check`: read everything, report every problem."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import campaign_place, open_bearing
from tpjb_ident.cli.common.options import CampaignPath, Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.problem import Problem

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
    for problem in problems:
        print_line(f"{problem.severity}: {problem}")
    counts = summary["counts"]
    print_line(f"{summary['campaign']}: {counts['error']} errors, {counts['warning']} warnings, {counts['note']} notes")
    print_line(f"Results: {target}")
    if errors:
        raise BadInputError(
            f"{campaign}: {len(errors)} errors, listed above and in {target / 'check.json'}. Mend them."
        )


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
    from tpjb_ident.compare.bearing_checks import bearing_problems

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
