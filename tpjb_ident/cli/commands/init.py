"""`tpjb init`: survey a folder of exports and draft its manifest."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import model
from tpjb_ident.cli.common.command import Command, command
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.survey.draft import Survey
    from rigdata.survey.exports import Export

MANIFEST = "campaign.toml"
#: What a draft of the bearing is called, and its text in the model's package.
BEARING, DRAFT = "bearing.toml", "bearing_draft.toml"
#: Records that are listed; the manifest has all of them.
MOST_RECORDS = 20
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the records of a logger.")]
Bearing = Annotated[
    str | None, typer.Option("--bearing", metavar="NAME", help="Bearing file in that folder [default: looked for].")
]
Update = Annotated[
    bool, typer.Option("--update", help="Carry on a campaign.toml that was edited: new records, guesses made anew.")
]


@command(
    "tpjb init exports",
    "tpjb init exports --bearing rocker.toml",
    out_help="Folder for the draft [default: beside the records].",
)
def init(c: Command, folder: Folder, bearing: Bearing = None, update: Update = False) -> None:
    """Draft the campaign.toml of a folder of exports.

    And its bearing.toml, where there is none. Channels, units, rates and kinds of run are guessed from names and
    signals; what only the person at the rig can know is marked ??. Records are only read. A campaign.toml that is there
    already stays as it is; with --update it is carried on: what you changed stays, open places and guesses are made
    anew, new records become runs.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that holds the records.")
    c.target = c.out or folder
    if update:
        _update(c, folder)
    else:
        _draft(c, folder, bearing)
    c.next(f"tpjb check {folder}")


def _draft(c: Command, folder: Path, bearing: str | None) -> None:
    from rigdata.survey.draft import draft_manifest, survey

    manifest = c.target / MANIFEST
    if manifest.exists():
        raise BadInputError(
            f"{manifest}: is there already and stays as it is. Give --update to carry it on, another --out, "
            "or move the file away."
        )
    exports, problems = _read_exports(c, folder, ())
    guesses = survey(exports)
    name = re.sub(r"[^\w.+=@-]+", "-", folder.resolve().name) or "campaign"
    bearing = bearing or _bearing_file(folder)
    text = draft_manifest(guesses, name, bearing or BEARING)
    c.target.mkdir(parents=True, exist_ok=True)
    write_text(manifest, text)
    c.wrote(MANIFEST)
    _show_survey(c, guesses, folder.name)
    for problem in problems:
        c.warn(f"left out: {problem}")
    c.print(f"{manifest}: {_open_lines(text)} lines are marked ??; only you can fill them in.")
    draft = c.target / BEARING
    if bearing is None and not draft.exists():
        text = _bearing_draft(guesses)
        write_text(draft, text)
        c.wrote(BEARING)
        c.print(f"{draft}: {_open_lines(text)} more, from drawing and data sheet; `identify` needs none.")


def _update(c: Command, folder: Path) -> None:
    from rigdata.survey.update import column_names, updated_manifest

    manifest = c.target / MANIFEST
    if not manifest.is_file():
        raise BadInputError(f"{manifest}: is not there, so there is nothing to carry on. Leave --update out.")
    before = manifest.read_text("utf-8-sig")
    exports, problems = _read_exports(c, folder, column_names(before))
    text, changes = updated_manifest(before, exports)
    for problem in problems:
        c.warn(f"left out: {problem}")
    for change in changes:
        c.print(change)
    marks = f"{_open_lines(text)} lines are marked ??."
    if text.split() == before.split():
        c.print(f"{manifest}: nothing to change, {marks}")
        return
    backup = manifest.with_suffix(".toml.bak")
    write_text(backup, before)
    write_text(manifest, text)
    c.wrote(MANIFEST)
    c.print(f"{manifest}: {len(changes)} changes (before: {backup.name}), {marks}")


def _open_lines(text: str) -> int:
    return sum("??" in line.partition("#")[0] for line in text.splitlines())


def _read_exports(c: Command, folder: Path, names: Sequence[str]) -> tuple[list[Export], list[str]]:
    """Read all records of a folder; what is wrong with those that cannot be read."""
    from rigdata.problem import Problem
    from rigdata.survey.exports import read_exports, record_files
    from rigdata.survey.update import renamed

    problems: list[Problem] = []
    exports: list[Export] = []
    with c.progress(f"looking at {folder.name}") as show:
        total = len(record_files(folder))
        for export in read_exports(folder, problems):
            exports.append(renamed(export, names) if names and export.nameless else export)
            show(export.name, len(exports), total)
    if not exports:
        raise BadInputError("\n".join(str(p) for p in problems[:5]))
    return exports, [str(p) for p in problems]


def _bearing_draft(guesses: Survey) -> str:
    """Text of a bearing file with every entry explained; the pads' angles where dry load steps tell them."""
    text = (Path(model.__file__).parent / DRAFT).read_text("utf-8")
    steps = {run.pad: run.direction for run in guesses.runs if run.kind == "dry_pivot" and run.pad}
    pads = list(range(1, len(steps) + 1))
    if len(pads) > 1 and sorted(steps) == pads and all(math.isfinite(angle) for angle in steps.values()):
        angles = ", ".join(f'"{steps[pad]:g} deg"' for pad in pads)
        text = text.replace('["?? deg"]          #', f"[{angles}]\n# (guess) where the dry steps pull;")
    return text


def _bearing_file(folder: Path) -> str | None:
    """Name of the one bearing file in a folder; None if there is none, or several."""
    files = [p for p in sorted(folder.glob("*.toml")) if "tpjb-bearing/1" in p.read_text("utf-8", "replace")[:4000]]
    return files[0].name if len(files) == 1 else None


def _show_survey(c: Command, guesses: Survey, name: str) -> None:
    """Print what the channels and the files may be."""
    channels = [[n, g.quantity or "?", g.unit or "?", g.axis or "", g.why] for n, g in guesses.channels.items()]
    c.show(f"{name}: channels, guessed", words("channel", "quantity", "unit", "axis", "why"), channels)
    runs = []
    for rate, run in zip(guesses.rates, guesses.runs[:MOST_RECORDS], strict=False):
        lines = ", ".join(f"{line.frequency:.4g}" for line in run.lines[:3]) or "-"
        runs.append([run.file, run.kind or "?", rate if rate > 0 else "?", lines, run.why])
    columns = [*words("file", "kind"), "rate {frequency}", *words("lines Hz", "why")]
    c.show(f"{name}: records, guessed", columns, runs)
    if len(guesses.runs) > len(runs):
        c.print(f"... and {len(guesses.runs) - len(runs)} more records")
