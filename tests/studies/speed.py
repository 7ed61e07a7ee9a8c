"""What a wait was and is: two checkouts in turn, in one run, as a table.

    python -m tests.studies.speed --before /path/of/an/older/checkout [--rounds 4] [--model-only] [--write]

Both run the same code, each with its own interpreter if it has one (`.venv`), in turn, so that a quiet moment of the
machine serves both. Times are processor times, the least of all rounds: points of the model within one process, and
whole commands on the bundled demo in a process of their own. First compilation is that of one adiabatic point without
machine code on the disk, once in each checkout.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.studies.results import report, study_parser, table

HERE = Path(__file__).resolve().parents[2]
#: Runs in either checkout; prints milliseconds by name as JSON.
MODEL = """
import itertools, json, math, resource, sys, time
from dataclasses import replace
import numpy as np
from model.bearing_file import load_bearing
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Setup

bearing = load_bearing("model/bearings/rocker.toml")
down, speed, lines = -math.pi / 2, 138.23, 2 * math.pi * np.array([10.0, 20.0, 25.0, 40.0, 50.0])


def setup_of(thermal="adiabatic", pivots="kirk", bearing=bearing):
    return Setup(bearing, pivot_laws(pivots, bearing), thermal)


def carrying_over():
    predict_setup(setup_of().change(carryover=0.8), 5000.0, down, speed, lines)


lengths = itertools.count(1)


def new_geometry():
    other = replace(bearing, length=bearing.length * (1.0 + 1e-3 * next(lengths)))
    predict_setup(setup_of(bearing=other), 5000.0, down, speed, lines)


def sweep(setup, points, lines):
    start = None
    for load, direction in points:
        start = predict_setup(setup, load, direction, speed, lines, start).equilibrium


def loads():
    for pivots in ("rigid", "kirk", 5e8):
        sweep(setup_of(pivots=pivots), [(load, down) for load in np.linspace(2500.0, 8750.0, 6).tolist()], lines)


def locus():
    sweep(setup_of(), [(5000.0, direction) for direction in np.linspace(-3.0, 3.0, 20).tolist()], np.array([speed]))


actions = {
    f"point, {thermal}, 5 frequencies": lambda t=thermal: predict_setup(setup_of(t), 5000.0, down, speed, lines)
    for thermal in ("isothermal", "adiabatic", "tehd", "thd")
}
actions["point, adiabatic, carry-over 0.8, 5 frequencies"] = carrying_over
actions["first point of a new geometry, adiabatic"] = new_geometry
actions["adiabatic, 6 loads x 5 frequencies x 3 pivots"] = loads
actions["adiabatic, locus of 20 directions"] = locus
if "first" in sys.argv:
    actions = {"point, adiabatic": actions["point, adiabatic, 5 frequencies"]}
times = {}
for name, action in actions.items():
    action()
    spent = []
    for _ in range(0 if "first" in sys.argv else 10):
        began = time.process_time()
        action()
        spent.append(time.process_time() - began)
    times[name] = 1e3 * min(spent, default=0.0)
times["peak memory [MB]"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
print(json.dumps(times))
"""
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"
COMMANDS = {
    "--help": ["--help"],
    "predict": ["predict", ROCKER, "--load", "5 kN", "--speed", "22 Hz", "--excitation", "25 Hz"],
    "identify": ["identify", DEMO],
    "compare": ["compare", DEMO],
    "diagnose": ["diagnose", DEMO, "--pivots", "measured"],
}


def run(checkout: Path, words: list[str], cache: str = "") -> tuple[str, float]:
    """Output and processor time [ms] of Python in a checkout; `cache`: where its machine code is."""
    python = checkout / ".venv" / "bin" / "python"
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(checkout)}
    if cache:
        threads["NUMBA_CACHE_DIR"] = cache
    command = [str(python) if python.exists() else sys.executable, "-P", *words]
    before = os.times()
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **threads}, cwd=checkout, check=False
    )
    after = os.times()
    if done.returncode:
        raise RuntimeError(f"{checkout}:\n{done.stderr}")
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return done.stdout, 1e3 * spent


def first_compilation(checkout: Path) -> dict[str, float]:
    """Of one point, and of a process that loads what was compiled [ms]."""
    with tempfile.TemporaryDirectory() as cache:
        first, again = (run(checkout, ["-c", MODEL, "first"], cache)[1] for _ in range(2))
    return {"first compilation, one adiabatic point": first, "the same process with machine code on the disk": again}


def measured(checkout: Path, model_only: bool) -> dict[str, float]:
    """One round in one checkout [ms]."""
    times: dict[str, float] = json.loads(run(checkout, ["-c", MODEL])[0])
    if model_only:
        return times
    with tempfile.TemporaryDirectory() as out:
        for name, words in COMMANDS.items():
            folder = [] if name == "--help" else ["--out", f"{out}/{name}"]
            times[f"`tpjb {name}`, whole process"] = run(checkout, ["-m", "tpjb_ident", *words, *folder])[1]
    return times


def main() -> None:
    asked = study_parser(__doc__, before=HERE, rounds=4, model_only=False).parse_args()
    checkouts = (asked.before.resolve(), HERE)
    for checkout in checkouts:
        measured(checkout, asked.model_only)  # compiled once, if it was not
    firsts = [first_compilation(checkout) for checkout in checkouts]
    rounds = [[measured(checkout, asked.model_only) for checkout in checkouts] for _ in range(asked.rounds)]
    rows = []
    for name in (*firsts[0], *rounds[0][0]):
        sides = [firsts] if name in firsts[0] else rounds
        before, after = (min(both[side][name] for both in sides) for side in (0, 1))
        rows.append((name, f"{before:.1f}", f"{after:.1f}", f"{after / before:.2f}"))
    report(asked, "speed", table(("what", "before [ms]", "after [ms]", "after / before"), rows))


if __name__ == "__main__":
    main()
