"""What a shaft that leans does to the spherical bearing: its pads held straight, free to follow, held by friction.

    python -m tests.studies.axial_tilt [--into docs/model.md]

5 kN, 22 Hz, synchronous, adiabatic, Kirk's pivots.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect
from model.options import Options
from model.predict import predict
from model.prediction import Prediction

DOWN, SPEED = -math.pi / 2, 2 * math.pi * 22
CASES: dict[str, tuple[list[Effect], bool]] = {
    "pads stay straight": ([], False),
    "free": ([], True),
    "friction 0.02": ([Effect("pivot_friction", coefficient=0.02)], True),
    "friction 0.1": ([Effect("pivot_friction", coefficient=0.1)], True),
}


def run(effects: list[Effect], follow: bool) -> Prediction:
    """One point of the spherical bearing."""
    bearing = load_bearing(Path("model/bearings/spherical.toml"))
    p = predict(bearing, 5000.0, DOWN, SPEED, effects=effects, options=Options(axial_tilt=follow))
    assert p.converged, p.status
    return p


def rows() -> list[str]:
    """The table's lines."""
    heads = ("slope", "towards", "pads", "kxx", "kyy", "cxx", "cyy", "thinnest film", "axial tilt of pad #1 over slope")
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for slope in (3e-4, 9e-4):
        for toward, name in ((DOWN, "the load"), (0.0, "the side")):
            for case, (held, follow) in CASES.items():
                aligned = run(held, False)
                p = run([Effect("misalignment", angle=slope, direction=toward), *held], follow)
                figures = [
                    f"{100.0 * (new / old - 1.0):+.1f} %"
                    for table, other in ((p.k, aligned.k), (p.c, aligned.c))
                    for new, old in zip(np.diag(table), np.diag(other), strict=True)
                ]
                film, tilt = f"{1e6 * p.min_film:.0f} um", f"{p.axial_tilt[0] / slope:.2f}" if toward == DOWN else ""
                lines.append("| " + " | ".join([f"{1e3 * slope:g} mrad", name, case, *figures, film, tilt]) + " |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path, help="page whose table is replaced")
    chosen = parser.parse_args()
    made = "\n".join(rows())
    print(made)
    if chosen.into is not None:
        before, rest = chosen.into.read_text(encoding="utf-8").split("<!-- axial: begin -->\n")
        after = rest.split("<!-- axial: end -->")[1]
        made = f"{before}<!-- axial: begin -->\n{made}\n<!-- axial: end -->{after}"
        chosen.into.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
