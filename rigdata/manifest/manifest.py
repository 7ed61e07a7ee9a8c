"""The manifest of a campaign (`campaign.toml`): parsed and checked as a whole, every problem at once."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigdata.calibration import Channel
from rigdata.manifest.channels import TextFile, read_channels
from rigdata.manifest.runs import RunEntry, read_runs
from rigdata.manifest.table import Findings, Table, key_lines
from rigdata.problem import Problem, RigDataError, refuse

SCHEMA = "tpjb-rig/1"
#: Frequencies of the mains in any country [Hz].
MAINS_FREQUENCIES = (50.0, 60.0)
#: Larger manifests are refused before they are parsed [bytes].
MAX_MANIFEST = 4 * 2**20
#: Longer lines, and lines with more dots outside quotes, are refused.
MAX_LINE, MAX_DOTS = 40_000, 100
_QUOTED = re.compile(r'"[^"\\]*"|\'[^\']*\'')
_TOP = ("schema", "id", "bearing", "description", "housing", "acquisition", "csv", "channels", "runs")
_CSV = ("delimiter", "decimal", "encoding", "header_line", "units_line", "names")


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


def parse_manifest(text: str, file: str = "campaign.toml", files: TextFile | None = None) -> Manifest:
    """Read and check the text of a manifest."""
    data = _load_toml(text, file)
    findings = Findings(file, key_lines(text))
    top = Table(data, (), findings)
    top.only(_TOP, "the manifest")
    schema = top.text("schema", required=True)
    if schema is not None and schema != SCHEMA:
        findings.error(("schema",), f"schema is {schema!r}, not {SCHEMA!r}", "Export in the format tpjb-rig/1")
    channels = read_channels(top.subtable("channels"), findings, files)
    runs = read_runs(data.get("runs"), findings)
    housing = top.subtable("housing")
    housing.only(("mass", "mass_uncertainty"), "[housing]")
    mass = housing.quantity("mass", "mass", low=0.0, required=any(r.kind in {"dynamic", "baseline"} for r in runs))
    acquisition = top.subtable("acquisition")
    acquisition.only(("sample_rate", "mains"), "[acquisition]")
    rate = acquisition.quantity("sample_rate", "frequency", above=0.0)
    manifest = Manifest(
        id=top.text("id", required=True) or "",
        bearing=top.text("bearing", required=True) or "",
        description=top.text("description") or "",
        housing_mass=math.nan if mass is None else mass,
        sample_rate=rate,
        csv=_read_csv(top.subtable("csv"), findings),
        channels=channels,
        runs=runs,
        notes=tuple(p for p in findings.problems if p.severity != "error"),
        mass_uncertainty=housing.quantity("mass_uncertainty", "mass", low=0.0) or 0.0,
        mains=_mains(acquisition),
    )
    if findings.failed:
        raise RigDataError(findings.problems)
    return manifest


def _mains(table: Table) -> float | None:
    value = table.quantity("mains", "frequency", low=0.0)
    if value is not None and value not in MAINS_FREQUENCIES:
        table.error("mains", f"mains is {value:g} Hz", 'Give "50 Hz" or "60 Hz"')
        return None
    return value


def _load_toml(text: str, file: str) -> dict[str, Any]:
    if len(text) > MAX_MANIFEST:
        raise refuse(file, "", f"the manifest is larger than {MAX_MANIFEST >> 20} MB", "Is it the right file?")
    for number, line in enumerate(text.split("\n"), start=1):
        # Dotted keys nest as deeply as they are long, and parsing them takes the square of it.
        if len(line) > MAX_LINE or (line.count(".") > MAX_DOTS and _QUOTED.sub("", line).count(".") > MAX_DOTS):
            what = "the line is far too long, or nests far too deeply"
            raise refuse(file, f"line {number}", what, "Shorten or break it")
    cure = "Mend the TOML at this place"
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise refuse(file, "", f"not valid TOML: {error}", cure) from error
    except (RecursionError, ValueError) as error:  # deep nesting; integers of thousands of digits
        what = f"not usable TOML: {type(error).__name__}, nested too deep or a number too long"
        raise refuse(file, "", what, cure) from error


def _read_csv(table: Table, findings: Findings) -> CsvSpec:
    table.only(_CSV, "[csv]")
    delimiter, decimal = table.text("delimiter"), table.text("decimal")
    if delimiter in {"\\t", "tab", "TAB"}:
        delimiter = "\t"
    for key, value, allowed in (("delimiter", delimiter, None), ("decimal", decimal, ".,")):
        if value is not None and (len(value) != 1 or (allowed and value not in allowed)):
            findings.error(("csv", key), f"{key} is {value!r}", "Give one character" + (", . or ," if allowed else ""))
    if delimiter is not None and delimiter in '0123456789+-.eE"\r\n':
        findings.error(("csv", "delimiter"), f"delimiter {delimiter!r} cannot part numbers", 'Give e.g. ";"')
    if delimiter is not None and delimiter == decimal:
        findings.error(("csv", "decimal"), f"delimiter and decimal are both {decimal!r}", "They must differ")
    header, units = table.integer("header_line", low=1), table.integer("units_line", low=1)
    if header is not None and units is not None and units <= header:
        findings.error(
            ("csv", "units_line", "names"),
            f"units_line {units} is not below header_line {header}",
            "Lines count from 1",
        )
    names = table.data.get("names", [])
    if not isinstance(names, list) or not all(isinstance(n, str) and n.strip() for n in names):
        findings.error(
            ("csv", "names"), "names is no list of texts", 'Write names = ["time", "X1A", ..], one per column'
        )
        names = []
    return CsvSpec(delimiter, decimal, _codec(table.text("encoding"), findings), header, units, tuple(names))


def _codec(encoding: str | None, findings: Findings) -> str | None:
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
        findings.error(
            ("csv", "encoding"),
            f"encoding {encoding!r} is not known as a text encoding",
            'Give e.g. "cp1252" or "utf-8", or leave it out: it is then detected',
        )
        return None
    return info.name
