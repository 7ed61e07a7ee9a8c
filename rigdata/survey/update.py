"""A manifest that was edited by hand, carried on: what is still open or a guess is guessed again, the rest stays."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rigdata.problem import refuse
from rigdata.readers.series import is_time, seconds
from rigdata.survey.draft import MARK, Survey, channel_blocks, run_lines, survey
from rigdata.survey.exports import Export
from rigdata.survey.guess import ChannelGuess


@dataclass
class _Block:
    """A table of a manifest: its header, its lines, and what they mean."""

    kind: str
    name: str
    lines: list[str]
    data: dict[str, Any]


def _known_channels(text: str) -> dict[str, ChannelGuess]:
    """Channels that a manifest describes, as far as it does."""
    try:
        tables = tomllib.loads(text).get("channels", {})
    except tomllib.TOMLDecodeError as error:
        raise refuse("campaign.toml", "", f"not valid TOML: {error}", "Repair it first") from error
    guesses = {}
    for name, table in tables.items():
        if isinstance(table, dict):
            quantity, unit, axis = (_text(table, key) for key in ("quantity", "unit", "axis"))
            guesses[str(name)] = ChannelGuess(quantity, unit, axis, "as the manifest says")
    return guesses


def column_names(text: str) -> tuple[str, ...]:
    """Names that a manifest gives to the columns of files that have none."""
    try:
        names = tomllib.loads(text).get("csv", {}).get("names", ())
    except (tomllib.TOMLDecodeError, AttributeError):
        return ()
    return tuple(str(n) for n in names) if isinstance(names, list) else ()


def _text(table: Mapping[str, Any], key: str) -> str:
    value = table.get(key, "")
    return value if isinstance(value, str) and MARK not in value else ""


def updated_manifest(text: str, exports: Sequence[Export]) -> tuple[str, list[str]]:
    """Carry a manifest on: runs for new records, entries that a named channel lacks, guesses made anew.

    An entry counts as a guess while it holds what `tpjb init` had guessed; one that was changed by hand stays.
    """
    described = _known_channels(text)
    before, after = survey(exports), survey(exports, described)
    blocks = _blocks(text)
    changes: list[str] = []
    _update_channels(blocks, before, after, changes)
    _update_runs(blocks, before, after, changes)
    return "\n".join("\n".join(block.lines).rstrip() + "\n" for block in blocks if block.lines), changes


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


def _update_channels(blocks: list[_Block], before: Survey, after: Survey, changes: list[str]) -> None:
    present = {b.name for b in blocks if b.kind == "channels"}
    old, new = channel_blocks(before), channel_blocks(after)
    for block in blocks:
        if block.kind == "channels" and block.name in new:
            _merge(block, new[block.name], old.get(block.name, []), f"channel {block.name}", changes)
    fresh = [_Block("channels", name, lines, {}) for name, lines in new.items() if name not in present]
    changes += [f"channel {b.name}: new" for b in fresh]
    at = next((i for i, b in enumerate(blocks) if b.kind == "runs"), len(blocks))
    blocks[at:at] = fresh


def _update_runs(blocks: list[_Block], before: Survey, after: Survey, changes: list[str]) -> None:
    old = {run.file: run_lines(run, before) for run in before.runs}
    new = {run.file: run_lines(run, after) for run in after.runs}
    present = {b.name for b in blocks if b.kind == "runs"}
    for block in blocks:
        if block.kind == "runs" and block.name in new:
            _merge(block, new[block.name], old[block.name], f"run {block.data.get('id', block.name)}", changes)
        elif block.kind == "runs" and block.name:
            changes.append(f"run {block.data.get('id', block.name)}: its file {block.name} is not there; left as it is")
    for name, lines in new.items():
        if name not in present:
            blocks.append(_Block("runs", name, lines, {}))
            changes.append(f"run {name}: new")


def _merge(block: _Block, new: Sequence[str], old: Sequence[str], place: str, changes: list[str]) -> None:
    """Put new guesses in place of old ones and of open places, and add what is lacking."""
    guessed, wanted = _values(old), _values(new)
    lines, have = [], set()
    for line in block.lines:
        key, value = _entry(line)
        have.add(key)
        open_still = key and (MARK in value or (key in guessed and value == guessed[key][0]))
        if not open_still or (key in wanted and wanted[key][0] == value):
            lines.append(line)
        elif key in wanted:
            lines.append(wanted[key][1])
            changes.append(f"{place}: {key} {value} becomes {wanted[key][0]}")
        else:
            changes.append(f"{place}: {key} {value} goes")
    while lines and not lines[-1].strip():
        lines.pop()
    # a sensor is described in full or by another one of its type
    present = {_entry(line)[0] for line in lines}
    if "like" in present:
        have |= {"unit", "sensitivity"}
    if "unit" in present:
        have.add("like")
    for key, (value, line) in wanted.items():
        if key not in have:
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
