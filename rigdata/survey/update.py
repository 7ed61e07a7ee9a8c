"""A manifest that was edited by hand, carried on: open places and guesses are filled in, what was typed stays."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rigdata.manifest.fields import MARK, open_paths
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError, refuse
from rigdata.readers.series import is_time, seconds
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
        changes: list[str] = []
        _update_channels(blocks, before, after, changes, merges)
        _update_runs(blocks, before, after, changes, merges)
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
    blocks = []
    for lines in parts:
        try:
            data = tomllib.loads("\n".join(lines))
        except tomllib.TOMLDecodeError:  # a text over several lines that begins one with a bracket
            data = {}
        kind = next(iter(data), "") if lines and lines[0].startswith("[") else ""
        inner = data.get(kind, {})
        name = ""
        if kind == "channels" and isinstance(inner, dict):
            name, inner = next(iter(inner.items()), ("", {}))
        elif kind == "runs" and isinstance(inner, list):
            inner = inner[0] if inner else {}
            name = str(inner.get("file", "")) if isinstance(inner, dict) else ""
        blocks.append(_Block(kind, str(name), lines, inner if isinstance(inner, dict) else {}))
    return blocks


def _update_channels(blocks: list[_Block], before: Survey, after: Survey, changes: list[str], merges: bool) -> None:
    present = {b.name for b in blocks if b.kind == "channels"}
    old, new = channel_blocks(before), channel_blocks(after)
    for block in blocks:
        if merges and block.kind == "channels" and block.name in new:
            _merge(block, new[block.name], old.get(block.name, []), f"channel {block.name}", changes)
    fresh = [_Block("channels", name, lines, {}) for name, lines in new.items() if name not in present]
    changes += [f"channel {b.name}: new" for b in fresh]
    at = next((i for i, b in enumerate(blocks) if b.kind == "runs"), len(blocks))
    blocks[at:at] = fresh


def _update_runs(blocks: list[_Block], before: Survey, after: Survey, changes: list[str], merges: bool) -> None:
    old = {run.file: run_lines(run) for run in before.runs}
    new = {run.file: run_lines(run) for run in after.runs}
    present = {b.name for b in blocks if b.kind == "runs"}
    for block in blocks:
        run = f"run {block.data.get('id', block.name)}"
        if merges and block.kind == "runs" and block.name in new:
            _merge(block, new[block.name], old[block.name], run, changes)
        elif block.kind == "runs" and block.name and block.name not in new:
            changes.append(f"{run}: its file {block.name} is not there; left as it is")
    for name, lines in new.items():
        if name not in present:
            blocks.append(_Block("runs", name, lines, {}))
            changes.append(f"run {name}: new")


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


def renamed(export: Export, names: Sequence[str]) -> Export:
    """An export whose nameless columns bear the names of the manifest."""

    def name(old: str) -> str:
        number = old.removeprefix("column")
        return names[int(number) - 1] if number.isdigit() and 0 < int(number) <= len(names) else old

    series = tuple(replace(s, name=name(s.name)) for s in export.series)
    clock = name(export.clock)
    if not clock and (times := next((s for s in series if is_time(s.name)), None)) is not None:
        series = tuple(replace(s, time=seconds(times.values, times.unit)) for s in series if s is not times)
        clock = times.name
    return replace(export, series=series, clock=clock)
