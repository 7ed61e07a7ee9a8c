"""The manifest of a campaign (`campaign.toml`): parsed and checked as a whole, every problem at once."""

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass

from rigdata.calibration import Channels
from rigdata.manifest.channels import channels_by_run, read_channels
from rigdata.manifest.fields import (
    ACQUISITION,
    CSV,
    HOUSING,
    RUN,
    SHAFT,
    TOP,
    Findings,
    Table,
    TextFile,
    key_lines,
    open_paths,
)
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError, parse_toml, refuse, shown
from rigdata.units import UnitError, parse_quantity, split_quantity

_ID = re.compile(r"[\w][\w .+=@-]{0,199}")
_MAX_RUNS = 100_000
#: Larger manifests are refused before they are parsed [bytes].
MAX_MANIFEST = 4 * 2**20


@dataclass(frozen=True, kw_only=True)
class RunDescription:
    """What a manifest says of a run, SI."""

    id: str
    kind: str
    point: OperatingPoint
    excitation_direction: float | None
    pad: int | None
    branch: str
    stated: frozenset[str]
    excitation_kind: str = "sine"
    band: tuple[float, float] | None = None
    temperature: float | None = None


@dataclass(frozen=True, kw_only=True)
class RunEntry(RunDescription):
    """A run and where its record is."""

    file: str
    sample_rate: float | None
    index: int


def _read_runs(top: Table, rotation: str) -> tuple[RunEntry, ...]:
    """Read every run, of this rotation if it states none; what is wrong is noted."""
    data, findings = top.data.get("runs"), top.findings
    if not isinstance(data, list) or not data:
        findings.error(("runs",), "no runs are listed", "Add a [[runs]] table per record")
        return ()
    if len(data) > _MAX_RUNS:
        findings.error(("runs",), f"more than {_MAX_RUNS} runs", "Split the campaign")
        return ()
    runs = []
    first: dict[str, int] = {}
    for index, entry in enumerate(data):
        run = _read_run(Table(entry, ("runs", index), findings), index, rotation)
        if run is None:
            continue
        if run.id in first:
            message = f"run id {shown(run.id)} is used twice, also by run no. {first[run.id] + 1}"
            findings.error(("runs", index, "id"), message, "Give every run its own id", run.id)
        runs.append(run)
        first.setdefault(run.id, index)
    return tuple(runs)


def _read_run(table: Table, index: int, rotation: str) -> RunEntry | None:
    needed = [field.key for field in RUN if table.data.get("kind") in field.needed_by]
    if table.data.get("excitation", "sine") != "sine":
        needed = [key.replace("excitation_frequency", "excitation_band") for key in needed]
    values = table.read(RUN, needed)
    name, kind = values["id"], values["kind"]
    if name is not None and not _ID.fullmatch(name):
        table.error("id", f"run id {shown(name)} cannot be used", "Use letters, digits, '-', '_' and '.'")
    band = _band(table, values["excitation_band"])
    if name is None or kind is None:
        return None
    point = OperatingPoint(
        values["static_load"],
        values["static_load_direction"],
        values["shaft_speed"],
        values["excitation_frequency"],
        values["rotation"] or rotation,
    )
    plain = {key: value for key, value in values.items() if key in RunEntry.__dataclass_fields__}
    plain |= {"excitation_kind": values["excitation"], "stated": frozenset(table.data)}
    return RunEntry(**plain, point=point, index=index, band=band)


def _band(table: Table, text: str | None) -> tuple[float, float] | None:
    """``"5..120 Hz"`` as two frequencies [Hz]."""
    if text is None:
        return None
    low, _, high = text.partition("..")
    with table.noted("excitation_band", 'Give e.g. "5..120 Hz", lowest first'):
        _, unit = split_quantity(high, "frequency")
        first, last = parse_quantity(f"{low} {unit}", "frequency"), parse_quantity(high, "frequency")
        if 0 < first < last < 1e12:
            return first, last
        raise UnitError(f"{shown(text)} is no band")
    return None


