"""The keys of a manifest: one line each, from which it is read, drafted by `tpjb init` and documented."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from rigdata.calibration import DIMENSIONS, UNCALIBRATED
from rigdata.near_names import hint
from rigdata.operating_point import ROTATIONS
from rigdata.problem import Problem, Severity, shown
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
_QUANTITIES = (*DIMENSIONS, *UNCALIBRATED, "ignore")
KINDS = ("dynamic", "dry_pivot", "locus", "clearance", "baseline")
#: How a dynamic run is excited.
_EXCITATIONS = ("sine", "multisine", "sweep", "random", "impact")
_BRANCHES = ("up", "down", "cycle")

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
    meaning: str
    example: str
    default: Any = None
    required: bool = False
    choices: tuple[Any, ...] = ()
    low: float = -math.inf  #: bounds in SI: from, to; `above` and `below` exclude their ends
    high: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    remedy: str = ""  #: what to do about a wrong value, where kind and bounds alone do not say it

    def holds(self, value: float) -> bool:
        """Whether a number is within the bounds."""
        return self.low <= value <= self.high and self.above < value < self.below

    def read(self, value: Any) -> Any:
        """The value in SI; UnitError where it is none."""
        stated = shown(value)
        if self.kind in _RAW:
            return value
        if self.kind in ("text", "choice"):
            is_good = isinstance(value, str) and len(value) <= _MAX_TEXT and "\0" not in value
            fault = "is not text that can be used: too long, a NUL in it, or without quotes"
        elif self.kind == "list":
            is_good = isinstance(value, list) and bool(value)
            is_good = is_good and all(isinstance(text, str) and text.strip() for text in value)
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
            raise UnitError(f"{stated} {fault}")
        if self.choices and value not in self.choices:
            raise UnitError(f"{stated} is unknown")
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


TOP = (
    Field("schema", "choice", "name of the format", '"tpjb-rig/1"', required=True, choices=(SCHEMA,)),
    Field("id", "text", "name of the campaign", '"rocker-A"', "", required=True),
    Field("bearing", "text", "bearing file in the folder; HDF5: root attribute", '"rocker.toml"', "", required=True),
    Field("description", "text", "free text", '"after overhaul"', default=""),
    Field("date", "text", "when it was measured", '"2026-03-12"', default=""),
    Field("by", "text", "laboratory and person", '"TU Chemnitz, K. Sato"', default=""),
    *(Field(key, "table", "", "") for key in ("shaft", "housing", "acquisition", "csv", "channels", "runs")),
)
SHAFT = (Field("rotation", "choice", "sense of turning", '"clockwise"', default=ROTATIONS[0], choices=ROTATIONS),)
HOUSING = (
    Field("mass", "mass", "stator mass between oil film and load cells", '"30 kg"', default=math.nan, low=0.0),
    Field("mass_uncertainty", "mass", "of the mass", '"0.5 kg"', default=0.0, low=0.0),
    Field(
        "mount",
        "choice",
        "on its load cells, or hung on stingers; else found in the records",
        '"floating"',
        choices=("floating", "cells"),
    ),
)
ACQUISITION = (
    Field("sample_rate", "frequency", "where the records hold no times", '"2 kHz"', above=0.0),
    Field(
        "mains",
        "frequency",
        "50 or 60 Hz; else found in the records",
        '"60 Hz"',
        choices=MAINS_FREQUENCIES,
        remedy='Give "50 Hz" or "60 Hz"',
    ),
)
CSV = (
    Field("delimiter", "text", 'one character, or "tab"', '";"'),
    Field("decimal", "text", ". or ,", '","', choices=(".", ",")),
    Field("encoding", "text", "of the text", '"cp1252"'),
    Field("header_line", "whole", "line of the column names, from 1", "7", low=1, high=1e7),
    Field("units_line", "whole", "line of the units", "8", low=1, high=1e7),
    Field("names", "list", "of the columns, where the files name none", '["time", "X1A"]'),
)
CHANNEL = (
    Field("like", "text", "a sensor of the same type: its entries but axis, pad and position", '"L1H"'),
    Field("quantity", "choice", "what the column holds", '"displacement"', required=True, choices=_QUANTITIES),
    Field("axis", "angle", "direction of the positive quantity, counter-clockwise from +X", '"45 deg"'),
    Field("unit", "text", "of the readings; V, mA, mV/V, or an engineering unit if already converted", '"V"'),
    Field("sensitivity", "calibration", "reading per quantity; of a bridge: mV/V at full scale", '"7.78 mV/um"'),
    Field("full_scale", "calibration", "of a bridge", '"20 kN"'),
    Field("excitation", "calibration", "supply of a bridge", '"5 V"'),
    Field(
        "polarity", "sign", "-1: the reading falls as the quantity grows (eddy-current probes)", "-1",
        default=1, choices=(1, -1), remedy="Give 1 or -1, without quotes",
    ),
    Field("zero", "calibration", "value at reading zero", '"0 degC"'),
    Field("pad", "whole", "number of the pad with the sensor", "1", low=1, high=100),
    Field(
        "position", "ratio", "fraction of the arc from the leading edge", "0.75",
        low=0.0, high=1.0, remedy="It is the fraction of the arc, 0 to 1",
    ),
    Field(
        "uncertainty", "ratio", "of the calibration", '"1 %"',
        low=0.0, below=1.0, remedy='Give e.g. "1 %", below 100 %',
    ),
    Field("axis_uncertainty", "angle", "of the axis", '"0.5 deg"', default=0.0, low=0.0),
    Field("zero_uncertainty", "calibration", "of the zero", '"50 N"', default=0.0, low=0.0),
    Field(
        "delay", "time", "recorded later than the others by this; taken out", '"0.2 ms"', default=0.0,
        low=-10.0, high=10.0, remedy="It must be below 10 s",
    ),
    Field("delay_uncertainty", "time", "shared by channels of a clock or quantity", '"0.02 ms"', default=0.0, low=0.0),
    Field("filter", "text", "bessel or butterworth, order, low or high, corner; taken out", '"bessel 4 low 800 Hz"'),
    Field("filter_table", "text", "file of the measured response: frequency_Hz, gain, phase_deg", '"l1h.csv"'),
    Field("clock", "text", "channels recorded by one device share a letter", '"B"', default=""),
    Field("sample_rate", "frequency", "of a device without times of its own", '"500 Hz"', above=0.0),
    Field("plane", "length", "axial distance from the film's middle; two planes at most", '"12 mm"', default=0.0),
    Field("temperature_coefficient", "per kelvin", "change of the gain; taken out", '"-0.02 %/K"', default=0.0),
    Field("temperature_coefficient_uncertainty", "per kelvin", "of that", '"0.01 %/K"', default=0.0, low=0.0),
    Field("temperature_reference", "temperature", "of the gain; else the runs' mean", '"20 degC"', low=0.0),
    Field("for", "tables", "other entries for some runs: `[[channels.NAME.for]]`", 'runs = ["p-*"]'),
)  # fmt: skip
#: Of one entry of `for`, besides all keys of a channel that it changes.
RUNS_OF = Field("runs", "list", "ids of runs; * stands for any characters", '["p-*", "c-1"]', required=True)
RUN = (
    Field("id", "text", "name of the run", '"d-05000-25-03"', required=True),
    Field("file", "text", "record in the folder; HDF5: the group /runs/ID", '"runs/d-05000-25-03.csv"', default=""),
    Field("kind", "choice", "what was done", '"dynamic"', required=True, choices=KINDS),
    Field("shaft_speed", "speed", "of the shaft, set point", '"22 Hz"', default=0.0, low=0.0),
    Field("static_load", "force", "set point, per bearing", '"5 kN"', default=0.0, low=0.0),
    Field("static_load_direction", "angle", "where it pushes the shaft; down is -90 deg", '"-90 deg"', -math.pi / 2),
    Field("excitation_frequency", "speed", "of a sine", '"25 Hz"', default=0.0, above=0.0),
    Field("excitation_direction", "angle", "of the force", '"54 deg"'),
    Field("excitation", "choice", "its course in time", '"sweep"', default="sine", choices=_EXCITATIONS),
    Field("excitation_band", "text", "in place of the frequency, where it is no sine", '"5..120 Hz"'),
    Field("pad", "whole", "number of the pad that a dry test loads, without quotes", "1", low=1, high=100),
    Field("branch", "choice", "of a dry test's load", '"cycle"', default="up", choices=_BRANCHES),
    Field("sample_rate", "frequency", "of this run", '"500 Hz"', above=0.0),
    Field("rotation", "choice", "of this run; default the shaft's", '"clockwise"', choices=ROTATIONS),
    Field("temperature", "temperature", "at the probes; else the mean of the thermometers", '"46 degC"', low=0.0),
)


def open_paths(data: object, path: Path = ()) -> list[Path]:
    """Paths of all values that are still open, in tables and lists of tables."""
    if isinstance(data, str):
        return [path] if data.startswith(MARK) and path[-1] not in ("description", "id") else []
    if len(path) > 3:
        return []
    entries: list[tuple[str | int, object]] = []
    if isinstance(data, dict):
        entries = list(data.items())
    elif isinstance(data, list) and path == ("runs",):
        entries = list(enumerate(data))
    places: list[Path] = []
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


class Findings:
    """The problems of one manifest, with their lines."""

    def __init__(self, file: str, lines: dict[Path, int], files: TextFile | None = None) -> None:
        self.file, self.lines, self.files = file, lines, files
        self.problems: list[Problem] = []
        self.errors = 0
        self.open: tuple[Path, ...] = ()

    def note_open(self, paths: Collection[Path]) -> None:
        """Note the places that are still open, all in one; what follows from them is not told."""
        if not paths:
            return
        first = min((self.lines[path] for path in paths if path in self.lines), default=0)
        remedy = "Fill them in, then `tpjb init FOLDER --update` adds what follows from them"
        self.append(Problem("error", self.file, f"line {first} and on", open_summary(paths), remedy))
        self.open = tuple(paths)

    def error(self, path: Path, what: str, cure: str, run: str | None = None, severity: Severity = "error") -> None:
        """Note an error, or something less severe, of the key at `path`."""
        if any(place[: len(path)] == path for place in self.open):
            self.errors += severity == "error"
            return
        place, at = _spell(path), path
        while at and at not in self.lines:
            at = at[:-1]
        if at:
            place = f"line {self.lines[at]}, {place}"
        self.append(Problem(severity, self.file, place, what, cure, run))

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

    def error(self, key: str, what: str, cure: str) -> None:
        """Note an error of `key`."""
        self.findings.error(self.origins.get(key, (*self.path, key)), what, cure)

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
            self.error(key, f"{key}: {error}", field.advice(value))
            return field.default

    @contextmanager
    def noted(self, key: str, remedy: str) -> Iterator[None]:
        """Note a UnitError of the block as an error of `key`."""
        try:
            yield
        except UnitError as error:
            self.error(key, f"{key}: {error}", remedy)


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


def _spell(path: Path) -> str:
    """``"[channels.X1A] sensitivity"``."""
    if len(path) == 1:
        return str(path[0])
    for at, number in enumerate(path):
        if isinstance(number, int):
            keys = "".join(f" {p}" for p in path[at + 1 :])
            return f"[[{'.'.join(str(p) for p in path[:at])}]] no. {number + 1}{keys}"
    table = ".".join(str(p) for p in path[:-1])
    return f"[channels.{path[-1]}]" if table == "channels" else f"[{table}] {path[-1]}"
