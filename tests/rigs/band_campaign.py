"""Writes runs of a `BandRig` as a campaign in the rig-export format."""

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from tests.manifests import manifest
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
    channels: dict[str, dict[str, str]] = {}
    for name, (quantity, axis) in CHANNELS.items():
        channels[name] = {"quantity": quantity, "axis": f"{axis} deg", "unit": UNITS[quantity][0], "uncertainty": "0 %"}
    for k in range(rig.command):
        channels[f"C{k + 1}"] = {"quantity": "command", "axis": f"{plans[0].direction + 90.0 * k} deg"}
    shared = {"kind": "dynamic", "shaft_speed": f"{rig.shaft} Hz", "static_load_direction": "-90 deg"}
    shared |= {"excitation": STATED.get(rig.kind, rig.kind)}
    shared |= {"excitation_band": f"{rig.band[0]:g}..{rig.band[1]:g} Hz"}
    runs = []
    for plan in plans:
        along = {"excitation_direction": f"{plan.direction} deg"} if rig.command != 2 else {}
        runs.append({"id": plan.id, "static_load": f"{plan.load} N"} | shared | along)
    acquisition = {"sample_rate": f"{rig.rate} Hz"} | ({"mains": f"{rig.mains} Hz"} if rig.mains else {})
    tables = {"housing": {"mass": f"{rig.housing_mass} kg"}, "acquisition": acquisition}
    return manifest(channels, *runs, head={"id": "band", "bearing": "rocker.toml"}, **tables)
