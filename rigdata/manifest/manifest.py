"""The manifest of a campaign (`campaign.toml`): parsed and checked as a whole, every problem at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigdata.calibration import Channel
from rigdata.manifest.channels import TextFile, read_channels
from rigdata.manifest.channels_of_runs import channels_by_run
from rigdata.manifest.fields import (
    ACQUISITION,
    CSV,
    HOUSING,
    MAINS_FREQUENCIES,
    SHAFT,
    TOP,
    Findings,
    Table,
    key_lines,
    open_paths,
)
from rigdata.manifest.runs import RunEntry, read_runs
from rigdata.problem import Problem, RigDataError, refuse

_SCHEMA = "tpjb-rig/1"
#: Larger manifests are refused before they are parsed [bytes].
MAX_MANIFEST = 4 * 2**20
#: Longer lines, and lines with more dots outside quotes, are refused.
_MAX_LINE, _MAX_DOTS = 40_000, 100
_QUOTED = re.compile(r'"[^"\\]*"|\'[^\']*\'')


@dataclass(frozen=True)
class CsvSpec:
    """What the manifest says of the CSV dialect; None is detected."""

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_line: int | None = None
    units_line: int | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Manifest:
    """A checked manifest, SI."""

    id: str
    bearing: str
    description: str
    housing_mass: float
    sample_rate: float | None
    csv: CsvSpec
    channels: Mapping[str, Channel] = field(repr=False)
    runs: tuple[RunEntry, ...] = field(repr=False)
    notes: tuple[Problem, ...] = ()
    mass_uncertainty: float = 0.0
    mains: float | None = None
    rotation: str = "counter-clockwise"
    mount: str | None = None
    date: str = ""
    by: str = ""
    described: Mapping[str, Mapping[str, Channel]] = field(default_factory=dict, repr=False)  #: by run, if other


def parse_manifest(text: str, file: str = "campaign.toml", files: TextFile | None = None) -> Manifest:
    """Read and check the text of a manifest."""
    data = _load_toml(text, file)
    findings = Findings(file, key_lines(text))
    findings.note_open(open_paths(data))
    top = Table(data, (), findings)
    header = top.read(TOP, "the manifest")
    if header["schema"] not in (None, _SCHEMA):
        message = f"schema is {header['schema']!r}, not {_SCHEMA!r}"
        findings.error(("schema",), message, "Export in the format tpjb-rig/1")
    tables = top.subtable("channels")
    channels = read_channels(tables, findings, files)
    runs = read_runs(data.get("runs"), findings)
    described = channels_by_run(tables, channels, [run.id for run in runs], files)
    excited = any(run.kind in {"dynamic", "baseline"} for run in runs)
    housing = top.subtable("housing").read(HOUSING, "[housing]", ["mass"] if excited else [])
    acquisition = top.subtable("acquisition").read(ACQUISITION, "[acquisition]")
    mains = acquisition["mains"]
    if mains not in (None, *MAINS_FREQUENCIES):
        findings.error(("acquisition", "mains"), f"mains is {mains:g} Hz", 'Give "50 Hz" or "60 Hz"')
    manifest = Manifest(
        id=header["id"] or "",
        bearing=header["bearing"] or "",
        description=header["description"],
        housing_mass=housing["mass"],
        sample_rate=acquisition["sample_rate"],
        csv=_read_csv(top.subtable("csv")),
        channels=channels,
        runs=runs,
        notes=tuple(p for p in findings.problems if p.severity != "error"),
        mass_uncertainty=housing["mass_uncertainty"],
        mains=mains,
        rotation=top.subtable("shaft").read(SHAFT, "[shaft]")["rotation"],
        mount=housing["mount"],
        date=header["date"],
        by=header["by"],
        described=described,
    )
    if findings.errors:
        raise RigDataError(findings.problems)
    return manifest


def _load_toml(text: str, file: str) -> dict[str, Any]:
    if len(text) > MAX_MANIFEST:
        raise refuse(file, "", f"the manifest is larger than {MAX_MANIFEST >> 20} MB", "Is it the right file?")
    for number, line in enumerate(text.split("\n"), start=1):
        # Dotted keys nest as deeply as they are long, and parsing them takes the square of it.
        if len(line) > _MAX_LINE or (line.count(".") > _MAX_DOTS and _QUOTED.sub("", line).count(".") > _MAX_DOTS):
            message = "the line is far too long, or nests far too deeply"
            raise refuse(file, f"line {number}", message, "Shorten or break it")
    cure = "Repair the TOML at this place"
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise refuse(file, "", f"not valid TOML: {error}", cure) from error
    except (RecursionError, ValueError) as error:  # deep nesting; integers of thousands of digits
        message = f"not usable TOML: {type(error).__name__}, nested too deep or a number too long"
        raise refuse(file, "", message, cure) from error


def _read_csv(table: Table) -> CsvSpec:
    values = table.read(CSV, "[csv]")
    if values["delimiter"] in {"\\t", "tab", "TAB"}:
        values["delimiter"] = "\t"
    delimiter, decimal = values["delimiter"], values["decimal"]
    if delimiter is not None and len(delimiter) != 1:
        table.error("delimiter", f"delimiter is {delimiter!r}", "Give one character")
    if decimal is not None and decimal not in (".", ","):
        table.error("decimal", f"decimal is {decimal!r}", "Give one character, . or ,")
    if delimiter is not None and delimiter in '0123456789+-.eE"\r\n':
        table.error("delimiter", f"delimiter {delimiter!r} cannot part numbers", 'Give e.g. ";"')
    if delimiter is not None and delimiter == decimal:
        table.error("decimal", f"delimiter and decimal are both {decimal!r}", "They must differ")
    header, units = values["header_line"], values["units_line"]
    if header is not None and units is not None and units <= header:
        table.error("units_line", f"units_line {units} is not below header_line {header}", "Lines count from 1")
    names = values["names"] or []
    if not isinstance(names, list) or not all(isinstance(n, str) and n.strip() for n in names):
        table.error("names", "names is no list of texts", 'Write names = ["time", "X1A", ..], one per column')
        names = []
    values["names"] = tuple(names)
    values["encoding"] = _codec(table, values["encoding"])
    return CsvSpec(**values)


def _codec(table: Table, encoding: str | None) -> str | None:
    if encoding is None:
        return None
    import codecs

    try:
        info = codecs.lookup(encoding)
        text = "0,5;1\n"
        usable = info.decode(text.encode(encoding))[0].lstrip("\ufeff") == text
    except (LookupError, TypeError, ValueError, AttributeError):
        usable = False
    if not usable:
        table.error(
            "encoding",
            f"encoding {encoding!r} is not known as a text encoding",
            'Give e.g. "cp1252" or "utf-8", or leave it out: it is then detected',
        )
        return None
    return info.name
