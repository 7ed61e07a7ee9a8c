"""`tpjb init`: look at a folder of exports and draft its manifest."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import model
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.output import command_output
from tpjb_ident.cli.common.terminal import command_line, note_line, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.problem import Problem
    from rigdata.survey.draft import Survey
    from rigdata.survey.exports import Export

MANIFEST = "campaign.toml"
#: What a draft of the bearing is called, and where its text lies in the model's package.
BEARING, DRAFT = "bearing.toml", "bearing_draft.toml"
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the records of a logger.")]
Bearing = Annotated[
    str | None, typer.Option("--bearing", metavar="NAME", help="Bearing file in that folder [default: looked for].")
]
Update = Annotated[
    bool, typer.Option("--update", help="Carry on a campaign.toml that was edited: new records, guesses made anew.")
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for the draft [default: beside the records].")
]


@guarded
def init(folder: Folder, bearing: Bearing = None, update: Update = False, out: Out = None) -> None:
    """Draft the campaign.toml of a folder of exports.

    And its bearing.toml, where there is none. Channels, units, rates and kinds of run are guessed from names and
    signals; what only the person at the rig can know is marked ??. Records are only read. A campaign.toml that is there
    already stays as it is; with --update it is carried on: what you changed stays, open places and guesses are made
    anew, new records become runs.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that holds the records.")
    target = out if out is not None else folder
    if update:
        _update(folder, target)
        return
    if (target / MANIFEST).exists():
        raise BadInputError(
            f"{target / MANIFEST}: is there already and stays as it is. Give --update to carry it on, another --out, "
            "or move the file away."
        )
    from rigdata.survey.draft import draft_manifest, survey

    exports, problems = looked_at(folder, ())
    found = survey(exports)
    name = re.sub(r"[^\w.+=@-]+", "-", folder.resolve().name) or "campaign"
    given = bearing or bearing_file(folder)
    text = draft_manifest(found, name, given or BEARING)
    target.mkdir(parents=True, exist_ok=True)
    write_text(target / MANIFEST, text)
    command_output().add_files(target, (MANIFEST,))
    _show_survey(found, folder.name)
    for problem in problems:
        note_line("warning", f"left out: {problem}")
    print_line(f"{target / MANIFEST}: {_marks(text)} lines are marked ??; only you can fill them in.")
    if given is None and not (target / BEARING).exists():
        draft = _bearing_draft(found)
        write_text(target / BEARING, draft)
        command_output().add_files(target, (BEARING,))
        print_line(f"{target / BEARING}: {_marks(draft)} more, from drawing and data sheet; `identify` needs none.")
    command_line(f"tpjb check {folder}")


def _update(folder: Path, target: Path) -> None:
    from rigdata.survey.update import column_names, updated_manifest

    place = target / MANIFEST
    if not place.is_file():
        raise BadInputError(f"{place}: is not there, so there is nothing to carry on. Leave --update out.")
    before = place.read_text("utf-8-sig")
    exports, problems = looked_at(folder, column_names(before))
    text, changes = updated_manifest(before, exports)
    for problem in problems:
        note_line("warning", f"left out: {problem}")
    for change in changes:
        print_line(change)
    if text.split() != before.split():
        write_text(place.with_suffix(".toml.bak"), before)
        write_text(place, text)
        command_output().add_files(target, (MANIFEST,))
        print_line(f"{place}: {len(changes)} changes (before: {place.name}.bak), {_marks(text)} lines are marked ??.")
    else:
        print_line(f"{place}: nothing to change, {_marks(text)} lines are marked ??.")
    command_line(f"tpjb check {folder}")


def _marks(text: str) -> int:
    return sum("??" in line.partition("#")[0] for line in text.splitlines())


def looked_at(folder: Path, names: Sequence[str]) -> tuple[list[Export], list[Problem]]:
    """Read all records of a folder; what is wrong with those that cannot be read."""
    from rigdata.survey.exports import read_exports, record_files
    from rigdata.survey.update import renamed

    problems: list[Problem] = []
    exports: list[Export] = []
    with progress(f"looking at {folder.name}") as show:
        total = len(record_files(folder))
        for export in read_exports(folder, problems):
            exports.append(renamed(export, names) if names and export.nameless else export)
            show(export.name, len(exports), total)
    if not exports:
        raise BadInputError("\n".join(str(p) for p in problems[:5]))
    return exports, problems


def _bearing_draft(found: Survey) -> str:
    """Text of a bearing file with every entry explained; the pads' angles where dry load steps tell them."""
    text = (Path(model.__file__).parent / DRAFT).read_text("utf-8")
    steps = {run.pad: run.direction for run in found.runs if run.kind == "dry_pivot" and run.pad}
    count = len(steps)
    if count > 1 and sorted(steps) == list(range(1, count + 1)) and all(math.isfinite(a) for a in steps.values()):
        angles = ", ".join(f'"{steps[pad]:g} deg"' for pad in sorted(steps))
        text = text.replace('["?? deg"]          #', f"[{angles}]\n# (guess) where the dry steps pull;")
    return text


def bearing_file(folder: Path) -> str | None:
    """Name of the one bearing file in a folder; None if there is none, or several."""
    found = [
        p.name for p in sorted(folder.glob("*.toml")) if "tpjb-bearing/1" in p.read_text("utf-8", "replace")[:4000]
    ]
    return found[0] if len(found) == 1 else None


def _show_survey(found: Survey, name: str) -> None:
    """Print what the channels and the files may be."""
    rows = [[n, g.quantity or "?", g.unit or "?", g.axis or "", g.why] for n, g in found.channels.items()]
    table(f"{name}: channels, guessed", ["channel", "quantity", "unit", "axis", "why"], rows, words=range(5))
    runs = [
        [export, run.kind or "?", f"{rate:g}" if rate > 0 else "?",
         ", ".join(f"{x.frequency:.4g}" for x in run.lines[:3]) or "-", run.why]
        for export, rate, run in zip(found.exports[:20], found.rates, found.runs, strict=False)
    ]  # fmt: skip
    table(f"{name}: records, guessed", ["file", "kind", "rate Hz", "lines Hz", "why"], runs, words=(0, 1, 3, 4))
    if len(found.exports) > len(runs):
        print_line(f"... and {len(found.exports) - len(runs)} more records")
