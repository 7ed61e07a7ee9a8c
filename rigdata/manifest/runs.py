"""The ``[[runs]]`` tables of a manifest."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from rigdata.manifest.table import Findings, Table, shown
from rigdata.operating_point import OperatingPoint
from rigdata.units import UnitError, parse_quantity

KINDS = ("dynamic", "dry_pivot", "locus", "clearance", "baseline")
#: How a dynamic run is excited.
EXCITATIONS = ("sine", "multisine", "sweep", "random", "impact")
BRANCHES = ("up", "down", "cycle")
_KEYS = (
    "id",
    "file",
    "kind",
    "shaft_speed",
    "static_load",
    "static_load_direction",
    "excitation_frequency",
    "excitation_direction",
    "pad",
    "branch",
    "sample_rate",
    "excitation",
    "excitation_band",
)
_NEEDED = {
    "dynamic": ("shaft_speed", "static_load", "static_load_direction", "excitation_frequency"),
    "locus": ("shaft_speed", "static_load", "static_load_direction"),
    "dry_pivot": ("pad",),
    "clearance": (),
    "baseline": ("excitation_frequency",),
}
#: What a run needs in place of a frequency where it is no sine.
_BAND_NEEDED = {"excitation_frequency": "excitation_band"}
_ID = re.compile(r"[\w][\w .+=@-]{0,199}")
_MAX_RUNS = 100_000


@dataclass(frozen=True)
class RunEntry:
    """One run as the manifest states it, SI."""

    id: str
    kind: str
    file: str
    point: OperatingPoint
    excitation_direction: float | None
    pad: int | None
    branch: str
    sample_rate: float | None
    stated: frozenset[str]
    index: int
    excitation: str = "sine"
    band: tuple[float, float] | None = None


def read_runs(data: object, findings: Findings) -> tuple[RunEntry, ...]:
    """Read every run; what is wrong is noted in `findings`, and that run left out."""
    if not isinstance(data, list) or not data:
        findings.error(("runs",), "no runs are listed", "Add a [[runs]] table per record")
        return ()
    if len(data) > _MAX_RUNS:
        findings.error(("runs",), f"more than {_MAX_RUNS} runs", "Split the campaign")
        return ()
    runs: list[RunEntry] = []
    seen: dict[str, int] = {}
    for index, entry in enumerate(data):
        before = len(findings.problems)
        run = _read_run(Table(entry, ("runs", index), findings), index)
        if run is not None and run.id in seen:
            what = f"run id {shown(run.id)} is used twice, also by run no. {seen[run.id] + 1}"
            findings.error(("runs", index, "id"), what, "Give every run its own id", run.id)
        if run is not None and not any(p.severity == "error" for p in findings.problems[before:]):
            runs.append(run)
        if run is not None:
            seen.setdefault(run.id, index)
    return tuple(runs)


def _read_run(table: Table, index: int) -> RunEntry | None:
    table.only(_KEYS, "[[runs]]")
    name = table.text("id", required=True)
    if name is not None and not _ID.fullmatch(name):
        table.error("id", f"run id {shown(name)} cannot be used", "Use letters, digits, '-', '_' and '.'")
    kind = table.choice("kind", KINDS, required=True)
    excitation = table.choice("excitation", EXCITATIONS) or "sine"
    for key in _NEEDED.get(kind or "", ()):
        key = key if excitation == "sine" else _BAND_NEEDED.get(key, key)
        if key not in table.data:
            table.error(key, f"{key} is missing in a {kind} run", f"Add {key} to this run")
    file = table.text("file")
    point = OperatingPoint(
        static_load=_quantity(table, "static_load", "force", low=0.0),
        static_load_direction=_quantity(table, "static_load_direction", "angle", default=-math.pi / 2),
        shaft_speed=_quantity(table, "shaft_speed", "speed", low=0.0),
        excitation=_quantity(table, "excitation_frequency", "speed", above=0.0),
    )
    direction = table.quantity("excitation_direction", "angle")
    pad = table.integer("pad", low=1, high=100)
    branch = table.choice("branch", BRANCHES) or "up"
    rate = table.quantity("sample_rate", "frequency", above=0.0)
    if name is None or kind is None:
        return None
    stated = frozenset(table.data)
    band = _band(table)
    return RunEntry(
        name, kind, file or "", point, direction, pad, branch, rate, stated, index, excitation=excitation, band=band
    )


def _band(table: Table) -> tuple[float, float] | None:
    """``"5..120 Hz"`` as two frequencies [Hz]."""
    text = table.text("excitation_band")
    if text is None:
        return None
    low, dots, high = text.partition("..")
    unit = high.strip().lstrip("0123456789.,+-eE").strip()
    try:
        ends = tuple(parse_quantity(f"{end.strip()} {unit}", "frequency") for end in (low, high.strip()[: -len(unit)]))
    except UnitError:
        ends = (0.0, 0.0)
    if not dots or not 0 < ends[0] < ends[1] < 1e12:
        table.error("excitation_band", f"excitation_band is {shown(text)}", 'Give e.g. "5..120 Hz", lowest first')
        return None
    return ends[0], ends[1]


def _quantity(
    table: Table,
    key: str,
    dimension: str,
    low: float | None = None,
    above: float | None = None,
    default: float = 0.0,
) -> float:
    value = table.quantity(key, dimension, low=low, above=above)
    return default if value is None else value
