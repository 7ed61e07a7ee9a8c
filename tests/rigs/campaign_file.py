"""Writes a rig's runs as a campaign in the rig-export format."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np

from tests.rigs.field_rig import CHANNELS, Plan, Rig, record

BEARING = Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml"
#: What the manifest states, and how many of it make one of SI.
UNITS = {"displacement": ("um", 1e6), "force": ("N", 1.0), "acceleration": ("m/s^2", 1.0)}


def write_campaign(
    path: Path, rig: Rig, plans: Sequence[Plan], seed: int, extra: Mapping[str, Mapping[str, str]] | None = None
) -> None:
    """Write one HDF5 file; `extra` holds more keys per table of the manifest (a channel's name, "housing", ...)."""
    rng = np.random.default_rng(seed)
    records = ((plan.id, record(rig, plan, rng)) for plan in plans)
    write_records(path, manifest_text(rig, plans, extra or {}), rig.rate, records)


def write_records(path: Path, manifest: str, rate: float, records: Iterable[tuple[str, dict[str, np.ndarray]]]) -> None:
    """Store runs by their names, channels in the units of the manifest, beside the rocker's bearing file."""
    with h5py.File(path, "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = manifest, BEARING.read_text(encoding="utf-8")
        for run, channels in records:
            group = file.create_group(f"runs/{run}")
            group.attrs["sample_rate_hz"] = rate
            for name, values in channels.items():
                group.create_dataset(name, data=values * (UNITS[CHANNELS[name][0]][1] if name in CHANNELS else 1.0))


def manifest_text(rig: Rig, plans: Sequence[Plan], extra: Mapping[str, Mapping[str, str]]) -> str:
    """The campaign's manifest."""

    def more(table: str) -> list[str]:
        return [f"{key} = {value}" for key, value in extra.get(table, {}).items()]

    lines = ['schema = "tpjb-rig/1"', 'id = "field"', 'bearing = "rocker.toml"']
    lines += ["[housing]", f'mass = "{rig.housing_mass} kg"', *more("housing")]
    lines += ["[acquisition]", f'sample_rate = "{rig.rate} Hz"', *more("acquisition")]
    for name in rig.channels:
        quantity, axis = CHANNELS[name]
        lines += [f"[channels.{name}]", f'quantity = "{quantity}"', f'axis = "{axis} deg"']
        lines += [f'unit = "{UNITS[quantity][0]}"']
        if "uncertainty" not in extra.get(name, {}):
            lines += ['uncertainty = "0 %"']
        lines += more(name)
    lines += ["[channels.KEY]", 'quantity = "keyphasor"', 'unit = "V"'] if rig.keyphasor else []
    for plan in plans:
        kind, speed = ("baseline", 0.0) if plan.dry else ("dynamic", rig.shaft)
        lines += ["[[runs]]", f'id = "{plan.id}"', f'kind = "{kind}"', f'shaft_speed = "{speed} Hz"']
        lines += [f'excitation_frequency = "{plan.frequency} Hz"', f'excitation_direction = "{plan.direction} deg"']
        if not plan.dry:
            lines += [f'static_load = "{plan.load} N"', 'static_load_direction = "-90 deg"']
    return "\n".join(lines) + "\n"


def plans_of(
    loads: Sequence[float] = (2500.0, 5000.0, 8750.0),
    frequencies: Sequence[float] = (25.0,),
    directions: int = 6,
    amplitudes: Sequence[float] = (1.0,),
    repeats: int = 1,
) -> list[Plan]:
    """Every load at every frequency in some directions over half a turn."""
    found = []
    for load in loads:
        for f in frequencies:
            for k in range(directions):
                for scale in amplitudes:
                    for again in range(repeats):
                        name = f"d-{load:.0f}-{f:g}-{k}-{scale:g}-{again}"
                        found.append(Plan(name, load, f, 180.0 * k / directions, scale))
    return found
