"""A commented draft of a manifest, what the exports show filled in; and one that was edited by hand, carried on.

Carried on, open places and guesses are filled in; what was typed stays.
"""

import contextlib
import json
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rigdata.calibration import VECTOR_QUANTITIES
from rigdata.manifest.fields import ACQUISITION, CHANNEL, HOUSING, KINDS, MARK, RUN, Field, open_paths
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError, parse_toml, refuse, toml_value
from rigdata.survey.channels import OPEN, PAD, WORDS, Entry, pairs, quantity_of_unit, usable_unit
from rigdata.survey.exports import Export
from rigdata.survey.runs import RunGuess
from rigdata.survey.survey import Survey, survey

_SOURCES = {"records": "(records) ", "guess": "(guess) "}
#: What a line of `tpjb init` bears that was no person's.
_OWN = re.compile(r"#\s*\((?:guess|records)\)")
#: Entries that a sensor has of the one that it is like.
_OF_MODEL = {"unit", "sensitivity", "full_scale", "excitation", "polarity", "zero"}

#: Lines of tables by the key of their block.
_Tables = dict[tuple[str, str], list[str]]


def draft_manifest(surveyed: Survey, name: str, bearing: str | None) -> str:
    """Write the text of a draft."""
    file = toml_value(bearing) if bearing else f'"{MARK}"   # file in this folder'
    mass = _line("mass", OPEN, HOUSING)
    lines = WORDS["draft"]["head"].format(name=toml_value(name), bearing=file, mass=mass).split("\n")
    exports = [run.export for run in surveyed.runs]
    if not all(export.rate > 0 for export in exports):
        lines += ["[acquisition]", _line("sample_rate", OPEN, ACQUISITION), ""]
    if nameless := max((export.nameless for export in exports), default=0):
        names = ", ".join(toml_value(f"column{i + 1}") for i in range(nameless))
        lines += ["[csv]", f"names = [{names}]   # the files have none: write yours here and below, then --update", ""]
    for clock, unit in surveyed.clocks.items():
        spelt = replace(unit, value=usable_unit(unit.value) or "s")
        lines += [f"[channels.{_key(clock)}]", 'quantity = "time"', _line("unit", spelt), ""]
    for block in _tables(surveyed).values():
        lines += [*block, ""]
    explained = set()
    for number, line in enumerate(lines):  # an open place of a kind is explained once
        entry, mark, meaning = line.partition("   # ")
        if MARK in entry and mark:
            lines[number] = entry if meaning in explained else line
            explained.add(meaning)
    return "\n".join(lines).rstrip() + "\n"


def _tables(surveyed: Survey) -> _Tables:
    """Lines of all channels' and runs' tables; of sensors of a kind and unit one is described, the others `like` it."""
    models: dict[tuple[str, str], str] = {}
    tables = {}
    for name, guess in surveyed.channels.items():
        quantity = guess.quantity.value
        is_raw = quantity in WORDS["sensitivities"] and quantity_of_unit(guess.unit) == ""
        model = models.setdefault((quantity, guess.unit), name) if is_raw else name
        tables["channels", name] = _channel_lines(name, surveyed, model)
    for run in surveyed.runs:
        tables["runs", run.file] = run_lines(run)
    return tables


