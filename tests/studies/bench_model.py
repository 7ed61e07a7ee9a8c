"""What the bearing model costs, against the targets of issue 3, with the mesh error that goes with it.

    OMP_NUM_THREADS=1 python tests/studies/bench_model.py [--rounds 8] [--only adiabatic] [--profile] [--cold]

Times are processor times, the least of several runs: on a shared machine the clock on the wall tells about the
neighbours. Ratios are against the floor, one banded factorisation per pad on the same mesh, measured in the same run
and with a loop of this file's own, so that it stays the same while the solver changes.
"""

from __future__ import annotations

import argparse
import cProfile
import math
import os
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit

from model.bearing_file import load_bearing
from model.pivots import pivot_laws
from model.predict import predict
from model.prediction import Prediction
from model.setup import Mesh, Setup
from model.static_tests import locus, sweep

FILE = Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml"
BEARING = load_bearing(FILE)
SPEED, DOWN = 2 * math.pi * 22.0, -math.pi / 2
EXCITATION = 2 * math.pi * np.array([10.0, 20.0, 25.0, 40.0, 50.0])
FINE = Mesh(320, 24)
#: Runs in a process of its own: seconds from the first import to the first prediction, then the peak memory [MB].
FRESH = f"""
import time; began = time.perf_counter()
import resource
from model.bearing_file import load_bearing
from model.predict import predict
point = (load_bearing({str(FILE)!r}), 5000.0, -1.5708, 138.23)
predict(*point, thermal=THERMAL)
print(time.perf_counter() - began, time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


class Case(NamedTuple):
    """One row of the table: what is computed, and the most it may take [ms]."""

    name: str
    action: Callable[[], object]
    target: float


def point(thermal: str, mesh: Mesh | None = None) -> Prediction:
    p = predict(BEARING, 5000.0, DOWN, SPEED, EXCITATION, thermal=thermal, mesh=mesh)
    if not p.converged:
        raise RuntimeError(f"{thermal} on {mesh or Mesh()} did not converge: {p.status}; its time means nothing")
    return p


def comparison() -> None:
    """The paper's: 6 loads x 5 frequencies x 3 pivot models, each load from those before."""
    for pivots in ("rigid", "kirk", 5e8):
        setup = Setup(BEARING, pivot_laws(pivots, BEARING))
        sweep(setup, [(float(load), DOWN, SPEED, EXCITATION) for load in np.linspace(2500.0, 8750.0, 6)])


def locus_of_20() -> None:
    setup = Setup(BEARING, pivot_laws("kirk", BEARING))
    locus(setup, 5000.0, np.linspace(-math.pi, math.pi, 20, endpoint=False), SPEED)


CASES = (
    Case("isothermal, 5 frequencies", lambda: point("isothermal"), 8.0),
    Case("adiabatic, 5 frequencies", lambda: point("adiabatic"), 20.0),
    Case("tehd (compliance cached), 5 frequencies", lambda: point("tehd"), 50.0),
    Case("adiabatic, 6 loads x 5 frequencies x 3 pivots", comparison, 200.0),
    Case("adiabatic, locus of 20 directions", locus_of_20, 300.0),
)


def least(action: Callable[[], object], repeats: int) -> float:
    """Least processor time of `repeats` runs after one to warm up [s]."""
    action()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        action()
        times.append(time.process_time() - began)
    return min(times)


@njit
def factorise(band: np.ndarray) -> None:
    """L D L^T of a symmetric band matrix in place: band[k, 0] = D, band[k, r] = L[k + r, k]."""
    n, width = band.shape[0], band.shape[1] - 1
    for k in range(n):
        pivot = band[k, 0]
        for r in range(1, min(width, n - 1 - k) + 1):
            factor = band[k, r] / pivot
            for s in range(r, width + 1):
                band[k + r, s - r] -= factor * band[k, s]
        for r in range(1, width + 1):
            band[k, r] /= pivot


def floor(mesh: Mesh, repeats: int) -> float:
    """One banded factorisation per pad [s]: one unknown per inner node along and per node across, but for the edge."""
    n, width = (mesh.along - 1) * mesh.across, mesh.across
    matrix = -np.random.default_rng(1).random((n, width + 1))
    matrix[:, 0] = 4.0 * width
    band = np.empty_like(matrix)
    rounds = 20  # one alone is too short for the clock

    def run() -> None:
        for _ in range(rounds * len(BEARING.pads)):
            band[:] = matrix
            factorise(band)

    return least(run, repeats) / rounds


def mesh_error(thermal: str) -> float:
    """Largest relative error of the direct coefficients against a mesh of 320 x 24."""
    fine, default = point(thermal, FINE), point(thermal)
    names = ("kxx", "kyy", "cxx", "cyy")
    return max(float(np.abs(getattr(default, n) / getattr(fine, n) - 1.0).max()) for n in names)


