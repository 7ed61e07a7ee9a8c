"""Writes runs of a `BandRig` as a campaign in the rig-export format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.rigs.band_rig import BandPlan, BandRig, record
from tests.rigs.campaign_file import UNITS, write_records
from tests.rigs.field_rig import CHANNELS

#: What the manifest calls the kinds of excitation.
STATED = {"periodic random": "random"}


def write_band_campaign(path: Path, rig: BandRig, plans: Sequence[BandPlan], seed: int) -> None:
    """Write one HDF5 file."""
    rng = np.random.default_rng(seed)
    write_records(path, band_manifest(rig, plans), rig.rate, ((plan.id, record(rig, plan, rng)) for plan in plans))


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