def _channel_lines(name: str, surveyed: Survey, model: str) -> list[str]:
    guess = surveyed.channels[name]
    head, quantity, is_like = f"[channels.{_key(name)}]", guess.quantity.value, model != name
    if not quantity or quantity == "ignore":
        suffices = pairs(surveyed.channels, "displacement") and pairs(surveyed.channels, "force")
        value = 'ignore"   # (guess)' if suffices else f'{MARK}"   #'
        return [head, f'quantity = "{value} name and unit are not known: displacement, force, .. or ignore']
    # what it is like bears the mark for both
    lines = [head, _line("quantity", Entry(quantity) if is_like else guess.quantity)]
    if quantity in VECTOR_QUANTITIES:
        lines.append(_line("axis", guess.axis, CHANNEL))
    if is_like:
        lines.append(f"like = {toml_value(model)}   # (guess) same type; or its own unit, sensitivity, ..")
    else:
        lines.append(f'unit = "{guess.unit or MARK}"')
        if guess.sensitivity.value:
            lines.append(_line("sensitivity", guess.sensitivity))
        elif quantity_of_unit(guess.unit) == "":
            lines.append(f'sensitivity = "{MARK}"   # such as {WORDS["sensitivities"].get(quantity, "1 V per unit")}')
    usual = surveyed.channels[model].polarity
    if guess.axis.value is not None and (guess.polarity < 0 or guess.polarity != usual):
        remark = "   # (guess) on cells; the other way round where the stator hangs" * (quantity == "acceleration")
        lines.append(f"polarity = {guess.polarity}{remark}")
    if quantity == "temperature":
        pad = re.search(rf"(?:{PAD}|t|tc|temp\w*?)[-_ #]*(\d{{1,2}})(?!\d)", name, re.IGNORECASE)
        lines.append(f"pad = {int(pad[1])}   # (guess) its name" if pad and int(pad[1]) else "# pad = 1")
    return lines


def run_lines(run: RunGuess) -> list[str]:
    """Lines of a run's table."""
    kind = run.kind.value
    lines = ["[[runs]]", f"id = {toml_value(Path(run.file).stem)}", f"file = {toml_value(run.file)}"]
    lines.append(_line("kind", run.kind) if kind else f'kind = "{MARK}"   # {", ".join(KINDS)}')
    fields = [field for field in RUN if (kind or "dynamic") in (*field.needed_by, *field.drafted_for)]
    return lines + [_line(field.key, getattr(run, field.guess), RUN) for field in fields]


def _line(key: str, entry: Entry, fields: tuple[Field, ...] = ()) -> str:
    """One entry with its source (what is read from a file needs none); or an open one with what it means."""
    field = next((field for field in fields if field.key == key), Field(key, "text"))
    if entry.value is None:
        text = f'{key} = "{f"{MARK} {field.unit}".strip()}"   # {field.meaning}'
        return f"{text}; {entry.reason}" if entry.reason else text
    number = f"{entry.number:.4g} {field.unit}" if field.unit and isinstance(entry.value, float) else entry.value
    value = json.dumps(entry.text or number)
    mark = _SOURCES.get(entry.source)
    return f"{key} = {value}   # {mark}{entry.reason}" if mark else f"{key} = {value}"


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else toml_value(name)


@dataclass
class _Block:
    """A table of a manifest."""

    key: tuple[str, str]  #: "channels" and the channel's name, "runs" and the run's file; else empty
    place: str  #: what messages call it
    lines: list[str]


def column_names(text: str) -> tuple[str, ...]:
    """Names that a manifest gives to the columns of files that have none."""
    try:
        names = parse_toml(text).get("csv", {}).get("names", ())
    except (ValueError, AttributeError):
        return ()
    return tuple(map(str, names)) if isinstance(names, list) else ()


def updated_manifest(text: str, exports: Sequence[Export], pivots: Sequence[float] = ()) -> tuple[str, list[str]]:
    """Carry a manifest on: entries for open places, guesses made anew, tables for new channels and records.

    A line is a guess while it bears the mark of one and the value that `tpjb init` had given it; all others stay. A
    manifest is never left with errors that it had not: then new records are added and nothing else.
    """
    try:
        tables = parse_toml(text).get("channels", {})
    except ValueError as error:
        raise refuse("campaign.toml", "", f"not valid TOML: {error}", "Repair it first") from error
    described = {str(name): table for name, table in tables.items() if isinstance(table, dict)}
    for name, table in described.items():  # what is like another has that one's calibration
        model = described.get(str(table.get("like", "")), {})
        described[name] = {key: model[key] for key in _OF_MODEL if key in model} | table
    former = _tables(survey(exports, pivots=pivots))
    for block in _blocks(text):
        for line in former.get(block.key, ()):
            if line.startswith("axis") and "(guess)" in line and line in block.lines:
                del described[block.key[1]]["axis"]
    new_tables = _tables(survey(exports, described, pivots))
    for merges in (True, False):
        blocks = _blocks(text)
        changes = _update(blocks, former if merges else None, new_tables)
        new = "\n".join("\n".join(block.lines).rstrip() + "\n" for block in blocks if block.lines)
        if not merges or _faults(new) <= _faults(text):
            break
    return new, changes


