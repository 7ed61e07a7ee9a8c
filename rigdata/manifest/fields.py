"""The keys of a manifest by `keys.toml`, from which it is read, drafted by `tpjb init` and documented."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rigdata.near_names import hint
from rigdata.problem import Problem, RigDataError, Severity, shown, tables_beside
from rigdata.units import UnitError, parse_quantity

_MAX_FINDINGS = 1000
_MAX_TEXT = 20_000
_TABLE = re.compile(r"\s*(\[\[?)([^\[\]#]+)\]\]?\s*(?:#.*)?$")
_LONGEST = 1000
_KEY = re.compile(r"\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\s]+)")
Path = tuple[str | int, ...]
#: Gives the text of a file of the campaign, by its name in the manifest; raises RigDataError.
TextFile = Callable[[str, str], str]
#: Frequencies of the mains in any country [Hz].
MAINS_FREQUENCIES = (50.0, 60.0)
SCHEMA = "tpjb-rig/1"

#: Kinds that are not read key by key: what they mean hangs on the quantity, or they hold more than one value.
_RAW = ("table", "tables", "calibration")
#: Begins a value of `tpjb init` that only the person at the rig knows.
MARK = "??"


@dataclass(frozen=True)
class Field:
    """One key of a table: what it holds, what it means, and its default."""

    key: str
    #: A dimension of `rigdata.units`, "text", "choice", "whole" (number), "sign", "list" (of texts), or one of `_RAW`.
    kind: str
    meaning: str = ""
    example: str = ""
    default: Any = None
    required: bool = False
    choices: Sequence[Any] = ()
    low: float = -math.inf  #: bounds in SI: from, to; `above` and `below` exclude their ends
    high: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    remedy: str = ""  #: what to do about a wrong value, where kind and bounds alone do not say it
    needed_by: Sequence[str] = ()  #: kinds of runs; `drafted_for` these besides
    drafted_for: Sequence[str] = ()
    guess: str = ""  #: field of `rigdata.survey.runs.RunGuess`
    unit: str = ""  #: of a draft

    def holds(self, value: float) -> bool:
        """Whether a number is within the bounds."""
        return self.low <= value <= self.high and self.above < value < self.below

    def read(self, value: Any) -> Any:
        """The value in SI; UnitError where it is none."""
        spelling = shown(value)
        if self.kind in _RAW:
            return value
        if self.kind in ("text", "choice"):
            is_good = isinstance(value, str) and len(value) <= _MAX_TEXT and "\0" not in value
            fault = "is not text that can be used: too long, a NUL in it, or without quotes"
        elif self.kind == "list":
            texts = value if isinstance(value, list) else []
            is_good = bool(texts) and all(isinstance(text, str) and text.strip() for text in texts)
            fault = "is no list of texts"
        else:
            number = value
            if self.kind not in ("whole", "sign"):
                number = parse_quantity(value, self.kind)
            is_good = isinstance(number, int | float) and not isinstance(number, bool) and self.holds(number)
            if self.kind == "whole":
                is_good = is_good and isinstance(value, int)
            fault, value = "cannot be", number
        if not is_good:
            raise UnitError(f"{spelling} {fault}")
        if self.choices and value not in self.choices:
            raise UnitError(f"{spelling} is unknown")
        return value

    def advice(self, value: object) -> str:
        """What to do about a wrong value."""
        if self.remedy or self.kind == "choice":
            return self.remedy or nearest(str(value), self.choices)
        if self.kind == "whole":
            return f"Give a whole number from {self.low:g} on, without quotes"
        bound = f", not below {self.low:g}" if self.low > -math.inf else ""
        bound = f", above {self.above:g}" if self.above > -math.inf else bound
        return f"Write it like {self.key} = {self.example}{bound}"


_TABLES = []
for _keys in tables_beside(__file__, "keys.toml").values():
    _TABLES.append(tuple(Field(key, **entry) for key, entry in _keys.items()))
#: `RUNS_OF` is of one entry of `for`, besides all keys of a channel that it changes.
TOP, SHAFT, HOUSING, ACQUISITION, CSV, CHANNEL, (RUNS_OF,), RUN = _TABLES
KINDS = next(tuple(field.choices) for field in RUN if field.key == "kind")


def open_paths(data: object, path: Path = ()) -> list[Path]:
    """Paths of all values that are still open, in tables and lists of tables."""
    if isinstance(data, str):
        return [path] if data.startswith(MARK) and path[-1] not in ("description", "id") else []
    if len(path) > 3:
        return []
    entries = []
    if isinstance(data, dict):
        entries = list(data.items())
    elif isinstance(data, list) and path == ("runs",):
        entries = list(enumerate(data))
    places = []
    for key, value in entries:
        places += open_paths(value, (*path, key))
    return places


def open_summary(paths: Collection[Path]) -> str:
    """How many places of a manifest are open, and of which kinds; "" where none is."""
    counts = Counter(str(path[-1]).replace("_", " ") for path in paths)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.most_common())
    return f"{len(paths)} place{'s' if len(paths) > 1 else ''} open ({MARK}): {kinds}" if paths else ""


def nearest(name: str, choices: Collection[str]) -> str:
    """The nearest of `known`, as the remedy for an unknown `name`."""
    return hint(name.lower(), choices, cutoff=0.4)


@dataclass
class Findings:
    """The problems of one manifest, with their lines."""

    file: str
    lines: dict[Path, int]
    files: TextFile
    problems: list[Problem] = field(default_factory=list)
    errors: int = 0
    open: tuple[Path, ...] = ()

    def note_open(self, paths: Collection[Path]) -> None:
        """Note the places that are still open, all in one; what follows from them is not told."""
        if not paths:
            return
        first = min((self.lines[path] for path in paths if path in self.lines), default=0)
        remedy = "Fill them in, then `tpjb init FOLDER --update` adds what follows from them"
        self.append(Problem("error", self.file, f"line {first} and on", open_summary(paths), remedy))
        self.open = tuple(paths)

    def error(self, path: Path, fault: str, cure: str, run: str | None = None, severity: Severity = "error") -> None:
        """Note an error, or something less severe, of the key at `path`."""
        if any(place[: len(path)] == path for place in self.open):
            self.errors += severity == "error"
            return
        place, at = _spell(path)[:200], path
        while at and at not in self.lines:
            at = at[:-1]
        if at:
            place = f"line {self.lines[at]}, {place}"
        self.append(Problem(severity, self.file, place, fault, cure, run))

    def append(self, problem: Problem) -> None:
        """Note a problem that was found elsewhere."""
        self.errors += problem.severity == "error"
        if len(self.problems) < _MAX_FINDINGS and problem not in self.problems:
            self.problems.append(problem)


class Table:
    """One TOML table; a value that is missing or wrong (then noted) is its field's default."""

    def __init__(self, data: object, path: Path, findings: Findings) -> None:
        self.path = path
        self.findings = findings
        self.data: dict[str, Any] = data if isinstance(data, dict) else {}
        self.origins: dict[str, Path] = {}  # of keys that come from another table
        if not isinstance(data, dict):
            findings.error(path, f"is {shown(data)}, not a table", "Write it as a [table] with keys")

    def subtable(self, key: str) -> Table:
        """The table under `key`, empty where absent."""
        return Table(self.data.get(key, {}), (*self.path, key), self.findings)

    def error(self, key: str, fault: str, cure: str) -> None:
        """Note an error of `key`."""
        self.findings.error(self.origins.get(key, (*self.path, key)), fault, cure)

    def read(self, fields: tuple[Field, ...], needed: Collection[str] = ()) -> dict[str, Any]:
        """The value of every field, SI; keys that are no field are noted."""
        self.only(fields)
        return {field.key: self.value(field, field.key in needed) for field in fields}

    def only(self, fields: tuple[Field, ...]) -> None:
        """Note every key that is no field."""
        choices = [field.key for field in fields]
        for key in self.data:
            if key not in choices:
                self.error(key, f"unknown key {shown(key)}", nearest(key, choices))

    def value(self, field: Field, needed: bool = False) -> Any:
        """The value of one field, SI."""
        key, value = field.key, self.data.get(field.key)
        is_needed = needed or field.required
        if value is None or (is_needed and value == ""):
            if is_needed:
                self.error(key, f"{key} is missing", f"Add {key}, such as {key} = {field.example}")
            return field.default
        try:
            return field.read(value)
        except UnitError as error:
            self.error(key, str(error), field.advice(value))
            return field.default

    @contextmanager
    def noted(self, key: str, remedy: str) -> Iterator[None]:
        """Note a UnitError of the block as an error of `key`, and what another file is refused for."""
        try:
            yield
        except UnitError as error:
            self.error(key, str(error), remedy)
        except RigDataError as error:
            for problem in error.problems:
                self.findings.append(problem)


def key_lines(text: str) -> dict[Path, int]:
    """Line (1-based) of every table and key, by path."""
    lines: dict[Path, int] = {}
    counts = Counter[Path]()
    table: Path = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST:
            continue
        header = _TABLE.match(line)
        if header is not None:
            table = tuple(a or b or c for a, b, c in _PART.findall(header[2]))
            if header[1] == "[[":
                counts[table] += 1
                table = (*table, counts[table] - 1)
            lines.setdefault(table, number)
            continue
        key = _KEY.match(line)
        if key is not None:
            lines.setdefault((*table, key[1].strip("\"'")), number)
    return lines


def _spell(path: Path) -> str:
    """``"[channels.X1A] sensitivity"``."""
    if len(path) == 1:
        return str(path[0])
    for at, number in enumerate(path):
        if isinstance(number, int):
            keys = "".join(f" {p}" for p in path[at + 1 :])
            return f"[[{'.'.join(map(str, path[:at]))}]] no. {number + 1}{keys}"
    table = ".".join(map(str, path[:-1]))
    return f"[channels.{path[-1]}]" if table == "channels" else f"[{table}] {path[-1]}"
