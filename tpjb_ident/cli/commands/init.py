"""`tpjb init`: survey a folder of exports and draft its manifest."""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import model
from tpjb_ident.cli.command import Command, command
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.survey.exports import Export
    from rigdata.survey.survey import Survey

MANIFEST = "campaign.toml"
#: What a draft of the bearing is called, and its text in the model's package.
BEARING, DRAFT = "bearing.toml", "bearing_draft.toml"
#: Records that are listed; the manifest has all of them.
MOST_RECORDS = 20


@command("tpjb init exports", "tpjb init exports --bearing rocker.toml")
def init(c: Command, folder: Path, bearing: str | None = None, update: bool = False) -> None:
    """Draft the campaign.toml of a folder of exports.

    And its bearing.toml, where there is none. Channels, units, axes, rates and runs are read from the files or
    concluded from the records, with the figure; what remains a guess is marked (guess), what only the person at the
    rig can know ??. Records are only read. A campaign.toml that is there already stays as it is; with --update it is
    carried on: what you typed stays, open places and guesses are made anew, new records become runs.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder}: is no folder. Give the folder that holds the records.")
    c.target = c.out or folder
    bearing = bearing or _bearing_file(folder)
    text = (_update if update else _draft)(c, folder, bearing)
    if _open_summary(text):
        c.next("init", folder, "--update")
    else:
        c.next("check", folder)


def _draft(c: Command, folder: Path, bearing: str | None) -> str:
    from rigdata.survey.draft import draft_manifest
    from rigdata.survey.survey import survey

    manifest = c.target / MANIFEST
    if manifest.exists():
        raise BadInputError(
            f"{manifest}: is there already and stays as it is. Give --update to carry it on, another --out, "
            "or move the file away."
        )
    exports, problems = _read_exports(c, folder, ())
    name = re.sub(r"[^\w.+=@-]+", "-", folder.resolve().name) or "campaign"
    guesses = survey(exports, pivots=_pivot_angles(folder, bearing))
    text = draft_manifest(guesses, name, bearing or BEARING)
    c.target.mkdir(parents=True, exist_ok=True)
    _write(c, MANIFEST, text)
    c.print(_verdict(manifest, guesses, text))
    _show_survey(c, guesses, folder.name)
    for problem in problems:
        c.warn(f"left out: {problem}")
    if bearing is None and not (c.target / BEARING).exists():
        _write(c, BEARING, _bearing_draft(guesses))
        c.print(f"{c.target / BEARING}: to be filled in from drawing and data sheet; `identify` needs none.")
    return text


def _update(c: Command, folder: Path, bearing: str | None) -> str:
    from rigdata.survey.draft import column_names, updated_manifest

    manifest = c.target / MANIFEST
    if not manifest.is_file():
        raise BadInputError(f"{manifest}: is not there, so there is nothing to carry on. Leave --update out.")
    before = manifest.read_text("utf-8-sig")
    exports, problems = _read_exports(c, folder, column_names(before))
    text, changes = updated_manifest(before, exports, _pivot_angles(folder, bearing))
    count = "nothing to change"
    if text.split() != before.split():
        count = f"{len(changes)} changes, the former one is {manifest.name}.bak"
        write_text(manifest.with_suffix(".toml.bak"), before)
        _write(c, MANIFEST, text)
    c.print(f"{manifest}: {count}; {_open_summary(text) or 'no place is open'}.")
    for problem in problems:
        c.warn(f"left out: {problem}")
    for change in changes:
        c.print(change)
    return text


def _write(c: Command, name: str, text: str) -> None:
    write_text(c.target / name, text)
    c.wrote(name)


def _verdict(manifest: Path, guesses: Survey, text: str) -> str:
    """What was found, and what is open, in one sentence each."""
    kinds = Counter(run.kind.value or "unknown" for run in guesses.runs)
    runs = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    guessed = sum("(guess)" in line for line in text.splitlines()) - 1  # the head explains the mark
    return (
        f"{manifest}: {len(guesses.channels)} channels, {len(guesses.runs)} records ({runs}); "
        f"{_open_summary(text) or 'no place is open'}; {guessed} marked (guess)."
    )


def _open_summary(text: str) -> str:
    from rigdata.manifest.fields import open_paths, open_summary

    return open_summary(open_paths(tomllib.loads(text)))


def _read_exports(c: Command, folder: Path, names: Sequence[str]) -> tuple[list[Export], list[str]]:
    """Read all records of a folder; what is wrong with those that cannot be read."""
    from rigdata.problem import Problem
    from rigdata.survey.exports import read_exports, record_files

    problems: list[Problem] = []
    exports: list[Export] = []
    with c.progress(f"looking at {folder.name}") as show:
        total = len(record_files(folder))
        for export in read_exports(folder, problems, names):
            exports.append(export)
            show(export.name, len(exports), total)
    if not exports:
        raise BadInputError("\n".join(str(p) for p in problems[:5]))
    return exports, [str(p) for p in problems]


def _pivot_angles(folder: Path, bearing: str | None) -> list[float]:
    """Angles of the pads [rad] by the bearing file; none where it cannot be read yet."""
    from model.bearing import BearingError
    from model.bearing_file import load_bearing

    path = folder / (bearing or BEARING)
    try:
        return [pad.pivot_angle for pad in load_bearing(path).pads] if path.is_file() else []
    except BearingError:
        return []


def _bearing_draft(guesses: Survey) -> str:
    """Text of a bearing file with every entry explained; the pads' angles where dry load steps tell them."""
    text = (Path(model.__file__).parent / DRAFT).read_text("utf-8")
    dry = [run for run in guesses.runs if run.kind.value == "dry_pivot" and run.pad.value]
    steps = {run.pad.value: run.direction.number for run in dry}
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
    """Print what the channels and the files may be, and by what."""
    channels = []
    for channel, guess in guesses.channels.items():
        axis = "" if guess.axis.value is None else f"{guess.axis.number:g}"
        reason = " ".join([f"({guess.axis.source})" * bool(axis), guess.axis.reason])
        channels.append([channel, guess.quantity.value or "?", guess.unit or "?", axis, reason.strip()])
    c.show(f"{name}: channels", words("channel", "quantity", "unit", "axis", "axis by"), channels)
    runs = []
    for rate, run in zip(guesses.rates, guesses.runs[:MOST_RECORDS], strict=False):
        oscillates = run.kind.value in ("dynamic", "locus")
        lines = ", ".join(f"{line.frequency:.4g}" for line in run.lines[:3] if oscillates) or "-"
        runs.append([run.file, run.kind.value or "?", rate if rate > 0 else "?", lines, run.kind.reason])
    columns = [*words("file", "kind"), "rate {frequency}", *words("lines Hz", "kind by")]
    c.show(f"{name}: records", columns, runs)
    if len(guesses.runs) > len(runs):
        c.print(f"... and {len(guesses.runs) - len(runs)} more records")
