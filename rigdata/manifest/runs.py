"""The ``[[runs]]`` tables of a manifest."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rigdata.manifest.fields import RUN, Findings, Table, shown
from rigdata.operating_point import OperatingPoint
from rigdata.units import UnitError, parse_quantity

_NEEDED = {
    "dynamic": ("shaft_speed", "static_load", "static_load_direction", "excitation_frequency"),
    "locus": ("shaft_speed", "static_load", "static_load_direction"),
    "dry_pivot": ("pad",),
    "clearance": (),
    "baseline": ("excitation_frequency",),
}
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
    rotation: str | None = None
    temperature: float | None = None


def read_runs(data: object, findings: Findings) -> tuple[RunEntry, ...]:
    """Read every run; what is wrong is noted in `findings`, and that run left out."""
    if not isinstance(data, list) or not data:
        findings.error(("runs",), "no runs are listed", "Add a [[runs]] table per record")
        return ()
    if len(data) > _MAX_RUNS:
        findings.error(("runs",), f"more than {_MAX_RUNS} runs", "Split the campaign")
        return ()
    runs: list[RunEntry] = []
    first: dict[str, int] = {}
    for index, entry in enumerate(data):
        errors = findings.errors
        run = _read_run(Table(entry, ("runs", index), findings), index)
        if run is None:
            continue
        if run.id in first:
            message = f"run id {shown(run.id)} is used twice, also by run no. {first[run.id] + 1}"
            findings.error(("runs", index, "id"), message, "Give every run its own id", run.id)
        if findings.errors == errors:
            runs.append(run)
        first.setdefault(run.id, index)
    return tuple(runs)


def _read_run(table: Table, index: int) -> RunEntry | None:
    values = table.read(RUN, "[[runs]]")
    name, kind = values["id"], values["kind"]
    if name is not None and not _ID.fullmatch(name):
        table.error("id", f"run id {shown(name)} cannot be used", "Use letters, digits, '-', '_' and '.'")
    for key in _NEEDED.get(kind, ()):
        if key == "excitation_frequency" and values["excitation"] != "sine":
            key = "excitation_band"
        if key not in table.data:
            table.error(key, f"{key} is missing in a {kind} run", f"Add {key} to this run")
    band = _band(table, values["excitation_band"])
    if name is None or kind is None:
        return None
    point = OperatingPoint(
        static_load=values["static_load"],
        static_load_direction=values["static_load_direction"],
        shaft_speed=values["shaft_speed"],
        excitation=values["excitation_frequency"],
    )
    plain = {key: value for key, value in values.items() if key in RunEntry.__dataclass_fields__}
    return RunEntry(**plain, point=point, stated=frozenset(table.data), index=index, band=band)


def _band(table: Table, text: str | None) -> tuple[float, float] | None:
    """``"5..120 Hz"`` as two frequencies [Hz]."""
    if text is None:
        return None
    low, dots, high = text.partition("..")
    unit = high.strip().lstrip("0123456789.,+-eE").strip()
    try:
        first = parse_quantity(f"{low.strip()} {unit}", "frequency")
        last = parse_quantity(high, "frequency")
    except UnitError:
        first = last = 0.0
    if not dots or not 0 < first < last < 1e12:
        table.error("excitation_band", f"excitation_band is {shown(text)}", 'Give e.g. "5..120 Hz", lowest first')
        return None
    return first, last
