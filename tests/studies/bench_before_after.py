"""What a wait was and is: two checkouts in turn, in one run, as a table.

    python -m tests.studies.bench_before_after --before /path/of/an/older/checkout [--rounds 4]

Both run the same code, each with its own interpreter if it has one (`.venv`), in turn, so that a quiet moment of the
machine is everybody's. Times are processor times, the least of all rounds. Ratios are to one banded factorisation per
pad of the default mesh, by the loop of `bench_model`, taken in the same process.

The exponents say how the time grows: with the loads of a sweep, the pads of a bearing and the nodes of its films.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
#: Runs in either checkout; prints one JSON table of milliseconds.
CODE = """
import json, math, time
from dataclasses import replace
import numpy as np
from numba import njit
from model.bearing_file import load_bearing
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Mesh, Setup
from model.static_tests import locus, sweep

bearing = load_bearing(FILE)
down, speed, lines = -math.pi / 2, 138.23, 2 * math.pi * np.array([10.0, 20.0, 25.0, 40.0, 50.0])
n, width = 79 * 6, 6
matrix = -np.random.default_rng(1).random((n, width + 1))
matrix[:, 0] = 4.0 * width
band = np.empty_like(matrix)


@njit
def factorise(band):
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        pivot = band[k, 0]
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r] / pivot
            for s in range(r, width + 1):
                band[k + r, s - r] -= factor * band[k, s]
        for r in range(1, width + 1):
            band[k, r] /= pivot


def floor():
    for _ in range(20 * len(bearing.pads)):
        band[:] = matrix
        factorise(band)


def setup_of(thermal="adiabatic", pivots="kirk", of=bearing, **more):
    return Setup(of, pivot_laws(pivots, of), thermal, **more)


def point(setup, load=5000.0):
    found = predict_setup(setup, load, down, speed, lines)
    assert found.converged, found.status


def loads(count):
    for pivots in ("rigid", "kirk", 5e8):
        sweep(setup_of(pivots=pivots), [(float(w), down, speed, lines) for w in np.linspace(2500.0, 8750.0, count)])


def with_pads(count):
    arc, angles = 0.8 * 2 * math.pi / count, down + 2 * math.pi * np.arange(count) / count
    pads = tuple(replace(bearing.pads[0], pivot_angle=float(a), arc=arc) for a in angles)
    return replace(bearing, pads=pads)


actions = {
    "floor": floor,
    "point, isothermal": lambda: point(setup_of("isothermal")),
    "point, adiabatic": lambda: point(setup_of()),
    "point, TEHD": lambda: point(setup_of("tehd")),
    "6 loads x 5 frequencies x 3 pivots": lambda: loads(6),
    "locus of 20 directions": lambda: locus(setup_of(), 5000.0, np.linspace(-3.0, 3.0, 20), speed),
    **{f"loads {k}": lambda k=k: loads(k) for k in (3, 12, 24)},
    **{f"pads {k}": lambda k=k: point(setup_of(of=with_pads(k))) for k in (3, 4, 6, 8)},
    **{f"nodes {k}": lambda k=k: point(setup_of(mesh=Mesh(80 * k, 6))) for k in (1, 2, 4)},
}
table = {}
for name, action in actions.items():
    action()
    times = []
    for _ in range(5):
        began = time.process_time()
        action()
        times.append(time.process_time() - began)
    table[name] = 1e3 * min(times) / (20 if name == "floor" else 1)
print(json.dumps(table))
"""
#: The same of a new process: everything is on disk.
FRESH = """
from model.bearing_file import load_bearing
from model.predict import predict
predict(load_bearing(FILE), 5000.0, -1.5708, 138.23)
"""
SLOPES = {"loads": (3, 12, 24), "pads": (3, 4, 6, 8), "nodes": (1, 2, 4)}
POINTS = ("point, isothermal", "point, adiabatic", "point, TEHD")


def run(checkout: Path, code: str) -> tuple[str, float]:
    """Output and processor time [s] of code in a checkout."""
    python = checkout / ".venv" / "bin" / "python"
    file = checkout / "model" / "bearings" / "rocker.toml"
    code = code.replace("FILE", repr(str(file)))
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment = {**os.environ, "PYTHONPATH": str(checkout), **threads}
    command = [str(python) if python.exists() else sys.executable, "-c", code]
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=checkout, check=False)
    after = os.times()
    if done.returncode:
        raise RuntimeError(f"{checkout}:\n{done.stderr}")
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return done.stdout, spent


def least(rows: list[dict[str, float]]) -> dict[str, float]:
    """Least of every case over all rounds."""
    return {name: min(row[name] for row in rows) for name in rows[0]}


def exponent(table: dict[str, float], name: str) -> float:
    """Slope of the logarithm of time over that of a number."""
    numbers = SLOPES[name]
    x = [math.log(k) for k in numbers]
    y = [math.log(table[f"{name} {k}"]) for k in numbers]
    mx, my = sum(x) / len(x), sum(y) / len(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y, strict=True)) / sum((a - mx) ** 2 for a in x)


def rows_of(before: dict[str, float], after: dict[str, float]) -> list[list[str]]:
    """The table: what, before, after, their ratio, and both over the floor."""
    out = []
    for name in (*POINTS, "6 loads x 5 frequencies x 3 pivots", "locus of 20 directions", "first answer", "--help"):
        a, b = before[name], after[name]
        floors = [f"{t[name] / t['floor']:.0f}" if name in POINTS else "" for t in (before, after)]
        out.append([name, f"{a:.1f}", f"{b:.1f}", f"{a / b:.1f}", *floors])
    for name in SLOPES:
        slopes = [f"{exponent(t, name):.2f}" for t in (before, after)]
        out.append([f"exponent over {name}", *slopes, "", "", ""])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, help="an older checkout")
    parser.add_argument("--rounds", type=int, default=4)
    arguments = parser.parse_args()
    checkouts = (arguments.before.resolve(), HERE)
    found: tuple[list[dict[str, float]], list[dict[str, float]]] = ([], [])
    for checkout in checkouts:
        run(checkout, FRESH)  # compiled once, if it was not
    for _ in range(arguments.rounds):
        for checkout, rows in zip(checkouts, found, strict=True):
            row = json.loads(run(checkout, CODE)[0])
            row["first answer"] = 1e3 * run(checkout, FRESH)[1]
            row["--help"] = 1e3 * run(checkout, "import sys; sys.argv = ['tpjb', '--help']\n" + HELP)[1]
            rows.append(row)
    head = ["what", "before [ms]", "after [ms]", "times faster", "before, over the floor", "after, over the floor"]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows_of(least(found[0]), least(found[1])):
        print("| " + " | ".join(row) + " |")


HELP = "import contextlib, io, runpy\nwith contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n    runpy.run_module('tpjb_ident', run_name='__main__')\n"  # noqa: E501

if __name__ == "__main__":
    main()
