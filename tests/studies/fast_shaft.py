"""The bundled bearings at 30,000 rpm with little preload: light to heavy load on and between pads, laminar and not.

    python -m tests.studies.fast_shaft [--write]

Adiabatic, pivots by Kirk, each point from nothing: what is answered, what is said of the rest, and the longest wait
(processor time, after one point that compiles).
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.options import Options
from model.predict import predict
from tests.studies.results import report, study_parser, table

FOLDER = Path(__file__).resolve().parents[2] / "model" / "bearings"
SPEED = 2 * math.pi * 500.0
LOADS = (500.0, 2500.0, 5000.0, 8750.0)
DIRECTIONS = (-0.5 * math.pi, -0.3 * math.pi)


def solved(bearing: Bearing, turbulence: str) -> list[str]:
    """Points answered, the range of the largest Reynolds number, the longest wait, and what is said of the rest."""
    answered, said, waits, reynolds = 0, [], [], []
    for load in LOADS:
        for direction in DIRECTIONS:
            began = time.process_time()
            p = predict(bearing, load, direction, SPEED, pivots="kirk", options=Options(turbulence=turbulence))
            waits.append(1e3 * (time.process_time() - began))
            reynolds.append(p.reynolds)
            answered += p.converged
            if not p.converged:
                said.append(f"{load:g} N at {math.degrees(direction):.0f}°: {'; '.join(p.status)}")
    span = f"{min(reynolds):.0f} to {max(reynolds):.0f}"
    return [f"{answered} of {len(waits)}", span, f"{max(waits):.0f}", ". ".join(said)]


def main() -> None:
    asked = study_parser(__doc__).parse_args()
    rows = []
    for name in ("rocker", "spherical"):
        drawn = load_bearing(FOLDER / f"{name}.toml")
        for turbulence in ("none", "ng-pan"):
            predict(drawn, LOADS[0], DIRECTIONS[0], SPEED, options=Options(turbulence=turbulence))
            for preload in (0.2, 0.1, 0.05):
                pads = (replace(p, pad_clearance=p.assembled_clearance / (1.0 - preload)) for p in drawn.pads)
                film = "laminar" if turbulence == "none" else turbulence
                rows.append([name, film, f"{preload:g}", *solved(drawn.with_pads(tuple(pads)), turbulence)])
    report(asked, "fast", table(("bearing", "film", "preload", "answered", "Re", "longest [ms]", "of the rest"), rows))


if __name__ == "__main__":
    main()
