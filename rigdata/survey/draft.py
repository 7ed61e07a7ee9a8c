"""A commented draft of a manifest: what the exports show is filled in, the remainder is marked."""

from __future__ import annotations

import json
import math
import re

from rigdata.manifest.fields import ACQUISITION, CHANNEL, HOUSING, KINDS, MARK, RUN, Field
from rigdata.survey.channels import PAD, ChannelGuess, Entry, quantity_of_unit, usable_unit
from rigdata.survey.runs import RunGuess
from rigdata.survey.survey import Survey

_DIRECTED = ("displacement", "force", "acceleration")
_EXAMPLE = {
    "displacement": '"7.78 mV/um"',
    "force": '"1 mV/N", or "2.0 mV/V" with full_scale and excitation of the bridge',
    "acceleration": '"10 mV/g"',
    "temperature": '"15 K/V", with zero = "0 degC"',
    "pressure": '"1 V/bar"',
    "speed": '"100 mV/Hz"',
}
_HEAD = (
    "# Draft by `tpjb init`. No mark: read from the files. (records): concluded from them, with the figure.",
    f"# (guess): confirm or correct. {MARK}: open. After changes `tpjb init --update` fills in what follows from them.",
    "# Signs and frame: docs/guide/mounting.md",
)
#: What no record tells, and what it is where nobody says more.
_TOLD = (
    'description = ""   # what was tested: reports begin with it, the date and by whom',
    'date = ""   # when it was measured',
    'by = ""   # laboratory and person',
)
_TURNS = 'rotation = "counter-clockwise"   # (guess) with X to the right and Y up; or "clockwise"'
_MOUNT = '# mount = "floating"   # hung on stingers, or "cells": on its load cells; else found in the records'
_SOURCES = {"records": "(records) ", "guess": "(guess) "}


def draft_manifest(surveyed: Survey, name: str, bearing: str | None) -> str:
    """Write the text of a draft."""
    lines = [*_HEAD, 'schema = "tpjb-rig/1"', f"id = {_toml_string(name)}"]
    lines.append(f"bearing = {_toml_string(bearing)}" if bearing else f'bearing = "{MARK}"   # file in this folder')
    lines += [*_TOLD, "", "[shaft]", _TURNS, "", "[housing]", _open(HOUSING, "mass", "kg"), _MOUNT, ""]
    if not all(rate > 0 for rate in surveyed.rates):
        lines += ["[acquisition]", _open(ACQUISITION, "sample_rate", "Hz"), ""]
    if surveyed.nameless:
        names = ", ".join(_toml_string(f"column{i + 1}") for i in range(surveyed.nameless))
        lines += ["[csv]", f"names = [{names}]   # the files have none: write yours here and below, then --update", ""]
    for clock, unit in surveyed.clocks.items():
        spelt = usable_unit(unit.value)
        lines += [f"[channels.{_key(clock)}]", 'quantity = "time"', _line("unit", f'"{spelt}"', unit), ""]
    for block in [*channel_blocks(surveyed).values(), *(run_lines(run) for run in surveyed.runs)]:
        lines += [*block, ""]
    return "\n".join(_explained_once(lines)).rstrip() + "\n"


def _explained_once(lines: list[str]) -> list[str]:
    """Lines whose explanations of open places stand at the first of their kind only."""
    explained = set()
    shortened = []
    for line in lines:
        entry, mark, meaning = line.partition("   # ")
        if MARK in entry and mark:
            line = entry if meaning in explained else line
            explained.add(meaning)
        shortened.append(line)
    return shortened


def channel_blocks(surveyed: Survey) -> dict[str, list[str]]:
    """Lines of every channel's table; sensors of one kind and unit are described once, the others are `like` it."""
    first: dict[tuple[str, str], str] = {}
    blocks = {}
    for name, guess in surveyed.channels.items():
        quantity = guess.quantity.value
        is_raw = quantity in _EXAMPLE and quantity_of_unit(guess.unit) == ""
        model = first.setdefault((quantity, guess.unit), name) if is_raw else name
        polarity = surveyed.channels[model].polarity
        blocks[name] = _channel_lines(name, guess, "" if model == name else model, polarity)
        if name in surveyed.per_hertz and guess.unit:
            ratio = f"{surveyed.per_hertz[name]:.4g} {guess.unit}/Hz"
            text = f'sensitivity = "{ratio}"   # (records) constant over the line that is taken for the shaft\'s'
            blocks[name] = [text if line.startswith("sensitivity") else line for line in blocks[name]]
    return blocks


