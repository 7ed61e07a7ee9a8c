"""Make the campaign that `tpjb demo` runs on: ``python docs/make_demo_campaign.py``.

Computed by the virtual rig from the bundled model: the rocker-backed bearing of the reference paper, its pivots
softer than the printed formula by a factor of their own each, noise and glitches as on a real rig. The truth lies
beside it, for tests and for the curious.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import h5py

from model.bearing_file import load_bearing
from model.effects import Effect
from rigdata.virtual_rig import (
    ClearanceSweep,
    DryTest,
    Instruments,
    RigPlan,
    VirtualRig,
    locus_points,
    operating_points,
    write_campaign,
)
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.compare.rig_from_model import rig_truth

ROOT = Path(__file__).resolve().parent.parent
SAMPLES = ROOT / "rigdata" / "samples"
BEARING = ROOT / "model" / "bearings" / "rocker.toml"
FACTORS = (0.42, 0.36, 0.47, 0.33, 0.40)
POINTS = [(load, 25.0) for load in (2500.0, 3750.0, 5000.0, 6250.0, 7500.0)] + [(5000.0, 10.0), (5000.0, 40.0)]
SEED = 20190722


def main() -> None:
    """Write demo.h5 and demo.truth.json."""
    softer = tuple(Effect("soft_pivot", pad=k, stiffness_factor=f) for k, f in enumerate(FACTORS, start=1))
    rig = VirtualRig(
        truth=rig_truth(load_bearing(BEARING), ModelSettings(effects=softer), BEARING.read_text(encoding="utf-8")),
        plan=RigPlan(
            dynamic=operating_points(sorted(POINTS)),
            locus=locus_points(10),
            dry=tuple(DryTest(pad) for pad in range(1, 6)),
            clearance=(ClearanceSweep(),),
        ),
        instruments=Instruments.like_paper(5, SEED),
        seed=SEED,
        campaign="demo",
        description="computed by the virtual rig: five-pad bearing whose pivots are softer than the printed formula",
    )
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "demo.h5"
        truth = write_campaign(raw, rig)
        repack(raw, SAMPLES / "demo.h5")
    kept = {key: value for key, value in truth.items() if key != "runs"}
    kept["pivot_note"] = f"pad 1..5: deflection = Kirk-Reedy deflection / {list(FACTORS)}"
    (SAMPLES / "demo.truth.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def repack(source: Path, target: Path) -> None:
    """Copy an HDF5 campaign with a compact layout: a third of the size, the same content."""
    with h5py.File(source) as old, h5py.File(target, "w", libver="latest") as new:
        new.attrs.update(old.attrs)
        for name, group in old["runs"].items():
            copy = new.create_group(f"runs/{name}")
            copy.attrs.update(group.attrs)
            for channel, data in group.items():
                copy.create_dataset(
                    channel, data=data[()], chunks=data.shape, compression=9, shuffle=True, track_times=False
                )


if __name__ == "__main__":
    main()
