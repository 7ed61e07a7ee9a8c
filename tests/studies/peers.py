"""This model and the ROSS fluid-film engine on the same points, in one run: numbers, times and their ratio.

    python -m tests.studies.peers --python /path/to/an/environment/with/ross/bin/python [--write]

ROSS is not a dependency: it runs in an interpreter of its own choice, with `ross.bearings.fluid_film_bearing`
(in its repository since 2026-08; releases up to 2.3.0 lack it). Without one there is nothing to compare with, and a
message says so. The case is the references' (`../shared/references`): the paper's rocker bearing, isoviscous,
1320 rpm, 5 kN on pad #1, synchronous; and adiabatic, where the two models differ in what enters a pad (ROSS mixes a
groove: its carry-over is set to zero). Times are processor times of the solution alone, least of the repeats.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.predict import predict
from model.prediction import Prediction
from model.setup import Mesh
from tests.studies.results import table, write_section

FILE = Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml"
VISCOSITY, SPEED, LOAD = 0.03956, 2 * math.pi * 22.0, 5000.0
NAMES = ("kxx", "kyy", "cxx", "cyy")
CHILD = """
import json, sys, time, warnings
case = json.loads(sys.stdin.read())
try:
    from ross.bearings.fluid_film_bearing import FluidFilmBearing
except ImportError as error:
    print(json.dumps({"missing": str(error)}))
    raise SystemExit
warnings.simplefilter("ignore")
times = []
for _ in range(case.pop("repeats") + 1):  # the first one compiles
    wall, began = time.perf_counter(), time.process_time()
    bearing = FluidFilmBearing(n=0, **case)
    times.append((time.process_time() - began, time.perf_counter() - wall))
out = {name: float(getattr(bearing, name)[0]) for name in ("kxx", "kyy", "cxx", "cyy")}
out["seconds"], out["wall"] = min(times[1:] or times)
import ross
out["version"] = ross.__version__
print(json.dumps(out))
"""


@dataclass(frozen=True)
class Case:
    """What both programs solve: `offset` is the pivot's place from the leading edge, as a share of the arc."""

    name: str
    mesh: tuple[int, int] = (40, 20)
    thermal: str = "isothermal"
    pivots: float = 0.0
    offset: float = 0.5

    @property
    def bearing(self) -> Bearing:
        """The rocker bearing with the references' oil."""
        drawn = load_bearing(FILE)
        moved = drawn.with_pads(tuple(replace(pad, pivot_offset=self.offset) for pad in drawn.pads))
        return replace(moved, oil=replace(drawn.oil, viscosity_40=VISCOSITY))


CASES = (
    Case("isothermal, rigid pivots"),
    Case("isothermal, rigid pivots", (80, 40)),
    Case("isothermal, pivots of 5e8 N/m", pivots=5e8),
    Case("adiabatic, rigid pivots", thermal="adiabatic"),
    Case("isothermal, rigid pivots at 0.6", (20, 10), offset=0.6),
    Case("isothermal, rigid pivots at 0.6", offset=0.6),
    Case("isothermal, rigid pivots at 0.6", (80, 40), offset=0.6),
    Case("adiabatic, rigid pivots at 0.6", thermal="adiabatic", offset=0.6),
    Case("isothermal, rigid pivots at 0.4", offset=0.4),
)


def peer_case(case: Case) -> dict[str, Any]:
    """Arguments of the peer's constructor, SI."""
    b, mesh, pivots = case.bearing, case.mesh, case.pivots
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
        "hot_oil_lambda": 0.0,
        "initial_position": [0.0, -0.4],
    }


def run_peer(python: str, case: dict[str, Any], repeats: int) -> dict[str, Any]:
    """One case in the peer's interpreter; `missing` is set where it has no such engine."""
    text = json.dumps(case | {"repeats": repeats})
    done = subprocess.run([python, "-c", CHILD], input=text, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"failed": done.stderr.strip()[-300:] or "no message"}
    result: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return result


def run_ours(case: Case, repeats: int, mesh: Mesh | None = None) -> tuple[Prediction, float]:
    """The same point here, and its least processor time [s]."""
    b, pivots = case.bearing, case.pivots or "rigid"
    times = []
    for _ in range(repeats + 1):
        began = time.process_time()
        p = predict(b, LOAD, -math.pi / 2, SPEED, pivots=pivots, thermal=case.thermal, mesh=mesh)
        times.append(time.process_time() - began)
    return p, min(times[1:])


def compared(case: Case, asked: argparse.Namespace) -> list[str]:
    """One row of the table: the peer less this model on a fine mesh; SystemExit if there is no peer."""
    peer = run_peer(asked.python, peer_case(case), 1)
    if "missing" in peer or "failed" in peer:
        sys.exit(f"no result of the ROSS fluid-film engine in {asked.python}: {peer}")
    ours, seconds = run_ours(case, asked.repeats)
    fine, _ = run_ours(case, 1, Mesh(320, 24))
    own = max(abs(getattr(ours, key) / getattr(fine, key) - 1.0) for key in NAMES)
    print(f"{case.name}: ROSS {peer['version']}, default mesh here within {own:.2%} of 320 x 24", flush=True)
    shares = [f"{peer[key] / getattr(fine, key) - 1.0:+.1%}" for key in NAMES]
    times = [f"{peer['seconds']:.1f} s", f"{1e3 * seconds:.1f} ms", f"{peer['seconds'] / seconds:.0f}"]
    return [case.name, f"{case.mesh[0]} x {case.mesh[1]}", *shares, *times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable, help="an interpreter that can import ross")
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    asked = parser.parse_args()
    rows = [compared(case, asked) for case in CASES]
    text = table(("case", "ROSS mesh", *NAMES, "ROSS", "here (80 x 6)", "ratio"), rows)
    print(text)
    if asked.write:
        write_section("ross", "python -m tests.studies.peers --python INTERPRETER_WITH_ROSS --write", text)


if __name__ == "__main__":
    main()