def show_cases(cases: list[Case], rounds: int) -> None:
    """Floor and cases in turn, so that a quiet moment of the machine is everybody's."""
    base, times = math.inf, [math.inf] * len(cases)
    for _ in range(rounds):
        base = min(base, floor(Mesh(), 3))
        times = [min(t, least(case.action, 2)) for t, case in zip(times, cases, strict=True)]
    print(f"floor, one factorisation per pad: {1e3 * base:.3f} ms of processor time")
    print(f"{'case':46s} {'ms':>8s} {'target':>7s} {'x floor':>8s}")
    for case, seconds in zip(cases, times, strict=True):
        mark = "" if 1e3 * seconds <= case.target else "   missed"
        print(f"{case.name:46s} {1e3 * seconds:8.1f} {case.target:7.0f} {seconds / base:8.0f}{mark}", flush=True)


def show_growth(thermal: str, repeats: int) -> None:
    """Time against film nodes at a fixed number of axial nodes, to eight times the default mesh."""
    nodes, times = [], []
    print(f"{thermal} against film nodes, {Mesh().across} intervals across half the width:")
    for scale in (1, 2, 4, 8):
        mesh = Mesh(scale * Mesh().along, Mesh().across)
        result = point(thermal, mesh)
        nodes.append((mesh.along + 1) * (mesh.across + 1) * len(BEARING.pads))
        times.append(1e3 * least(lambda mesh=mesh: point(thermal, mesh), repeats))
        rate = times[-1] / nodes[-1] * 1e3
        print(
            f"  {mesh.along:4d} along, {nodes[-1]:6d} nodes: {times[-1]:7.1f} ms, {rate:5.2f} us/node, "
            f"{result.equilibrium.iterations} iterations",
            flush=True,
        )
    print(f"  time grows as nodes to the power {np.polyfit(np.log(nodes), np.log(times), 1)[0]:.2f}")


def child(command: list[str], env: dict[str, str]) -> list[float]:
    out = subprocess.run(command, capture_output=True, text=True, env=env, check=False)
    if out.returncode:
        raise RuntimeError(f"a prediction in a new process failed:\n{out.stderr}")
    return [float(x) for x in out.stdout.split()]


def show_fresh(thermal: str, environment: dict[str, str] | None = None) -> None:
    """First call in a new process, and its peak memory."""
    command = [sys.executable, "-c", FRESH.replace("THERMAL", repr(thermal))]
    env = os.environ | (environment or {})
    runs = np.array([child(command, env) for _ in range(3)])
    wall, processor, memory = runs.min(axis=0)
    print(
        f"  {thermal:10s} {wall:5.2f} s ({processor:.2f} s of processor time), peak memory {memory:.0f} MB", flush=True
    )


def show_cold() -> None:
    """The very first call after an installation: everything is compiled."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", FRESH.replace("THERMAL", "'adiabatic'")]
        env = os.environ | {"NUMBA_CACHE_DIR": folder}
        wall, processor, _ = child(command, env)
    print(f"first call with nothing compiled yet: {wall:.1f} s ({processor:.1f} s processor time)")


def profile(action: Callable[[], object]) -> None:
    action()
    watch = cProfile.Profile()
    watch.enable()
    for _ in range(10):
        action()
    watch.disable()
    pstats.Stats(watch).sort_stats("tottime").print_stats(18)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=8, help="each times every case twice")
    parser.add_argument("--only", default="", help="cases whose name has this in it, and nothing else")
    parser.add_argument("--profile", action="store_true", help="show where the time of those cases goes")
    parser.add_argument("--cold", action="store_true", help="also without any compiled code on disk (a minute)")
    arguments = parser.parse_args()
    cases = [c for c in CASES if arguments.only in c.name]
    if arguments.profile:
        for case in cases:
            print(case.name)
            profile(case.action)
        return
    show_cases(cases, arguments.rounds)
    if arguments.only:
        return
    for thermal in ("isothermal", "adiabatic"):
        print(f"mesh error of K and C, {thermal}: {mesh_error(thermal):.2%} (target 0.2 %)", flush=True)
    for thermal in ("isothermal", "adiabatic"):
        show_growth(thermal, arguments.rounds)
    print("first call in a new process (target 3 s, 500 MB):")
    for thermal in ("isothermal", "adiabatic", "tehd"):
        show_fresh(thermal)
    here = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of this process, all cases to 8x the default mesh: {here:.0f} MB")
    if arguments.cold:
        show_cold()


if __name__ == "__main__":
    main()
