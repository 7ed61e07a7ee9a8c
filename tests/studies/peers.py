"""This model and the ROSS fluid-film engine on the same points, in one run: numbers, times and their ratio.

    python -m tests.studies.peers --python /path/to/an/environment/with/ross/bin/python [--write]

ROSS is not a dependency: it runs in an interpreter of its own choice, with `ross.bearings.fluid_film_bearing`
(in its repository since 2026-08; releases up to 2.3.0 lack it). Without one there is nothing to compare with, and a
message says so. The case is the references' (`../shared/references`): the paper's rocker bearing, isoviscous,
1320 rpm, 5 kN on pad #1, synchronous; and adiabatic, where the two models differ in what enters a pad (ROSS mixes a
groove: its carry-over is set to zero, or to the same share). Cross terms: the largest of the four, over the mean direct
coefficient. Times are processor times of the solution alone, least of the repeats.
"""

import argparse
import json
import math
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect
from model.predict import predict
from model.prediction import Prediction
from model.setup import Mesh
from tests.studies.results import report, study_parser, table

FILE = Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml"
VISCOSITY, SPEED, LOAD = 0.03956, 2 * math.pi * 22.0, 5000.0
NAMES = ("kxx", "kyy", "cxx", "cyy")
CROSS = ("kxy", "kyx", "cxy", "cyx")
#: Solves cases, a line each; prints the version first, then K and C and the least time of each, after what compiles.
CHILD = """
import json, sys, time, warnings
import ross
from ross.bearings.fluid_film_bearing import FluidFilmBearing
warnings.simplefilter("ignore")
print(json.dumps(ross.__version__), flush=True)
for line in sys.stdin:
    times = []
    for _ in range(2):
        began = time.process_time()
        bearing = FluidFilmBearing(n=0, **json.loads(line))
        times.append(time.process_time() - began)
    names = [kind + entry for kind in "kc" for entry in ("xx", "xy", "yx", "yy")]
    out = {name: float(getattr(bearing, name)[0]) for name in names}
    print(json.dumps({**out, "seconds": times[-1]}), flush=True)
"""


