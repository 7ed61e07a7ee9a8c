"""How time grows with runs and with candidates: the slopes that `bench_before_after` (loads, pads, nodes) lacks.

    OMP_NUM_THREADS=1 python -m tests.studies.growth [--runs 6 12 24 48] [--keep 8 16 32] [--rounds 3]

Runs: records of the virtual rig, each named several times, are identified (all of them at two operating points) in one
process; reading alone, and with the estimates of the points. Candidates: a table of coefficients, computed with one
effect, is diagnosed with the first so many kinds of effects left in; those that can be of single pads are several.
Processor times, the least of several; the slope is that of the logarithms.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect
from model.effects.registry import known_effects
from rigdata.operating_point import OperatingPoint
from tests.studies.archive_cluster import write_records
from tpjb_ident.compare.predictions import ModelSettings, predict_points, prediction_frame
from tpjb_ident.diagnosis.campaign import diagnose_table
from tpjb_ident.diagnosis.forward.candidates import candidates
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings
from tpjb_ident.dynamic.identify import identify
from tpjb_ident.dynamic.runs.run_jobs import all_runs
from tpjb_ident.dynamic.settings import IdentifySettings

BEARING = load_bearing(Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml")
#: What the table is computed with; stays among the candidates.
HIDDEN = "supply_temperature"


def least(action: Callable[[], object], rounds: int) -> float:
    """Least processor time of several calls [s]."""
    times = []
    for _ in range(rounds):
        began = time.process_time()
        action()
        times.append(time.process_time() - began)
    return min(times)


def show(name: str, counts: list[int], times: list[float]) -> None:
    """Times, and the slope of their logarithms."""
    for count, spent in zip(counts, times, strict=True):
        print(f"  {count:5d} {name}: {spent:7.2f} s, {1e3 * spent / count:7.1f} ms each", flush=True)
    slope = np.polyfit(np.log(counts), np.log(times), 1)[0] if len(counts) > 1 else math.nan
    print(f"  time grows as {name} to the power {slope:.2f}")


def over_runs(counts: list[int], rounds: int) -> None:
    """Reading of runs, and whole identifications."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = write_records(Path(folder) / "runs.h5", 12, 3.0)
        runs, settings = campaign.of_kind("dynamic"), IdentifySettings()
        some = {
            n: replace(campaign, runs=tuple(replace(runs[k % len(runs)], id=f"r{k}") for k in range(n))) for n in counts
        }

        def read(count: int) -> None:
            all_runs(some[count], settings.phasors, lambda *told: None).close()

        read(counts[0])
        print("runs of 3 s, read and turned to phasors")
        show("runs", counts, [least(lambda n=n: read(n), rounds) for n in counts])  # type: ignore[misc]
        print("the same, identified at their two operating points")
        show("runs", counts, [least(lambda n=n: identify(some[n], settings), rounds) for n in counts])  # type: ignore[misc]


def over_candidates(kept: list[int], rounds: int) -> None:
    """Diagnoses of one table."""
    loads, lines = (2500.0, 5000.0, 7500.0), (20.0, 40.0)
    turn = 2 * math.pi
    points = [OperatingPoint(load, -math.pi / 2, 22 * turn, f * turn) for load in loads for f in lines]
    hidden = ModelSettings(effects=(Effect(HIDDEN, change=5.0),))
    names = sorted(known_effects(), key=lambda name: name != HIDDEN)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        prediction_frame(predict_points(BEARING, points, hidden), mesh_error=False).to_csv(path, index=False)
        counts, times = [], []
        for keep in kept:
            skip = frozenset(names[keep:])
            counts.append(len(candidates(BEARING, skip)))
            settings = DiagnoseSettings(skip=skip)
            times.append(least(lambda s=settings: diagnose_table(path, BEARING, None, s, 0.02), rounds))  # type: ignore[misc]
    print("a table of 6 points, diagnosed")
    show("candidates", counts, times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, nargs="*", default=[6, 12, 24, 48], help="none: leave them out")
    parser.add_argument(
        "--keep", type=int, nargs="*", default=[8, 16, 32], help="kinds of effects; none: leave them out"
    )
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    if given.runs:
        over_runs(given.runs, given.rounds)
    if given.keep:
        over_candidates(given.keep, given.rounds)


if __name__ == "__main__":
    main()
