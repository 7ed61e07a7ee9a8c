"""Mixtures that another program computed: K and C by the ROSS fluid-film engine, diagnosed as tables.

    python -m tests.studies.diagnosis.peer_tables --python /path/to/an/environment/with/ross/bin/python
        [--count 20] [--seed 0] [--rows FILE] [--again] [--model-tolerance 0.03]

The paper's rocker bearing with pivots of 1e9 N/m and an adiabatic film on ROSS's own mesh: ten points (six loads at
25 Hz, four more frequencies at 5 kN). Every campaign's oil, inlet, clearances and pivots are drawn from the default
tolerances, noise is 0.5 % of the direct coefficients; one or two effects are hidden, or a cross-coupled stiffness
that no effect of the library does. A table holds no locus, no dry tests and no temperatures, so look-alikes that these
would tell apart may stay *ambiguous*. What ROSS computed is kept in the rows: it is not computed again, and `--again`
diagnoses it anew.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from model.effects import Effect
from tests.studies.bench_ross import SPEED, bearing, peer_case
from tpjb_ident.arrays import ComplexArray
from tpjb_ident.diagnosis.campaign import Baseline, diagnose_table
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings

HZ = 2 * math.pi
PIVOTS, NOISE, MESH = 1e9, 0.005, (40, 20)
POINTS = [(load, 25.0) for load in (2500.0, 3750.0, 5000.0, 6250.0, 7500.0, 8750.0)] + [
    (5000.0, f) for f in (10.0, 20.0, 40.0, 50.0)
]
#: What is hidden, one campaign after the other: a size of each is drawn.
KINDS = (
    (), ("pivot_flexibility",), ("thermal_growth",), ("structure_compliance",), ("pivot_flexibility", "oil_viscosity"),
    ("outside",), ("oil_viscosity",), ("supply_temperature",), ("structure_compliance", "thermal_growth"),
    ("hot_oil_carryover",),
)  # fmt: skip
CHILD = """
import json, sys, warnings
warnings.simplefilter("ignore")
from ross.bearings.fluid_film_bearing import FluidFilmBearing
names = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")
for case in json.loads(sys.stdin.read()):
    one = FluidFilmBearing(n=0, **case)
    print("ROW " + json.dumps([float(getattr(one, name)[0]) for name in names]), flush=True)
"""


def draw(kind: tuple[str, ...], rng: np.random.Generator) -> list[Effect]:
    """Sizes of what is hidden."""
    sizes: dict[str, dict[str, float]] = {
        "pivot_flexibility": {"stiffness_factor": float(rng.uniform(0.45, 0.75))},
        "thermal_growth": {"clearance_change": float(rng.choice([-1, 1]) * rng.uniform(8e-6, 14e-6))},
        "structure_compliance": {
            "stiffness": float(rng.uniform(4e8, 1.2e9)), "direction": float(rng.uniform(0.0, math.pi)),
        },
        "oil_viscosity": {"factor": float(rng.choice([rng.uniform(0.65, 0.8), rng.uniform(1.25, 1.4)]))},
        "supply_temperature": {"change": float(rng.choice([-1, 1]) * rng.uniform(4.0, 8.0))},
        "hot_oil_carryover": {"fraction": float(rng.uniform(0.5, 0.8))},
    }  # fmt: skip
    return [Effect(name, **sizes[name]) for name in kind if name in sizes]


def cases(hidden: list[Effect], rng: np.random.Generator) -> list[dict[str, Any]]:
    """The peer's constructor at every point; what may be off is drawn within two standard deviations."""
    off = np.clip(rng.standard_normal(4 + 5), -2.0, 2.0)
    of = {e.name: e.parameters for e in hidden}
    growth = of.get("thermal_growth", {}).get("clearance_change", 0.0)
    oil = (1 + 0.05 * off[0]) * of.get("oil_viscosity", {}).get("factor", 1.0)
    warm = 0.5 * off[1] + of.get("supply_temperature", {}).get("change", 0.0)
    pad = bearing().pads[0]
    assembled = pad.assembled_clearance + 2e-6 * off[2] + growth
    radius = pad.assembled_clearance / (1 - pad.preload) + 3e-6 * off[3] + growth
    pivots = PIVOTS * of.get("pivot_flexibility", {}).get("stiffness_factor", 1.0)
    out = []
    for load, frequency in POINTS:
        one = peer_case("adiabatic", MESH, pivots) | {"num_processes": 1, "weight": load}
        one["excitation_ratio"] = HZ * frequency / SPEED
        one["hot_oil_lambda"] = of.get("hot_oil_carryover", {}).get("fraction", 0.0)
        one["oil_supply_temperature"] += warm
        for key in ("liquid_viscosity1", "liquid_viscosity2"):
            one["lubricant"][key] *= oil
        one["radial_clearance"] = assembled
        # the pads sit 2 um nearer or farther each: the pad's own preload says so here
        one["preload"] = [1 - (assembled + 2e-6 * d) / radius for d in off[4:]]
        out.append(one)
    return out


def rig(h: ComplexArray, hidden: list[Effect], outside: float) -> ComplexArray:
    """What a rig adds to the oil film: a structure in series, a cross-coupled stiffness in parallel."""
    for e in hidden:
        if e.name == "structure_compliance":
            n = np.array([math.cos(e.parameters["direction"]), math.sin(e.parameters["direction"])])
            h = np.asarray(np.linalg.inv(np.linalg.inv(h) + np.outer(n, n) / e.parameters["stiffness"]), complex)
    return np.asarray(h + outside * np.array([[0.0, 1.0], [-1.0, 0.0]]))