def _faults(text: str) -> int:
    """Errors of a manifest beyond its open places."""
    try:
        parse_manifest(text)
    except RigDataError as error:
        return sum(problem.severity == "error" for problem in error.problems) - bool(open_paths(tomllib.loads(text)))
    return 0


def _blocks(text: str) -> list[_Block]:
    """The head of a manifest and its tables, in order; what is neither a channel nor a run has no kind."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.startswith("["):
            parts.append([])
        parts[-1].append(line)
    blocks = []
    for lines in parts:
        key, place = ("", ""), ""
        with contextlib.suppress(tomllib.TOMLDecodeError):  # a text over several lines that begins one with a bracket
            data, head = tomllib.loads("\n".join(lines)), "".join(lines[:1]).replace(" ", "")
            if head.startswith("[[runs]]"):
                (run,) = data["runs"]
                file = str(run.get("file", ""))
                key, place = ("runs", file), f"run {run.get('id', file)}"
            elif head.startswith("[channels."):
                (name,) = data["channels"]
                key, place = ("channels", name), f"channel {name}"
        blocks.append(_Block(key, place, lines))
    return blocks


def _update(blocks: list[_Block], old: _Tables | None, new: _Tables) -> list[str]:
    """Merge the tables of a draft into the blocks; the `old` ones tell guesses from what was typed. Add new tables."""
    changes: list[str] = []
    for block in blocks:
        kind, name = block.key
        if old is not None and block.key in new:
            _merge(block, new[block.key], old.get(block.key, []), changes)
        elif kind == "runs" and name and block.key not in new:
            changes.append(f"{block.place}: its file {name} is not there; left as it is")
    present = [block.key for block in blocks]
    first_run = next((i for i, (kind, _) in enumerate(present) if kind == "runs"), len(blocks))
    for (kind, name), lines in new.items():
        if (kind, name) in present:
            continue
        changes.append(f"{kind.removesuffix('s')} {name}: new")
        at = len(blocks)
        if kind == "channels":
            at, first_run = first_run, first_run + 1
        blocks.insert(at, _Block((kind, name), "", lines))
    return changes


def _merge(block: _Block, new: Sequence[str], old: Sequence[str], changes: list[str]) -> None:
    """Fill in open places, put new guesses in place of old ones, add what a table lacks; needless open ones go."""
    guessed, proposals = _values(old), _values(new)
    lines, present = [], set()
    for line in block.lines:
        key, value = _entry(line)
        present.add(key)
        if MARK in value and key in guessed and key not in proposals:
            changes.append(f"{block.place}: {key} is not needed")
            continue
        is_guess = bool(_OWN.search(line)) and key in guessed and value == guessed[key][0]
        if key in proposals and (MARK in value or is_guess) and MARK not in proposals[key][0]:
            result, drafted = proposals[key]
            if result != value:
                changes.append(f"{block.place}: {key} {value} becomes {result}")
            if result != value or "(records)" in drafted:
                line = drafted
        lines.append(line)
    while lines and not lines[-1].strip():
        lines.pop()
    # a sensor is described in full or by another one of its type
    if "like" in present:
        present |= _OF_MODEL - {"polarity"}
    if "unit" in present:
        present.add("like")
        if "sensitivity" in proposals and "sensitivity" not in guessed:
            present.add("sensitivity")
    for key, (value, line) in proposals.items():
        if key not in present:
            lines.append(line)
            changes.append(f"{block.place}: {key} {value} added")
    block.lines = lines


def _entry(line: str) -> tuple[str, str]:
    """Key and value of a line, without its comment; "" where it is none."""
    with contextlib.suppress(tomllib.TOMLDecodeError, ValueError):
        ((key, value),) = tomllib.loads(line).items()
        return ("", "") if line.startswith("[") else (key, repr(value))
    return "", ""


def _values(lines: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Values and lines by their keys."""
    values = {}
    for line in lines:
        key, value = _entry(line)
        if key:
            values[key] = value, line
    return values