@dataclass(frozen=True)
class Case:
    """What both programs solve: `pads` is what each pad has of its own; offsets count from the edge that leads.

    Leading edges are stated for a shaft that turns counter-clockwise.
    """

    name: str
    mesh: tuple[int, int] = (40, 20)
    thermal: str = "isothermal"
    pivots: float = 0.0
    pads: tuple[Mapping[str, float], ...] = ({},)
    carry_over: float = 0.0
    rotation: str = "counter-clockwise"

    @property
    def bearing(self) -> Bearing:
        """The rocker bearing with the references' oil."""
        drawn = load_bearing(FILE)
        own = self.pads * (len(drawn.pads) // len(self.pads))
        moved = drawn.with_pads(tuple(replace(pad, **entries) for pad, entries in zip(drawn.pads, own, strict=True)))
        return replace(moved, oil=replace(drawn.oil, viscosity_40=VISCOSITY), rotation="counter-clockwise")

    @property
    def seen_by_peer(self) -> Bearing:
        """As ROSS, whose shafts turn counter-clockwise, has to be told: the mirror image where this one does not."""
        b = self.bearing
        if self.rotation == b.rotation:
            return b
        turned = [replace(p, pivot_angle=math.pi - p.pivot_angle, pivot_offset=1.0 - p.pivot_offset) for p in b.pads]
        return b.with_pads(tuple(reversed(turned)))


AT_06 = ({"pivot_offset": 0.6},)
#: Five pads, each with a clearance, an arc and an offset of its own.
DIFFERENT = tuple(
    {"assembled_clearance": 65e-6, "pad_clearance": 1e-6 * cp, "arc": math.radians(arc), "pivot_offset": offset}
    for cp, arc, offset in ((70, 60, 0.5), (76, 55, 0.6), (82, 50, 0.55), (88, 58, 0.6), (95, 52, 0.5))
)
CASES = (
    Case("isothermal, rigid pivots"),
    Case("isothermal, rigid pivots", (80, 40)),
    Case("isothermal, pivots of 5e8 N/m", pivots=5e8),
    Case("adiabatic, rigid pivots", thermal="adiabatic"),
    Case("isothermal, rigid pivots at 0.6", (20, 10), pads=AT_06),
    Case("isothermal, rigid pivots at 0.6", pads=AT_06),
    Case("isothermal, rigid pivots at 0.6", (80, 40), pads=AT_06),
    Case("adiabatic, rigid pivots at 0.6", thermal="adiabatic", pads=AT_06),
    Case("isothermal, rigid pivots at 0.6, clockwise", pads=AT_06, rotation="clockwise"),
    Case("carry-over 0.8, pivots at 0.6", (20, 10), "adiabatic", pads=AT_06, carry_over=0.8),
    Case("carry-over 0.8, pivots at 0.6", thermal="adiabatic", pads=AT_06, carry_over=0.8),
    Case("carry-over 0.8, pivots at 0.6, clockwise", (20, 10), "adiabatic", 0.0, AT_06, 0.8, "clockwise"),
    Case("carry-over 0.8, pivots at 0.6, clockwise", (40, 20), "adiabatic", 0.0, AT_06, 0.8, "clockwise"),
    Case("pads that differ, isothermal", pads=DIFFERENT),
    Case("pads that differ, isothermal", (80, 40), pads=DIFFERENT),
    Case("pads that differ, isothermal, clockwise", pads=DIFFERENT, rotation="clockwise"),
    Case("pads that differ, isothermal, clockwise", (80, 40), pads=DIFFERENT, rotation="clockwise"),
    Case("pads that differ, isothermal, clockwise", (160, 80), pads=DIFFERENT, rotation="clockwise"),
    Case("pads that differ, adiabatic", thermal="adiabatic", pads=DIFFERENT),
    Case("pads that differ, carry-over 0.8", thermal="adiabatic", pads=DIFFERENT, carry_over=0.8),
    Case("pads that differ, carry-over 0.8, clockwise", (40, 20), "adiabatic", 0.0, DIFFERENT, 0.8, "clockwise"),
)


def peer_case(case: Case) -> dict[str, Any]:
    """Arguments of the peer's constructor, SI."""
    b, mesh, pivots = case.seen_by_peer, case.mesh, case.pivots
    pads, oil = b.pads, b.oil
    return {
        "frequency": [SPEED],
        "journal_diameter": b.journal_diameter,
        "radial_clearance": pads[0].assembled_clearance,
        "pad_thickness": pads[0].thickness,
        "pivot_angle": [p.pivot_angle for p in pads],
        "pad_arc": [p.arc for p in pads],
        "pad_axial_length": [b.length] * len(pads),
        "preload": [p.preload for p in pads],
        "offset": [p.pivot_offset for p in pads],
        "lubricant": {
            "liquid_viscosity1": VISCOSITY,
            "temperature1": 313.15,
            "liquid_viscosity2": VISCOSITY * math.exp(-60.0 * oil.viscosity_exponent),
            "temperature2": 373.15,
            "liquid_density": oil.density_40,
            "liquid_specific_heat": oil.specific_heat,
            "liquid_thermal_conductivity": oil.conductivity,
        },
        "oil_supply_temperature": 313.15,
        "oil_flow_v": 4e-4,
        "weight": LOAD,
        "bearing_type": "conventional_tilting_pad",
        "thermal_type": None if case.thermal == "isothermal" else case.thermal,
        "deform_type": "pad_pivot_mechanical" if pivots else None,
        "pivot_type": "user_specified_stiffness",
        "pivot_stiffness": pivots,
        "total_ex_film": mesh[0],
        "total_ey_film": 10,
        "total_ez_film": mesh[1],
        "total_ey_pad": 10,
        "hot_oil_lambda": case.carry_over,
        "initial_position": [0.0, -0.4],
    }


def run_peer(python: str, cases: list[dict[str, Any]]) -> tuple[str, list[dict[str, float]]]:
    """The peer's version and its answers to cases; SystemExit where the interpreter has no such engine."""
    text = "".join(json.dumps(case) + "\n" for case in cases)
    done = subprocess.run([python, "-c", CHILD], input=text, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"no result of the ROSS fluid-film engine in {python}: {done.stderr.strip()[-300:] or 'no message'}")
    version, *answers = [json.loads(line) for line in done.stdout.splitlines() if line[:1] in ('"', "{")]
    return version, answers


def run_ours(case: Case, repeats: int, mesh: Mesh | None = None) -> tuple[Prediction, float]:
    """The same point here, and its least processor time [s]."""
    b, pivots = case.bearing, case.pivots or "rigid"
    effects = [Effect("hot_oil_carryover", fraction=case.carry_over)] if case.carry_over else []
    times = []
    for _ in range(repeats + 1):
        began = time.process_time()
        p = predict(
            b, LOAD, -math.pi / 2, SPEED, pivots=pivots, thermal=case.thermal, effects=effects, mesh=mesh,
            rotation=case.rotation,
        )  # fmt: skip
        times.append(time.process_time() - began)
    return p, min(times[1:])


def compared(case: Case, asked: argparse.Namespace) -> list[str]:
    """One row of the table: the peer less this model on a fine mesh."""
    version, (peer,) = run_peer(asked.python, [peer_case(case)])
    ours, seconds = run_ours(case, asked.repeats)
    fine, _ = run_ours(case, 1, Mesh(320, 24))
    own = max(abs(getattr(ours, key) / getattr(fine, key) - 1.0) for key in NAMES)
    print(f"{case.name}: ROSS {version}, default mesh here within {own:.2%} of 320 x 24", flush=True)
    shares = [f"{peer[key] / getattr(fine, key) - 1.0:+.1%}" for key in NAMES]
    sign = 1.0 if case.rotation == "counter-clockwise" else -1.0
    direct = {kind: 0.5 * (getattr(fine, f"{kind}xx") + getattr(fine, f"{kind}yy")) for kind in "kc"}
    shares.append(f"{max(abs(sign * peer[name] - getattr(fine, name)) / direct[name[0]] for name in CROSS):.1%}")
    times = [f"{peer['seconds']:.1f} s", f"{1e3 * seconds:.1f} ms", f"{peer['seconds'] / seconds:.0f}"]
    row = [case.name, f"{case.mesh[0]} x {case.mesh[1]}", *shares, *times]
    print(f"    {' | '.join(row)}", flush=True)
    return row


def main() -> None:
    asked = study_parser(__doc__, python=sys.executable, repeats=10, only="").parse_args()
    rows = [compared(case, asked) for case in CASES if asked.only in case.name]
    text = table(("case", "ROSS mesh", *NAMES, "cross terms", "ROSS", "here (80 x 6)", "ratio"), rows)
    report(asked, "ross", text, "python -m tests.studies.peers --python INTERPRETER_WITH_ROSS --write")


if __name__ == "__main__":
    main()
