"""Small manifests as text, a table a mapping."""

from __future__ import annotations

import json
from collections.abc import Mapping

Table = Mapping[str, object]

#: What a run of kind locus, or dynamic, says of its set point.
SET_POINT = {"shaft_speed": "22 Hz", "static_load": "5 kN", "static_load_direction": "-90 deg"}
PROBE = {"quantity": "displacement", "axis": "0 deg", "unit": "um"}
PROBES = {"X1A": PROBE, "X1B": PROBE | {"axis": "90 deg"}}
SWEEP = {"id": "c-1", "file": "runs/c-1.csv", "kind": "clearance"}


def manifest(channels: Mapping[str, Table], *runs: Table, head: Table | None = None, **tables: Table) -> str:
    """Text of a manifest; what is appended belongs to the last run."""
    lines = _lines({"schema": "tpjb-rig/1", "id": "t", "bearing": "b.toml", **(head or {})})
    for name, keys in {"housing": {"mass": "30 kg"}, **tables}.items():
        lines += [f"[{name}]", *_lines(keys)]
    for name, keys in channels.items():
        plain = name.isascii() and name.isidentifier()
        lines += [f"[channels.{name if plain else _value(name)}]", *_lines(keys)]
    for run in runs:
        lines += ["[[runs]]", *_lines(run)]
    return "\n".join(lines) + "\n"


def _lines(keys: Table) -> list[str]:
    return [f"{key} = {_value(value)}" for key, value in keys.items()]


def _value(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
