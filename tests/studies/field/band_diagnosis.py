"""Does a diagnosis work on H over a band?  ``python -m tests.studies.field.band_diagnosis [--kind random]``

A bearing of the model with one effect hidden in it is shaken over a band at three loads: records in closed form, from
H of the model on a finer mesh. ``tpjb diagnose`` reads the campaign, and what it names stands beside what is hidden.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect, apply_effects
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Mesh, Setup
from tests.studies.field.band_campaign import write_band_campaign
from tests.studies.field.band_rig import BandRig, band_plans
from tests.studies.field.campaign_file import BEARING

LOADS = (2500.0, 5000.0, 8750.0)
SHAFT = 22.3
#: Frequencies at which the model is asked; between them H is smooth [Hz].
ASKED = np.linspace(0.5, 140.0, 29)
HIDDEN: dict[str, Sequence[Effect]] = {
    "nothing": (),
    "soft pivot": (Effect("soft_pivot", pad=1, stiffness_factor=0.4),),
    "growth": (Effect("thermal_growth", clearance_change=1.0e-5),),
    "cell gain": (Effect("loadcell_gain", factor=0.95),),
}


def modelled(effects: Sequence[Effect]) -> Callable[..., np.ndarray]:
    """H (n, 2, 2) [N/m] of the model, in the place of the battery's closed form."""
    bearing = load_bearing(BEARING)
    setup = apply_effects(Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(96, 8)), effects)
    known = {load: predict_setup(setup, load, -np.pi / 2, 2 * np.pi * SHAFT, 2 * np.pi * ASKED).h for load in LOADS}

    def stiffness(bearing: object, omega: np.ndarray, load: float, aside: float = 0.0) -> np.ndarray:
        flat = known[load].reshape(len(ASKED), 4)
        at = omega / (2 * np.pi)
        parts = [np.interp(at, ASKED, c.real) + 1j * np.interp(at, ASKED, c.imag) for c in flat.T]
        return np.stack(parts, axis=1).reshape(-1, 2, 2)

    return stiffness


def told(kind: str, effects: Sequence[Effect], seed: int) -> str:
    """What the command line says of one campaign."""
    with tempfile.TemporaryDirectory() as folder, patch("tests.studies.field.band_rig.stiffness", modelled(effects)):
        path, out = Path(folder) / "band.h5", Path(folder) / "out"
        rig = BandRig(kind=kind, shaft=SHAFT, band=(10.0, 60.0))
        write_band_campaign(path, rig, band_plans(LOADS), seed)
        command = [sys.executable, "-m", "tpjb_ident", "diagnose", str(path), "--out", str(out), "--quiet"]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (out / "diagnosis.json").exists():
            return f"exit {ended.returncode}: {(ended.stderr.strip().splitlines() or ['?'])[-1]}"
        verdict = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    named = [
        f"{e['name']} {k} {p['value']:.4g} [{p['lo']:.4g}, {p['hi']:.4g}]"
        for e in verdict["effects"]
        for k, p in e["parameters"].items()
    ]
    return f"{verdict['verdict']}: {', '.join(named) or '-'}"


def main() -> None:
    """Print a line per hidden effect."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", default="random", help="as of BandRig")
    parser.add_argument("--seed", type=int, default=130000)
    asked = parser.parse_args()
    for number, (name, effects) in enumerate(HIDDEN.items()):
        print(f"{asked.kind}, {name}: {told(asked.kind, effects, asked.seed + number)}", flush=True)


if __name__ == "__main__":
    main()
