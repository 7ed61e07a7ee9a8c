"""Writes runs of a `BandRig` as a campaign in the rig-export format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from tests.rigs.band_rig import CHANNELS, BandPlan, BandRig, record

BEARING = Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml"
#: What the manifest states, and how many of it make one of SI.
UNITS = {"displacement": ("um", 1e6), "force": ("N", 1.0), "acceleration": ("m/s^2", 1.0)}
#: What the manifest calls the kinds of excitation.
STATED = {"periodic random": "random"}


def write_band_campaign(path: Path, rig: BandRig, plans: Sequence[BandPlan], seed: int) -> None:
    """Write one HDF5 file, channels in the units of the manifest, beside the rocker's bearing file."""
    rng = np.random.default_rng(seed)
    with h5py.File(path, "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = band_manifest(rig, plans), BEARING.read_text(encoding="utf-8")
        for plan in plans:
            group = file.create_group(f"runs/{plan.id}")
            group.attrs["sample_rate_hz"] = rig.rate
            for name, values in record(rig, plan, rng).items():
                group.create_dataset(name, data=values * (UNITS[CHANNELS[name][0]][1] if name in CHANNELS else 1.0))


def band_manifest(rig: BandRig, plans: Sequence[BandPlan]) -> str:
    """The campaign's manifest."""
    lines = [
        'schema = "tpjb-rig/1"',
        'id = "band"',
        'bearing = "rocker.toml"',
        "[housing]",
        f'mass = "{rig.housing_mass} kg"',
    ]
    lines += ["[acquisition]", f'sample_rate = "{rig.rate} Hz"']
    lines += [f'mains = "{rig.mains} Hz"'] if rig.mains else []
    for name, (quantity, axis) in CHANNELS.items():
        lines += [f"[channels.{name}]", f'quantity = "{quantity}"', f'axis = "{axis} deg"']
        lines += [f'unit = "{UNITS[quantity][0]}"', 'uncertainty = "0 %"']
    for k in range(rig.command):
        angle = plans[0].direction + 90.0 * k
        lines += [f"[channels.C{k + 1}]", 'quantity = "command"', f'axis = "{angle} deg"']
    for plan in plans:
        lines += ["[[runs]]", f'id = "{plan.id}"', 'kind = "dynamic"', f'shaft_speed = "{rig.shaft} Hz"']
        lines += [f'static_load = "{plan.load} N"', 'static_load_direction = "-90 deg"']
        lines += [f'excitation = "{STATED.get(rig.kind, rig.kind)}"']
        lines += [f'excitation_band = "{rig.band[0]:g}..{rig.band[1]:g} Hz"']
        if rig.command != 2:
            lines += [f'excitation_direction = "{plan.direction} deg"']
    return "\n".join(lines) + "\n"
