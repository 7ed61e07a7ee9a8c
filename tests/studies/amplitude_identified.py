"""What the identification finds where the model's own films move far: its records against the perturbation.

    python -m tests.studies.amplitude_identified

The journal vibrates along six directions, at 5 to 40 % of the clearance, films and pads follow in time
(`amplitude_model.py`); forces with four harmonics go through the rig of `field/` (probes, cells, accelerometers, noise,
runout, mains) into a campaign, and `identify` has that. Against the perturbation of the same equilibrium.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.predict import predict
from model.prediction import Prediction
from rigdata import load_campaign
from tests.studies.amplitude_model import ROCKER, harmonics
from tests.studies.field import rig as field
from tests.studies.field.campaign_file import plans_of, write_campaign
from tpjb_ident.cli.commands.identify import identify_settings
from tpjb_ident.dynamic.identify import identify

LOAD, SHAFT, EXCITATION, DIRECTIONS, MOST = 5000.0, 22.0, 25.0, 6, 4
OMEGA = 2 * math.pi * EXCITATION
Forces = dict[tuple[float, float], tuple[np.ndarray, np.ndarray]]


def forces(p: Prediction, amplitudes: Sequence[float], clearance: float) -> Forces:
    """Motion and force harmonics by direction [deg] and share of the clearance."""
    found = {}
    for share in amplitudes:
        for k in range(DIRECTIONS):
            angle = 180.0 * k / DIRECTIONS
            motion = share * clearance * np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
            found[angle, share] = motion, harmonics(p, motion, OMEGA, MOST)
    return found


def tones(known: Forces) -> Callable[..., list[field.Tone]]:
    """What takes the place of the closed form's lines in `field.rig`."""

    def of(rig: field.Rig, plan: field.Plan, load: float, aside: float, rng: np.random.Generator) -> list[field.Tone]:
        motion, force = known[plan.direction, plan.scale]
        turns = np.exp(1j * rng.uniform(0, 2 * np.pi) * np.arange(1, MOST + 1))
        still = np.zeros(2)
        return [
            field._tone(rig, n * EXCITATION, turns[n - 1] * force[n - 1], turns[n - 1] * (motion if n == 1 else still))
            for n in range(1, MOST + 1)
        ]

    return of


def found(p: Prediction, known: Forces, seed: int) -> str:
    """One row: K and C found over those of the perturbation, their half-widths, and what is said."""
    shares = sorted({share for _, share in known})
    rig = replace(field.Rig(), miss=(0.0, 0.0), shaft=SHAFT)
    plans = plans_of((LOAD,), (EXCITATION,), DIRECTIONS, shares)
    kept = field._tones
    try:
        field._tones = tones(known)  # type: ignore[assignment]
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("error")
            path = Path(folder) / "amplitude.h5"
            write_campaign(path, rig, plans, seed)
            campaign = load_campaign(path)
            result = identify(campaign, identify_settings(campaign, "mm-eiv", None))
    finally:
        field._tones = kept
    point = result.points[0]
    h = np.asarray(p.h).reshape(-1, 2, 2)[0]
    own = np.column_stack([f[0] for _, f in known.values()]) @ np.linalg.pinv(
        np.column_stack([m for m, _ in known.values()])
    )
    half = np.asarray(point.stiffness.half_width()) / np.repeat([1.0, OMEGA], 4)
    cells = []
    k, c = point.stiffness.k, point.stiffness.c * OMEGA
    for part, of, width in ((np.real, k, half[:4]), (np.imag, c, half[4:] * OMEGA)):
        for j in range(2):
            base = part(h)[j, j]
            cells.append(f"{part(own)[j, j] / base - 1:+.1%} / {of[j, j] / base - 1:+.1%} +- {width[3 * j] / base:.1%}")
    names = ", ".join(f"`{c}`" for c in point.quality if getattr(c, "severity", "") in ("warning", "error"))
    motion = " and ".join(f"{s:.0%}" for s in shares)
    return f"| {motion} | {' | '.join(cells)} | {names or 'nothing'} |"


def main() -> None:
    bearing = load_bearing(ROCKER)
    clearance = bearing.pads[0].assembled_clearance
    p = predict(
        bearing, LOAD, -math.pi / 2, 2 * math.pi * SHAFT, [OMEGA], thermal="isothermal", pivots="rigid", mesh=(40, 4)
    )
    print("| amplitude / Cb | kxx: films / identified | kyy | cxx | cyy | named |\n|---|---|---|---|---|---|")
    for shares in ((0.02,), (0.05,), (0.1,), (0.2,), (0.4,), (0.02, 0.04, 0.08)):
        print(found(p, forces(p, shares, clearance), 1), flush=True)


if __name__ == "__main__":
    main()
