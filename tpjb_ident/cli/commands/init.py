"""`tpjb init`: look at a folder of exports and draft its manifest."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.output import command_output
from tpjb_ident.cli.common.terminal import note_line, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.survey.draft import Survey

MANIFEST = "campaign.toml"
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the records of a logger.")]
Bearing = Annotated[
    str | None, typer.Option("--bearing", metavar="NAME", help="Bearing file in that folder [default: looked for].")
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder for the draft [default: beside the records].")
]


@guarded
def init(folder: Folder, bearing: Bearing = None, out: Out = None) -> None:
    """Look at a folder of exports and draft its campaign.toml.

    Channels, units, rates and kinds of run are guessed from names and signals; what only the person at the rig can
    know is marked ??. Records are only read, and a campaign.toml that is there already is never replaced.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that holds the records.")
    target = out if out is not None else folder
    if (target / MANIFEST).exists():
        raise BadInputError(
            f"{target / MANIFEST}: is there already and stays as it is. Give another --out, or move the file away."
        )
    from rigdata.problem import Problem
    from rigdata.survey.draft import MARK, draft_manifest, survey
    from rigdata.survey.exports import Export, read_exports, record_files

    problems: list[Problem] = []
    exports: list[Export] = []
    with progress(f"looking at {folder.name}") as show:
        total = len(record_files(folder))
        for export in read_exports(folder, problems):
            exports.append(export)
            show(export.name, len(exports), total)
        if not exports:
            raise BadInputError("\n".join(str(p) for p in problems[:5]))
        found = survey(exports)
    name = re.sub(r"[^\w.+=@-]+", "-", folder.resolve().name) or "campaign"
    text = draft_manifest(found, name, bearing or bearing_file(folder))
    target.mkdir(parents=True, exist_ok=True)
    write_text(target / MANIFEST, text)
    command_output().add_files(target, (MANIFEST,))
    show_survey(found, folder.name)
    for problem in problems:
        note_line("warning", f"left out: {problem}")
    marks = sum(MARK in line.partition("#")[0] for line in text.splitlines())
    print_line(f"{target / MANIFEST}: {marks} places are marked {MARK}; only you can fill them in.")
    print_line(f"Then: tpjb check {folder}")


def bearing_file(folder: Path) -> str | None:
    """Name of the one bearing file in a folder; None if there is none, or several.

    Parameters
    ----------
    folder : Path
        Looked through, without what is below it.
    """
    found = [
        p.name for p in sorted(folder.glob("*.toml")) if "tpjb-bearing/1" in p.read_text("utf-8", "replace")[:4000]
    ]
    return found[0] if len(found) == 1 else None


def show_survey(found: Survey, name: str) -> None:
    """Print what the channels and the files may be.

    Parameters
    ----------
    found : Survey
        Of the folder's records.
    name : str
        Of the folder.
    """
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
