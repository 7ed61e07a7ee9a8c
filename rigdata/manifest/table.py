"""A table of the manifest, read by its declared fields; every fault is noted instead of stopping at the first."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from rigdata.manifest.fields import RAW, Field
from rigdata.near_names import hint
from rigdata.problem import Problem, Severity
from rigdata.units import UnitError, parse_quantity

_MAX_FINDINGS = 1000
_MAX_TEXT = 20_000
_TABLE = re.compile(r"\s*(\[\[?)([^\[\]#]+)\]\]?\s*(?:#.*)?$")
_LONGEST = 1000
_KEY = re.compile(r"\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\s]+)")
Path = tuple[str | int, ...]


def shown(value: object, length: int = 60) -> str:
    """`value` in a message: quoted, short, on one line, controls escaped."""
    if isinstance(value, str):
        # right-to-left marks and control characters could make a message read otherwise than it is
        text = repr("".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in value[:200]))
    elif isinstance(value, (dict, list)):  # may be nested too deeply to be printed
        text = "a table" if isinstance(value, dict) else "an array"
    elif isinstance(value, int) and abs(value) > 10**60:  # may have more digits than Python prints
        text = "a whole number of many digits"
    else:
        text = ascii(value)
    return text if len(text) <= length else text[: length - 3] + "..."


def nearest(name: str, known: Collection[str]) -> str:
    """The nearest of `known`, as the remedy for an unknown `name`."""
    return hint(name.lower(), known, cutoff=0.4)


class Findings:
    """The problems of one manifest, with their lines."""

    def __init__(self, file: str, lines: dict[Path, int]) -> None:
        self.file = file
        self.lines = lines
        self.problems: list[Problem] = []
        self.errors = 0

    def add(self, severity: Severity, path: Path, what: str, cure: str, run: str | None = None) -> None:
        """Note a problem of the key at `path`."""
        self.append(Problem(severity, self.file, _place_of(self.lines, path), what, cure, run))

    def append(self, problem: Problem) -> None:
        """Note a problem that was found elsewhere."""
        self.errors += problem.severity == "error"
        if len(self.problems) < _MAX_FINDINGS:
            self.problems.append(problem)

    def error(self, path: Path, what: str, cure: str, run: str | None = None) -> None:
        """Note an error of the key at `path`."""
        self.add("error", path, what, cure, run)


class Table:
    """One TOML table; a value that is missing or wrong (then noted) is its field's default."""

    def __init__(self, data: object, path: Path, findings: Findings) -> None:
        self.path = path
        self.findings = findings
        self.data: dict[str, Any] = data if isinstance(data, dict) else {}
        if not isinstance(data, dict):
            findings.error(path, f"is {shown(data)}, not a table", "Write it as a [table] with keys")

    def subtable(self, key: str) -> Table:
        """The table under `key`, empty where absent."""
        return Table(self.data.get(key, {}), (*self.path, key), self.findings)

    def error(self, key: str, what: str, cure: str) -> None:
        """Note an error of `key`."""
        self.findings.error((*self.path, key), what, cure)

    def read(self, fields: tuple[Field, ...], where: str, needed: Collection[str] = ()) -> dict[str, Any]:
        """The value of every field, SI; keys that are no field are noted."""
        self.only(fields, where)
        return {field.key: self.value(field, field.key in needed) for field in fields}

    def only(self, fields: tuple[Field, ...], where: str) -> None:
        """Note every key that is no field."""
        known = [field.key for field in fields]
        for key in self.data:
            if key not in known:
                self.error(key, f"unknown key {shown(key)} in {where}", nearest(key, known))

    def value(self, field: Field, needed: bool = False) -> Any:
        """The value of one field, SI."""
        key, value = field.key, self.data.get(field.key)
        if value is None:
            if needed or field.required:
                self.error(key, f"{key} is missing", _remedy_of_missing(field))
            return field.default
        if field.kind in RAW:
            return value
        if field.kind == "whole":
            checked: Any = self._whole(field, value)
        elif field.kind in ("text", "choice"):
            checked = self._text(field, value, needed)
        else:
            checked = self._quantity(field, value)
        return field.default if checked is None else checked

    def _text(self, field: Field, value: object, needed: bool) -> str | None:
        """A string, not longer than is sane; a choice is one of those known."""
        key = field.key
        if not isinstance(value, str):
            self.error(key, f"{key} is {shown(value)}, not text", "Put it in quotes")
        elif len(value) > _MAX_TEXT or "\0" in value:
            self.error(key, f"{key} is too long or holds a NUL character", "Shorten it")
        elif (needed or field.required) and not value.strip():
            self.error(key, f"{key} is empty", "Give a value")
        elif field.known and value not in field.known:
            self.error(key, f"{key} {shown(value)} is unknown", nearest(value, field.known))
        else:
            return value
        return None

    def _whole(self, field: Field, value: object) -> int | None:
        if isinstance(value, bool) or not isinstance(value, int) or not field.holds(value):
            advice = f"Give a whole number from {field.low:g} on, without quotes"
            self.error(field.key, f"{field.key} is {shown(value)}", advice)
            return None
        return value

    def _quantity(self, field: Field, value: object) -> float | None:
        key = field.key
        try:
            number = parse_quantity(value, field.kind)
        except UnitError as error:
            self.error(key, f"{key}: {error}", f"Give a {field.kind} as number and unit in quotes")
            return None
        if not field.holds(number):
            self.error(key, f"{key} is {shown(value)}", field.advice())
            return None
        return number


def _remedy_of_missing(field: Field) -> str:
    if field.kind in ("text", "choice"):
        return f'Add {field.key} = "..."'
    return f"Add {field.key}, a {field.kind} with its unit"


def key_lines(text: str) -> dict[Path, int]:
    """Line (1-based) of every table and key, by path."""
    lines: dict[Path, int] = {}
    counts: dict[str, int] = {}
    table: Path = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST:
            continue
        header = _TABLE.match(line)
        if header is not None:
            name = tuple(a or b or c for a, b, c in _PART.findall(header[2]))
            if header[1] == "[[":
                index = counts.get(header[2].strip(), 0)
                counts[header[2].strip()] = index + 1
                table = (*name, index)
            else:
                table = name
            lines.setdefault(table, number)
            continue
        key = _KEY.match(line)
        if key is not None:
            lines.setdefault((*table, key[1].strip("\"'")), number)
    return lines


def _place_of(lines: dict[Path, int], path: Path) -> str:
    """Where `path` is: ``"line 14, [channels.X1A] sensitivity"``."""
    spelt = _spell(path)
    at: Path = path
    while at and at not in lines:
        at = at[:-1]
    return f"line {lines[at]}, {spelt}" if at else spelt


def _spell(path: Path) -> str:
    if len(path) == 1:
        return str(path[0])
    if path and path[0] == "runs" and isinstance(path[1], int):
        keys = "".join(f" {p}" for p in path[2:])
        return f"[[runs]] no. {path[1] + 1}{keys}"
    table = ".".join(str(p) for p in path[:-1])
    return f"[channels.{path[-1]}]" if table == "channels" else f"[{table}] {path[-1]}"
