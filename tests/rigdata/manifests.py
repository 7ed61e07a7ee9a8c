"""Small manifests as text."""

from __future__ import annotations

import json
from collections.abc import Mapping

#: What a run of kind locus, or dynamic, says of its set point.
SET_POINT = {"shaft_speed": "22 Hz", "static_load": "5 kN", "static_load_direction": "-90 deg"}
PROBE = {"quantity": "displacement", "axis": "0 deg", "unit": "um"}


def manifest(channels: Mapping[str, Mapping[str, object]], run: Mapping[str, object], sample_rate: str = "") -> str:
    """A campaign of one run, that of the last table: what is appended belongs to it."""
    lines = ['schema = "tpjb-rig/1"', 'id = "t"', 'bearing = "b.toml"', "[housing]", 'mass = "30 kg"']
    lines += ["[acquisition]", f'sample_rate = "{sample_rate}"'] if sample_rate else []
    for name, keys in channels.items():
        lines += [f"[channels.{json.dumps(name)}]", *_lines(keys)]
    return "\n".join([*lines, "[[runs]]", *_lines(run)]) + "\n"


def _lines(keys: Mapping[str, object]) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
