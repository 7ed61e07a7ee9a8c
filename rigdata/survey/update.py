"""A manifest that was edited by hand, carried on: open places and guesses are filled in, what was typed stays."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rigdata.manifest.fields import MARK, open_paths
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError, refuse
from rigdata.survey.draft import channel_blocks, run_lines
from rigdata.survey.exports import Export
from rigdata.survey.survey import Survey, survey

#: What a line of `tpjb init` bears that was no person's.
_OWN = re.compile(r"#\s*\((?:guess|records)\)")
#: Entries that a sensor has of the one that it is like.
_OF_MODEL = {"unit", "sensitivity", "full_scale", "excitation", "polarity", "zero"}


@dataclass
class _Block:
    """A table of a manifest: its kind, the channel's name or the run's file, its lines and what they mean."""

    kind: str
    name: str
    lines: list[str]
    data: dict[str, Any]


def _described_channels(text: str) -> dict[str, dict[str, Any]]:
    """Tables of the channels that a manifest describes; what is `like` another has that one's calibration."""
    try:
        tables = tomllib.loads(text).get("channels", {})
    except tomllib.TOMLDecodeError as error:
        raise refuse("campaign.toml", "", f"not valid TOML: {error}", "Repair it first") from error
    described = {str(name): table for name, table in tables.items() if isinstance(table, dict)}
    for name, table in described.items():
        model = described.get(str(table.get("like", "")), {})
        described[name] = {key: model[key] for key in _OF_MODEL if key in model} | table
    return described


def column_names(text: str) -> tuple[str, ...]:
    """Names that a manifest gives to the columns of files that have none."""
    try:
        names = tomllib.loads(text).get("csv", {}).get("names", ())
    except (tomllib.TOMLDecodeError, AttributeError):
        return ()
    return tuple(str(n) for n in names) if isinstance(names, list) else ()


def updated_manifest(text: str, exports: Sequence[Export], pivots: Sequence[float] = ()) -> tuple[str, list[str]]:
    """Carry a manifest on: entries for open places, guesses made anew, tables for new channels and records.

    A line is a guess while it bears the mark of one and the value that `tpjb init` had given it; all others stay. A
    manifest is never left with errors that it had not: then new records are added and nothing else.
    """
    described = _described_channels(text)
    before, after = survey(exports, pivots=pivots), survey(exports, described, pivots)
    for merges in (True, False):
        blocks = _blocks(text)
        changes = _update(blocks, _tables(before) if merges else None, _tables(after))
        new = "\n".join("\n".join(block.lines).rstrip() + "\n" for block in blocks if block.lines)
        if not merges or _faults(new) <= _faults(text):
            break
    return new, changes


def _faults(text: str) -> int:
    """Errors of a manifest beyond its open places."""
    try:
        parse_manifest(text)
    except RigDataError as error:
        count = sum(problem.severity == "error" for problem in error.problems)
        return count - (1 if open_paths(tomllib.loads(text)) else 0)
    return 0


def _blocks(text: str) -> list[_Block]:
    """The head of a manifest and its tables, in order."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.startswith("["):
            parts.append([])
        parts[-1].append(line)
    return [_block(lines) for lines in parts]


def _block(lines: list[str]) -> _Block:
    """A table by its heading; what is neither a channel nor a run has no kind."""
    heading = lines[0].replace(" ", "") if lines else ""
    try:
        data = tomllib.loads("\n".join(lines))
    except tomllib.TOMLDecodeError:  # a text over several lines that begins one with a bracket
        heading = ""
    if heading.startswith("[[runs]]"):
        (run,) = data["runs"]
        return _Block("runs", str(run.get("file", "")), lines, run)
    if heading.startswith("[channels."):
        ((name, channel),) = data["channels"].items()
        return _Block("channels", name, lines, channel)
    return _Block("", "", lines, {})


def _tables(surveyed: Survey) -> dict[tuple[str, str], list[str]]:
    """Lines of all tables that a draft has for channels and runs, by kind and name."""
    tables = {("channels", name): lines for name, lines in channel_blocks(surveyed).items()}
    return tables | {("runs", run.file): run_lines(run) for run in surveyed.runs}


def _update(
    blocks: list[_Block],
    old: dict[tuple[str, str], list[str]] | None,
    new: dict[tuple[str, str], list[str]],
) -> list[str]:
    """Merge the tables of a draft into the blocks; the `old` ones tell guesses from what was typed. Add new tables."""
    changes: list[str] = []
    for block in blocks:
        key = block.kind, block.name
        place = f"channel {block.name}" if block.kind == "channels" else f"run {block.data.get('id', block.name)}"
        if old is not None and key in new:
            _merge(block, new[key], old.get(key, []), place, changes)
        elif block.kind == "runs" and block.name and key not in new:
            changes.append(f"{place}: its file {block.name} is not there; left as it is")
    present = {(block.kind, block.name) for block in blocks}
    first_run = next((i for i, block in enumerate(blocks) if block.kind == "runs"), len(blocks))
    for (kind, name), lines in new.items():
        if (kind, name) in present:
            continue
        changes.append(f"{kind.removesuffix('s')} {name}: new")
        at = len(blocks)
        if kind == "channels":
            at, first_run = first_run, first_run + 1
        blocks.insert(at, _Block(kind, name, lines, {}))
    return changes


def _merge(block: _Block, new: Sequence[str], old: Sequence[str], place: str, changes: list[str]) -> None:
    """Fill in open places, put new guesses in place of old ones, and add what a table lacks; no line goes."""
    guessed, wanted = _values(old), _values(new)
    lines, present = [], set()
    for line in block.lines:
        key, value = _entry(line)
        present.add(key)
        is_guess = bool(_OWN.search(line)) and key in guessed and value == guessed[key][0]
        if key in wanted and (MARK in value or is_guess) and wanted[key][0] != value and MARK not in wanted[key][0]:
            changes.append(f"{place}: {key} {value} becomes {wanted[key][0]}")
            line = wanted[key][1]
        lines.append(line)
    while lines and not lines[-1].strip():
        lines.pop()
    # a sensor is described in full or by another one of its type
    if "like" in present:
        present |= _OF_MODEL - {"polarity"}
    if "unit" in present:
        present.add("like")
        if "sensitivity" in wanted and "sensitivity" not in guessed:
            present.add("sensitivity")
    for key, (value, line) in wanted.items():
        if key not in present:
            lines.append(line)
            changes.append(f"{place}: {key} {value} added")
    block.lines = lines


def _entry(line: str) -> tuple[str, str]:
    """Key and value of a line, without its comment; "" where it is none."""
    if line.startswith(("[", "#")) or "=" not in line:
        return "", ""
    try:
        ((key, value),) = tomllib.loads(line).items()
    except (tomllib.TOMLDecodeError, ValueError):
        return "", ""
    return key, repr(value)


def _values(lines: Sequence[str]) -> dict[str, tuple[str, str]]:
    entries = {}
    for line in lines:
        key, value = _entry(line)
        if key:
            entries[key] = (value, line)
    return entries