def _channel_lines(name: str, guess: ChannelGuess, like: str, polarity: int) -> list[str]:
    head, quantity = f"[channels.{_key(name)}]", guess.quantity.value
    if not quantity or quantity == "ignore":
        return [head, 'quantity = "ignore"   # (guess) name and unit are not known; or displacement, force, ..']
    source = Entry() if like else guess.quantity  # what it is like bears the mark for both
    lines = [head, _line("quantity", f'"{quantity}"', source)]
    if quantity in _DIRECTED:
        lines.append(_axis_line(guess))
    if like:
        lines.append(f"like = {_toml_string(like)}   # (guess) same type; or its own unit, sensitivity, ..")
    else:
        lines.append(f'unit = "{guess.unit or MARK}"')
        if quantity_of_unit(guess.unit) == "":
            lines.append(f'sensitivity = "{MARK}"   # such as {_EXAMPLE.get(quantity, "1 V per unit")}')
    if guess.axis.value is not None and (guess.polarity < 0 or (like and guess.polarity != polarity)):
        lines.append(f"polarity = {guess.polarity}")
    if quantity == "temperature":
        pad = re.search(rf"(?:{PAD}|t|tc|temp\w*?)[-_ #]*(\d{{1,2}})(?!\d)", name, re.IGNORECASE)
        lines.append(f"pad = {int(pad[1])}   # (guess) its name" if pad and int(pad[1]) else "# pad = 1")
    return lines


def _axis_line(guess: ChannelGuess) -> str:
    if guess.axis.value is not None:
        return _line("axis", f'"{guess.axis.number:g} deg"', guess.axis)
    hint = f"; its name hints at {guess.hint:g} deg" if math.isfinite(guess.hint) else ""
    return _open(CHANNEL, "axis", "deg") + hint


def run_lines(run: RunGuess) -> list[str]:
    """Lines of a run's table."""
    stem = run.file.rpartition("/")[2].rpartition(".")[0]
    kind = run.kind.value
    lines = ["[[runs]]", f"id = {_toml_string(stem)}", f"file = {_toml_string(run.file)}"]
    lines.append(_line("kind", f'"{kind}"', run.kind) if kind else f'kind = "{MARK}"   # {", ".join(KINDS)}')
    if kind in ("dynamic", "locus", None):
        lines.append(_quantity("shaft_speed", f"{run.speed.number:.4g} Hz", run.speed))
        lines.append(_quantity("static_load", run.load_text, run.load))
    if kind == "dry_pivot":
        lines.append(_line("pad", str(run.pad.value), run.pad) if run.pad.value else _open(RUN, "pad", ""))
    if kind != "clearance":
        lines.append(_quantity("static_load_direction", f"{run.direction.number:.4g} deg", run.direction))
    if kind in ("dynamic", None):
        lines.append(_quantity("excitation_frequency", f"{run.excitation.number:.4g} Hz", run.excitation))
    return lines


def _line(key: str, value: str, entry: Entry) -> str:
    """One entry with its source; what is read from a file needs none."""
    mark = _SOURCES.get(entry.source)
    return f"{key} = {value}   # {mark}{entry.reason}" if mark else f"{key} = {value}"


def _quantity(key: str, text: str, entry: Entry) -> str:
    if entry.value is not None:
        return _line(key, f'"{text}"', entry)
    unit = {"static_load": "kN", "static_load_direction": "deg"}.get(key, "Hz")
    return f"{_open(RUN, key, unit)}{f'; {entry.reason}' if entry.reason else ''}"


def _open(fields: tuple[Field, ...], key: str, unit: str) -> str:
    """A line that is open: the key, the mark with a unit, and what it means."""
    meaning = next(field.meaning for field in fields if field.key == key)
    return f'{key} = "{f"{MARK} {unit}".strip()}"   # {meaning}'


def _toml_string(text: str) -> str:
    """Write text as a TOML string: quoted, controls escaped."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if bare else _toml_string(name)