@dataclass(frozen=True)
class CsvSpec:
    """What the manifest says of the CSV dialect; None is detected."""

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_line: int | None = None
    units_line: int | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a manifest says of the whole campaign, SI."""

    id: str
    description: str
    bearing_name: str
    housing_mass: float
    channels: Channels
    notes: tuple[Problem, ...]
    mass_uncertainty: float
    mains: float | None
    rotation: str
    mount: str | None
    date: str
    by: str


@dataclass(frozen=True, kw_only=True)
class Manifest(Description):
    """A checked manifest, SI."""

    sample_rate: float | None
    csv: CsvSpec
    runs: tuple[RunEntry, ...]
    described: Mapping[str, Channels]  #: by run, if other


def _no_files(name: str, place: str) -> str:
    raise UnitError("a table cannot be read here")


def parse_manifest(text: str, file: str = "campaign.toml", files: TextFile = _no_files) -> Manifest:
    """Read and check the text of a manifest."""
    if len(text) > MAX_MANIFEST:
        raise refuse(file, "", f"the manifest is larger than {MAX_MANIFEST >> 20} MB", "Is it the right file?")
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise refuse(file, "", f"not valid TOML: {error}", "Repair the TOML at this place") from error
    schema = str(data.get("schema"))
    if schema.startswith("tpjb-") and not schema.startswith("tpjb-rig/"):
        fault = f"is of the schema {shown(schema)}, not the manifest of a campaign"
        raise refuse(file, "", fault, "Give the folder that holds campaign.toml")
    findings = Findings(file, key_lines(text), files)
    findings.note_open(open_paths(data))
    top = Table(data, (), findings)
    values, tables = top.read(TOP), top.subtable("channels")
    channels = read_channels(tables)
    values |= top.subtable("shaft").read(SHAFT)
    runs = _read_runs(top, values["rotation"])
    described = channels_by_run(tables, channels, [run.id for run in runs])
    excited = any(run.kind in {"dynamic", "baseline"} for run in runs)
    values |= top.subtable("housing").read(HOUSING, ["mass"] if excited else [])
    values |= top.subtable("acquisition").read(ACQUISITION)
    values |= {"bearing_name": values["bearing"], "housing_mass": values["mass"], "csv": _read_csv(top.subtable("csv"))}
    values |= {"channels": channels, "runs": runs, "described": described}
    values["notes"] = tuple(problem for problem in findings.problems if problem.severity != "error")
    manifest = Manifest(**{name: values[name] for name in Manifest.__dataclass_fields__})
    if findings.errors:
        raise RigDataError(findings.problems)
    return manifest


def _read_csv(table: Table) -> CsvSpec:
    values = table.read(CSV)
    if values["delimiter"] in {"\\t", "tab", "TAB"}:
        values["delimiter"] = "\t"
    delimiter, decimal = values["delimiter"], values["decimal"]
    if delimiter is not None and (len(delimiter) != 1 or delimiter in f'0123456789+-.eE"\r\n{decimal}'):
        table.error("delimiter", f"delimiter {delimiter!r} cannot part numbers", 'Give one character, e.g. ";"')
    header, units = values["header_line"], values["units_line"]
    if header is not None and units is not None and units <= header:
        table.error("units_line", f"units_line {units} is not below header_line {header}", "Lines count from 1")
    values["names"] = tuple(values["names"] or ())
    encoding = values["encoding"]
    if encoding is not None:
        try:
            values["encoding"] = codecs.lookup(encoding).name
            is_text = "0,5;1\n".encode(encoding).decode(encoding).lstrip("\ufeff") == "0,5;1\n"
        except (LookupError, TypeError, ValueError, AttributeError):
            is_text = False
        if not is_text:
            table.error("encoding", f"{encoding!r} is no encoding of texts", 'Give e.g. "cp1252", or leave it out')
    return CsvSpec(**values)
