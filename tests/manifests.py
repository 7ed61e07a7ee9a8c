"""Small manifests as text, a table a mapping; campaigns of them in a folder or in one HDF5 file."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

Table = Mapping[str, object]

#: What a run of kind locus, or dynamic, says of its set point.
SET_POINT = {"shaft_speed": "22 Hz", "static_load": "5 kN", "static_load_direction": "-90 deg"}
PROBE = {"quantity": "displacement", "axis": "0 deg", "unit": "um"}
PROBES = {"X1A": PROBE, "X1B": PROBE | {"axis": "90 deg"}}
#: Two probes at 45 and 135 deg, cells along and across.
PROBES_AND_CELLS = {
    name: {"quantity": quantity, "axis": f"{axis} deg", "unit": "um" if quantity == "displacement" else "N"}
    for name, quantity, axis in (
        ("PX", "displacement", 45), ("PY", "displacement", 135), ("FX", "force", 0), ("FY", "force", 90),
    )
}  # fmt: skip
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
    if isinstance(value, list) and value and isinstance(value[0], Mapping):  # inline tables
        return f"[{', '.join('{' + ', '.join(_lines(table)) + '}' for table in value)}]"
    return json.dumps(value, ensure_ascii=False)


def write_files(folder: Path, text: str, files: Mapping[str, str | bytes] | None = None) -> Path:
    """Write a campaign of this manifest and these files into a folder; the folder."""
    bearing = {"b.toml": 'name = "b"\n'} if 'bearing = "b.toml"' in text else {}
    for name, content in {"campaign.toml": text, **bearing, **(files or {})}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return folder


def write_hdf5(
    path: Path, text: str, columns: Mapping[str, Any], rate: object = None, run: str = "c-1", **storage: Any
) -> Path:
    """Write a campaign of one run into an HDF5 file, its columns stored as `storage` says; the path."""
    import h5py

    with h5py.File(path, "w", libver=storage.pop("libver", None)) as file:
        file.attrs["manifest"], file.attrs["bearing"] = text, 'name = "b"\n'
        group = file.create_group(f"runs/{run}")
        if rate is not None:
            group.attrs["sample_rate_hz"] = rate
        for name, values in columns.items():
            group.create_dataset(name, data=values, **storage)
    return path
