"""Mixtures as raw records: written by the virtual rig, identified and diagnosed by the command line.

    python -m tests.studies.diagnosis.volts --rows FILE [--bearing rocker] [--count 100] [--core 1] [--write]

Everything that may be off is drawn from its stated tolerance as in `mixtures`, the same kinds in the same order; the
rig writes a campaign of the paper's plan from it (bearing and pivots that are off, probes, cells and thermometers with
errors, noise, runout, drift, glitches, loads that miss their set points), and ``tpjb diagnose CAMPAIGN`` is run on it
with the bearing as drawn. The model that writes the records is ours, on a finer mesh than the one that diagnoses: what
is tested beyond `mixtures` is the way from volts to coefficients and the model itself in the place of its emulator. An
effect cannot be taken out of the library of a command: outside it are a cross-coupled stiffness and growth with the
load. Campaigns are deleted once they are diagnosed; rows that are there are not drawn again, so that a run that was
stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect, apply_effects
from model.pivots import pivot_laws
from model.setup import Setup
from rigdata.virtual_rig import Instruments, Noise, RigPlan, RigTruth, VirtualRig, write_campaign
from tests.studies.diagnosis.mixtures import BEARINGS, KINDS, OUTSIDE, Bench, Drawn, bench, draw, hidden
from tests.studies.diagnosis.tables import tables
from tests.studies.results import Rows, write_section
from tpjb_ident.compare.rig_from_model import (
    INSTRUMENT_ERRORS,
    ModelConvergenceError,
    erring_instruments,
    truth_of,
)
from tpjb_ident.diagnosis.forward.nuisance import Nuisance, Shift

#: Slow to simulate.
SKIPPED = frozenset({"pad_conduction", "pivot_friction"})
PROBES, CELLS = ("X1A", "X1B"), {"cell 1": "L1H", "cell 2": "L1V"}


def rig_of(name: str, drawn: Drawn, seed: int) -> VirtualRig:
    """A virtual rig with what was drawn in it."""
    text = (BEARINGS / f"{name}.toml").read_text(encoding="utf-8")
    bearing = load_bearing(BEARINGS / f"{name}.toml")
    known = list(zip(drawn.problem.nuisances, map(float, drawn.size), strict=True))
    physical = [(n, s) for n, s in known if n.change is not None and n.name not in {"probe_gain", "cell_gain"}]
    shift = Shift(tuple(n for n, _ in physical), tuple(s for _, s in physical))
    inside = [e for e in drawn.hidden if e.name not in INSTRUMENT_ERRORS]
    plain = Setup(bearing, pivot_laws("kirk", bearing))

    def setup(growth: float) -> Setup:
        more = [Effect("thermal_growth", clearance_change=growth)] if growth else []
        return shift(apply_effects(plain, [*inside, *more]))

    instruments = erring_instruments(Instruments.like_paper(len(bearing.pads), seed), drawn.hidden)
    return VirtualRig(
        truth=_truth(setup, drawn.growth, text), instruments=_off(instruments, known), campaign=f"volts-{seed}",
        noise=Noise.like_samples(), plan=RigPlan.like_paper(), seed=seed,
    )  # fmt: skip


def _truth(setup: Any, growth: float, text: str) -> RigTruth:
    """What a bearing does; its clearance grows in proportion to the load where that is hidden."""
    base = truth_of(setup(0.0), text)
    if not growth:
        return base
    at = functools.lru_cache(maxsize=4096)(lambda load: truth_of(setup(growth * load / 8750.0), text))
    return replace(
        base,
        stiffness=lambda point: at(point.static_load).stiffness(point),
        position=lambda point: at(point.static_load).position(point),
        temperature=lambda point: at(point.static_load).temperature(point),
    )


def _off(instruments: Instruments, known: list[tuple[Nuisance, float]]) -> Instruments:
    """Sensors whose gains and zeros are off as drawn."""
    changes: dict[str, dict[str, float]] = {}
    for one, size in known:
        if one.name == "probe_gain":
            changes[PROBES[int(one.place.split()[-1]) - 1]] = {"gain": 1.0 + size * one.sigma}
        elif one.name == "cell_gain":
            changes[CELLS[one.place]] = {"gain": 1.0 + size * one.sigma}
        elif one.name == "thermometer":
            changes[f"T{one.place.split()[-1]}"] = {"offset": size * one.sigma}
    sensors = []
    for sensor in instruments.sensors:
        new = dict(changes.get(sensor.name, {}))
        if "gain" in new:
            new["gain"] *= sensor.error.gain
        sensors.append(sensor.with_error(**new))
    return replace(instruments, sensors=tuple(sensors))


def run(one: Bench, name: str, kind: str, seed: int) -> dict[str, Any] | None:
    """Draw, write, diagnose one campaign; a row as of `mixtures.run`."""
    rng = np.random.default_rng([seed, 20190761])
    drawn = draw(replace(one, forward=one.forward.fresh()), kind, rng, OUTSIDE[1:])
    if drawn is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "campaign.h5"
        try:
            write_campaign(path, rig_of(name, drawn, seed))
        except ModelConvergenceError as error:
            return {"kind": kind, "seed": seed, "failed": f"no campaign: {error}", "code": None}
        out = Path(folder) / "out"
        began = os.times()
        command = [sys.executable, "-m", "tpjb_ident", "diagnose", str(path), "--out", str(out), "--quiet"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        spent = os.times()
        if not (out / "diagnosis.json").exists():
            return {"kind": kind, "seed": seed, "failed": done.stderr[-500:], "code": done.returncode}
        told = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    named = [
        {"name": e["name"], "parameters": {k: (p["value"], p["lo"], p["hi"]) for k, p in e["parameters"].items()}}
        for e in told["effects"]
    ]
    return {
        "kind": kind, "seed": seed, **hidden(drawn), "code": done.returncode, "verdict": told["verdict"],
        "named": named, "alike": told["indistinguishable"],
        "behaves_like": [b["words"] for b in told["behaves_like"]],
        "drift": [f"{d['effect']}: {d['words']}" for d in told["drift"]], "gap": told["gap"],
        "remainder": told["remainder"]["sigma"], "below_floor": told["below_floor"], "elsewhere": {},
        "seconds": spent.children_user + spent.children_system - began.children_user - began.children_system,
    }  # fmt: skip


def main() -> None:
    """Draw, write, diagnose, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bearing", default="rocker")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=80000)
    parser.add_argument("--rows", type=Path, default=Path("volts.jsonl"))
    parser.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    parser.add_argument("--core", type=int, help="run on this core only, with one worker")
    asked = parser.parse_args()
    if asked.core is not None:
        os.sched_setaffinity(0, {asked.core})
    stored = Rows(asked.rows, "bearing", "seed")
    one = bench(asked.bearing, None, SKIPPED)
    for number in range(asked.count):
        seed, began = asked.seed + number, time.time()
        if (asked.bearing, seed) not in stored.known:
            row = run(one, asked.bearing, KINDS[number % len(KINDS)], seed)
            if row is not None:
                stored.add({"bearing": asked.bearing, "wall": time.time() - began, **row})
    rows = [*stored.known.values()]
    text = tables([row for row in rows if "failed" not in row])
    print(text)
    if asked.write:
        write_section("volts", f"python -m tests.studies.diagnosis.volts --rows {asked.rows} --write", text)
    for row in rows:
        if "failed" in row:
            print(row["seed"], row["kind"], row["failed"])


if __name__ == "__main__":
    main()