def write_table(path: Path, found: list[list[float]], hidden: list[Effect], outside: float, seed: int) -> None:
    """K and C as a rig would have identified them."""
    rng = np.random.default_rng([seed, 7])
    rows = []
    for (load, frequency), values in zip(POINTS, found, strict=True):
        k, c = np.reshape(values[:4], (2, 2)), np.reshape(values[4:], (2, 2))
        h = rig(k + 1j * HZ * frequency * c, hidden, outside)
        row: dict[str, Any] = {"static_load_N": load, "static_load_direction_deg": -90.0, "shaft_speed_Hz": SPEED / HZ}
        row["excitation_Hz"] = frequency
        for part, unit, value in (("k", "N_per_m", h.real), ("c", "Ns_per_m", h.imag / (HZ * frequency))):
            error = NOISE * float(np.mean(np.abs(np.diag(value))))
            for i, j in np.ndindex(2, 2):
                name = f"{part}{'xy'[i]}{'xy'[j]}_{unit}"
                row[name] = value[i, j] + error * rng.standard_normal()
                row[f"{name}_se"] = error
        rows.append(row)
    pd.DataFrame(rows).to_csv(path, index=False)


def run(
    python: str, kind: tuple[str, ...], seed: int, tolerance: float, kept: list[list[float]] | None = None
) -> dict[str, Any]:
    """Compute (or take what is kept) and diagnose one campaign; a row with what came out."""
    rng = np.random.default_rng([seed, 20190761])
    hidden = draw(kind, rng)
    outside = float(rng.choice([-1, 1]) * rng.uniform(2e7, 4e7)) if "outside" in kind else 0.0
    found = kept or computed(python, cases(hidden, rng))
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "peer.csv"
        write_table(path, found, hidden, outside, seed)
        settings = DiagnoseSettings(workers=1, tolerances=Tolerances().states({"model": tolerance}, "study"))
        result = diagnose_table(path, bearing(), Baseline(PIVOTS), settings).diagnosis.verdict
    named = [{"name": e.name, **{k: (p.value, p.lo, p.hi) for k, p in e.parameters.items()}} for e in result.effects]
    return {
        "seed": seed, "kind": kind, "outside": outside, "truth": [{"name": e.name, **e.parameters} for e in hidden],
        "verdict": result.verdict, "named": named, "alike": [list(g) for g in result.indistinguishable],
        "behaves_like": [b.words for b in result.behaves_like], "seconds": time.process_time() - began, "peer": found,
    }  # fmt: skip


def computed(python: str, asked: list[dict[str, Any]]) -> list[list[float]]:
    """K and C of the peer at every point."""
    text = json.dumps(asked)
    done = subprocess.run([python, "-c", CHILD], input=text, capture_output=True, text=True, check=False)
    found = [json.loads(line[4:]) for line in done.stdout.splitlines() if line.startswith("ROW ")]
    if len(found) != len(asked):
        raise SystemExit(f"ROSS gave {len(found)} of {len(asked)} points: {done.stderr[-300:]}")
    return found


def table(rows: list[dict[str, Any]]) -> str:
    """What was hidden and what was said, campaign by campaign."""
    lines = ["| hidden | verdict | said (95 %) |", "|---|---|---|"]
    for row in rows:
        truth = "; ".join(_words(e) for e in row["truth"]) or "nothing"
        truth += f"; cross-coupled {row['outside']:.3g} N/m" * bool(row["outside"])
        said = "; ".join(_words(e) for e in row["named"]) or "; ".join(row.get("behaves_like", []))
        alike = " or ".join("/".join(g) for g in row["alike"])
        lines.append(f"| {truth} | *{row['verdict']}* | {said}{f' ({alike})' if alike else ''} |")
    return "\n".join(lines)


def _words(e: dict[str, Any]) -> str:
    def shown(value: Any) -> str:
        return (
            f"{value:.4g}" if isinstance(value, (int, float)) else f"{value[0]:.4g} ({value[1]:.4g} to {value[2]:.4g})"
        )

    return f"`{e['name']}` " + ", ".join(f"{k} {shown(v)}" for k, v in e.items() if k != "name")


def main() -> None:
    """Compute what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable, help="an interpreter that can import ross")
    parser.add_argument("--count", type=int, default=2 * len(KINDS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path, default=Path("peer_tables.jsonl"))
    parser.add_argument("--model-tolerance", type=float, default=Tolerances()["model"], help="share of K and omega C")
    parser.add_argument("--again", action="store_true", help="diagnose what is kept anew")
    asked = parser.parse_args()
    kept = [json.loads(t) for t in asked.rows.read_text("utf-8").splitlines()] if asked.rows.exists() else []
    known = {row["seed"]: row for row in kept}
    for number in range(asked.count):
        seed, kind = asked.seed + number, KINDS[number % len(KINDS)]
        if asked.again and seed in known:
            known[seed] = run(asked.python, kind, seed, asked.model_tolerance, known[seed]["peer"])
        elif seed not in known:
            known[seed] = run(asked.python, kind, seed, asked.model_tolerance)
        asked.rows.write_text("".join(json.dumps(row, default=float) + "\n" for row in known.values()), "utf-8")
    print(f"{len(known)} campaigns\n\n{table(list(known.values()))}")


if __name__ == "__main__":
    main()
