"""`tpjb init`: survey a folder of exports and draft its manifest."""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import model
from tpjb_ident.cli.command import Command, command
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.survey.exports import Export
    from rigdata.survey.survey import Survey

MANIFEST = "campaign.toml"
#: What a draft of the bearing is called, and its text in the model's package.
BEARING, DRAFT = "bearing.toml", "bearing_draft.toml"


@command("tpjb init exports", "tpjb init exports --bearing rocker.toml")
def init(c: Command, folder: Path, bearing: str | None = None, update: bool = False) -> None:
    """Draft the campaign.toml of a folder of exports.

    And its bearing.toml, where there is none. Channels, units, axes, rates and runs are read from the files or
    concluded from the records, with the figure; what remains a guess is marked (guess), what only the person at the
    rig can know ??. Records are only read. A campaign.toml that is there already stays as it is; with --update it is
    carried on: what you typed stays, open places and guesses are made anew, new records become runs.
    """
    from model.bearing import BearingError
    from model.bearing_file import load_bearing
    from rigdata.manifest.fields import MARK, open_paths, open_summary
    from rigdata.survey.draft import column_names, updated_manifest

    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that holds the records.")
    c.target = c.out or folder
    manifest = c.target / MANIFEST
    if update and not manifest.is_file():
        raise BadInputError(f"{manifest}: is not there, so there is nothing to carry on. Leave --update out.")
    if manifest.exists() and not update:
        raise BadInputError(
            f"{manifest}: is there already and stays as it is. Give --update to carry it on, another --out, "
            "or move the file away."
        )
    before = manifest.read_text("utf-8-sig") if update else ""
    drawings = [p for p in sorted(folder.glob("*.toml")) if "tpjb-bearing/1" in p.read_text("utf-8", "replace")[:4000]]
    bearing = bearing or (drawings[0].name if len(drawings) == 1 else None)
    exports, problems = _read_exports(c, folder, column_names(before))
    drawing = (folder if bearing else c.target) / (bearing or BEARING)
    angles: tuple[float, ...] = ()
    with suppress(BearingError):  # it cannot be read yet
        angles = load_bearing(drawing).pivot_angles if drawing.is_file() else ()
    if update:
        text, changes = updated_manifest(before, exports, angles)
        channels: list[list[str]] = []
        count = f"{counted(len(changes), 'value')} changed, remarks renewed, the former file is {MANIFEST}.bak"
    else:
        text, count, channels = _draft(c, folder, bearing, exports, angles)
        changes = []
    if text.split() == before.split():
        count = "nothing to change"
    else:
        _write(c, MANIFEST, text, before)
    open_places = open_summary(open_paths(tomllib.loads(text)))
    undrawn = drawing.read_text("utf-8", "replace").count(f'"{MARK}') if drawing.is_file() else 0
    remark = f"; {drawing.name}: {counted(undrawn, 'place')} open ({MARK})" if undrawn else ""
    c.print(f"{manifest}: {count}; {open_places or 'no place is open'}{remark}.")
    if channels:
        c.show(f"{folder.name}: channels", words("channel", "quantity", "unit", "axis", "axis by"), channels)
    for problem in problems:
        c.warn(f"left out: {problem}")
    for change in changes:
        c.print(change)
    if open_places:
        c.print("First fill in what is open (??), and look at what is marked (guess).")
    c.next(*(("init", folder, "--update") if open_places else ("check", folder)))


def _draft(
    c: Command, folder: Path, bearing: str | None, exports: Sequence[Export], angles: Sequence[float]
) -> tuple[str, str, list[list[str]]]:
    """Text of a new manifest, what was found, and channel by channel; the bearing's draft is written beside it."""
    from rigdata.survey.draft import draft_manifest
    from rigdata.survey.survey import survey

    guesses = survey(exports, pivots=angles)
    name = re.sub(r"[^\w.+=@-]+", "-", folder.resolve().name) or "campaign"
    text = draft_manifest(guesses, name, bearing or BEARING)
    rows = []
    for channel, guess in guesses.channels.items():
        axis = "" if guess.axis.value is None else f"{guess.axis.number:g}"
        source = f"({guess.axis.source}) " * bool(axis)
        rows.append([channel, guess.quantity.value or "?", guess.unit or "?", axis, source + guess.axis.reason])
    if bearing is None and not (c.target / BEARING).exists():
        _write(c, BEARING, _bearing_draft(guesses))
    kinds = Counter(run.kind.value or "unknown" for run in guesses.runs)
    runs = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    summary = f"{len(rows)} channels, {len(guesses.runs)} records ({runs})"
    return text, f"{summary}, {text.count('(guess)') - 1} entries marked (guess)", rows  # the head explains the mark


def _write(c: Command, name: str, text: str, before: str = "") -> None:
    """Write a file of the draft; what it was before is beside it."""
    c.target.mkdir(parents=True, exist_ok=True)
    if before:
        write_text(c.target / f"{name}.bak", before)
    write_text(c.target / name, text)
    c.wrote(name)


def _read_exports(c: Command, folder: Path, names: Sequence[str]) -> tuple[list[Export], list[str]]:
    """Read all records of a folder; what is wrong with those that cannot be read."""
    from rigdata.problem import Problem
    from rigdata.survey.exports import read_exports, record_files

    problems: list[Problem] = []
    exports, columns = [], Counter[str]()
    with c.progress(f"looking at {folder.name}") as show:
        total = len(record_files(folder))
        for export in read_exports(folder, problems, names):
            exports.append(export)
            columns.update(series.name for series in export.series)
            show(export.name, len(exports), total)
    if not exports:
        raise BadInputError("\n".join(map(str, problems[:5])))
    if max(columns.values(), default=0) < len(exports):
        c.warn("no channel is in all files. Where two devices wrote a file each, join the two of a run in one first")
    return exports, [str(problem) for problem in problems]


def _bearing_draft(guesses: Survey) -> str:
    """Text of a bearing file with every entry explained; the pads' angles where dry load steps tell them."""
    text = (Path(model.__file__).parent / DRAFT).read_text("utf-8")
    dry = [run for run in guesses.runs if run.kind.value == "dry_pivot" and run.pad.value]
    steps = {run.pad.value: run.direction.number for run in dry}
    pads = list(range(1, len(steps) + 1))
    if len(pads) > 1 and sorted(steps) == pads and all(map(math.isfinite, steps.values())):
        angles = ", ".join(f'"{steps[pad]:g} deg"' for pad in pads)
        text = text.replace('["?? deg"]          #', f"[{angles}]\n# (guess) where the dry steps pull;")
    return text
