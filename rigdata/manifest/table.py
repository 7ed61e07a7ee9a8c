"""Typed access to a table of the manifest, noting every fault instead of stopping at the first."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from rigdata.near_names import nearest_name
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
    """`value` as it stands in a message: quoted, short, on one line, controls escaped."""
    if isinstance(value, str):
        text = _printable(value)
    elif isinstance(value, (dict, list)):  # may be nested too deeply to be printed
        text = "a table" if isinstance(value, dict) else "an array"
    else:
        text = ascii(value)
    return text if len(text) <= length else text[: length - 3] + "..."


def _printable(text: str) -> str:
    # Right-to-left marks and control characters could make a message read otherwise than it is.
    return repr("".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text[:200]))


def nearest(name: str, known: Iterable[str]) -> str:
    """Name the nearest of `known`, as the cure for an unknown `name`."""
    names = list(known)
    close = nearest_name(name.lower(), names, cutoff=0.4)
    return f"Did you mean {close!r}?" if close else f"Known: {', '.join(names)}"


class Findings:
    """The problems of one manifest, with the lines they stand on."""

    def __init__(self, file: str, lines: dict[Path, int]) -> None:
        self.file = file
        self.lines = lines
        self.problems: list[Problem] = []

    @property
    def failed(self) -> bool:
        """Whether any problem is an error."""
        return any(p.severity == "error" for p in self.problems)

    def add(self, severity: Severity, path: Path, what: str, cure: str, run: str | None = None) -> None:
        """Note a problem of the key at `path`."""
        if len(self.problems) < _MAX_FINDINGS:
            self.problems.append(Problem(severity, self.file, _place_of(self.lines, path), what, cure, run))

    def error(self, path: Path, what: str, cure: str, run: str | None = None) -> None:
        """Note an error of the key at `path`."""
        self.add("error", path, what, cure, run)


class Table:
    """One TOML table; every getter returns None where the key is absent or wrong (then noted)."""

    def __init__(self, data: object, path: Path, findings: Findings) -> None:
        self.path = path
        self.findings = findings
        self.data: dict[str, Any] = data if isinstance(data, dict) else {}
        if not isinstance(data, dict):
            findings.error(path, f"is {shown(data)}, not a table", "Write it as a [table] with keys")

    def only(self, known: tuple[str, ...], where: str) -> None:
        """Note every key that is not in `known`."""
        for key in self.data:
            if key not in known:
                self.findings.error((*self.path, key), f"unknown key {shown(key)} in {where}", nearest(key, known))

    def subtable(self, key: str) -> Table:
        """Give the table under `key`, empty where absent."""
        return Table(self.data.get(key, {}), (*self.path, key), self.findings)

    def error(self, key: str, what: str, cure: str) -> None:
        """Note an error of `key`."""
        self.findings.error((*self.path, key), what, cure)

    def _get(self, key: str, required: bool, cure: str) -> Any:
        if key not in self.data and required:
            self.error(key, f"{key} is missing", cure)
        return self.data.get(key)

    def text(self, key: str, required: bool = False) -> str | None:
        """Give a string, not longer than is sane."""
        value = self._get(key, required, f'Add {key} = "..."')
        if value is None:
            return None
        if not isinstance(value, str):
            self.error(key, f"{key} is {shown(value)}, not text", "Put it in quotes")
            return None
        if len(value) > _MAX_TEXT or "\0" in value:
            self.error(key, f"{key} is too long or holds a NUL character", "Shorten it")
            return None
        if required and not value.strip():
            self.error(key, f"{key} is empty", "Give a value")
            return None
        return value

    def choice(self, key: str, known: tuple[str, ...], required: bool = False) -> str | None:
        """Give one of the texts `known`."""
        value = self.text(key, required)
        if value is not None and value not in known:
            self.error(key, f"{key} {shown(value)} is unknown", nearest(value, known))
            return None
        return value

    def integer(self, key: str, low: int, high: int = 10_000_000) -> int | None:
        """Give a whole number between `low` and `high`."""
        value = self.data.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.error(key, f"{key} is {shown(value)}", f"Give a whole number from {low} on, without quotes")
            return None
        return value

    def quantity(
        self,
        key: str,
        dimension: str,
        low: float | None = None,
        above: float | None = None,
        required: bool = False,
    ) -> float | None:
        """Give an SI value not below `low` and greater than `above`."""
        value = self._get(key, required, f"Add {key}, a {dimension} with its unit")
        if value is None:
            return None
        try:
            number = parse_quantity(value, dimension)
        except UnitError as error:
            self.error(key, f"{key}: {error}", f"Give a {dimension} as number and unit in quotes")
            return None
        if (low is not None and number < low) or (above is not None and number <= above):
            bound = f"not below {low:g}" if low is not None else f"above {above:g}"
            self.error(key, f"{key} is {shown(value)}", f"It must be {bound}")
            return None
        return number


def key_lines(text: str) -> dict[Path, int]:
    """Map the path of every table and key to its line (1-based)."""
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
    """Say where `path` stands: ``"line 14, [channels.X1A] sensitivity"``."""
    words = _spell(path)
    at: Path = path
    while at and at not in lines:
        at = at[:-1]
    return f"line {lines[at]}, {words}" if at else words


def _spell(path: Path) -> str:
    if len(path) == 1:
        return str(path[0])
    if path and path[0] == "runs" and len(path) > 1 and isinstance(path[1], int):
        rest = "".join(f" {p}" for p in path[2:])
        return f"[[runs]] no. {path[1] + 1}{rest}"
    table = ".".join(str(p) for p in path[:-1])
    return f"[{table}] {path[-1]}" if table not in {"channels"} else f"[channels.{path[-1]}]"
