"""Evidence for `tpjb diagnose`: hidden effects of a set size, no-effect campaigns, the true effect left out.

    python tests/benchmarks/evaluate_diagnosis.py --out results.jsonl --sizes 6 12 --seeds 1 --none 30 --left-out 1

Campaigns are drawn as observation vectors: a model with a finer film mesh and the hidden effect, calibration errors
drawn from the certificates, identification noise drawn from its covariance, and a smooth difference between two
programs of a third of the fine tolerance. (Raw-volt campaigns through the virtual rig take ten times as long:
``--raw`` runs those.) Lines are appended as they come; ``--table`` prints the confusion matrix of a file.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from model.bearing import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tpjb_ident.diagnose.candidates import Candidate, candidates
from tpjb_ident.diagnose.diagnose import diagnose
from tpjb_ident.diagnose.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.layout import Layout
from tpjb_ident.diagnose.nuisance import Certificates, nuisances, whitener
from tpjb_ident.diagnose.planned import around, dry, dynamic, planned_observations
from tpjb_ident.diagnose.settings import DiagnoseSettings

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
SPEED = 2 * math.pi * 22
HZ = 2 * math.pi


def layout(pads: int = 5) -> Layout:
    """Loads and frequencies of the paper, thinned to keep a campaign short."""
    sweep = dynamic([5000.0], [HZ * f for f in (10.0, 25.0, 35.0, 48.0)], SPEED, -math.pi / 2, pads)
    loads = dynamic([2500.0, 3750.0, 7500.0, 8750.0], [HZ * 25.0], SPEED, -math.pi / 2, pads)
    tests = tuple(sorted((*sweep, *loads), key=lambda t: t.load))
    return Layout(tests, around(5000.0, 10, SPEED), dry(range(1, pads + 1)), 200.0)


class Bench:
    """One bearing with its layout, prepared once."""

    def __init__(self, name: str) -> None:
        bearing = load_bearing(BEARINGS / f"{name}.toml")
        self.setup = Setup(bearing, pivot_laws("kirk", bearing))
        self.observations = planned_observations(self.setup, layout(len(bearing.pads)))
        self.truth = Forward(self.setup.change(mesh=Mesh(112, 8)), self.observations.layout, self.observations.elements)
        self.base = self.truth()
        self.nuisances = nuisances(self.truth, (), self.base, Certificates())
        self.factor = whitener(self.observations, self.nuisances.columns)
        self.pool = candidates(bearing)

    def size(self, effect: Effect) -> float:
        """d': whitened size of an effect."""
        return float(np.linalg.norm(np.linalg.solve(self.factor, self.truth.fresh()((effect,)) - self.base)))

    def sized(self, candidate: Candidate, wanted: float, sign: float) -> Effect | None:
        """Effect of a candidate with the wanted d' (within 3 %), or None if its bounds do not reach it."""
        low, high = 0.0, 0.02 * candidate.step
        try:
            while self.size(candidate.effect(candidate.neutral + sign * high)) < wanted:
                low, high = high, 2 * high
                if high > 60 * candidate.step or not _inside(candidate, candidate.neutral + sign * high):
                    return None
            for _ in range(12):
                middle = 0.5 * (low + high)
                now = self.size(candidate.effect(candidate.neutral + sign * middle))
                if abs(now / wanted - 1) < 0.03:
                    break
                low, high = (middle, high) if now < wanted else (low, middle)
        except NoEquilibriumError:
            return None
        return candidate.effect(candidate.neutral + sign * middle)

    def draw(self, effects: tuple[Effect, ...], rng: np.random.Generator):  # type: ignore[no-untyped-def]
        """A campaign's observation vector with hidden effects."""
        from dataclasses import replace

        clean = self.truth.fresh()(effects)
        errors = self.nuisances.columns @ rng.standard_normal(self.nuisances.columns.shape[1])
        noise = np.sqrt(np.diag(self.observations.covariance)) * rng.standard_normal(len(clean))
        program = self.observations.fine / 3.0 * rng.standard_normal(len(clean))
        return replace(self.observations, value=clean + errors + noise + program)


def _inside(candidate: Candidate, amplitude: float) -> bool:
    low, high = candidate.bounds
    return low <= amplitude <= high


def run_one(bench: Bench, effects: tuple[Effect, ...], seed: int, skip: frozenset[str] = frozenset()) -> dict:
    """Draw and diagnose one campaign."""
    start = time.perf_counter()
    observations = bench.draw(effects, np.random.default_rng(seed))
    try:
        verdict = diagnose(observations, bench.setup, DiagnoseSettings(skip=skip, workers=1)).verdict
    except NoEquilibriumError as error:
        return {"verdict": "failed", "why": str(error)}
    return {
        "verdict": verdict.verdict,
        "effects": [
            {"name": e.name, "parameters": {k: [p.value, p.lo, p.hi] for k, p in e.parameters.items()}}
            for e in verdict.effects
        ],
        "groups": [list(g) for g in verdict.indistinguishable],
        "gap": verdict.gap,
        "reasons": list(verdict.reasons),
        "next_test": verdict.next_test,
        "seconds": round(time.perf_counter() - start, 1),
    }


def cases(bench: Bench, name: str, options: argparse.Namespace):  # type: ignore[no-untyped-def]
    """Every campaign to run, as (label, effects, seed, skip)."""
    for seed in range(options.none):
        yield {"bearing": name, "kind": "none", "size": 0, "truth": "", "seed": seed}, (), frozenset()
    for size in options.sizes:
        for index, candidate in enumerate(bench.pool):
            if options.only and candidate.name not in options.only:
                continue
            sign = -1.0 if index % 2 and _inside(candidate, candidate.neutral - 1e-9 * candidate.step) else 1.0
            effect = bench.sized(candidate, size, sign)
            label = {"bearing": name, "size": size, "truth": candidate.label, "name": candidate.name}
            if effect is None:
                yield {**label, "kind": "unreachable", "seed": 0}, None, frozenset()
                continue
            label["parameters"] = dict(effect.parameters)
            for seed in range(options.seeds):
                yield {**label, "kind": "hidden", "seed": 1000 + seed}, (effect,), frozenset()
            for seed in range(options.left_out):
                yield {**label, "kind": "left out", "seed": 2000 + seed}, (effect,), frozenset({candidate.name})


def main() -> None:
    """Run or print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("diagnosis-evidence.jsonl"))
    parser.add_argument("--bearings", nargs="+", default=["rocker"])
    parser.add_argument("--sizes", nargs="+", type=float, default=[6.0, 12.0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--none", type=int, default=20)
    parser.add_argument("--left-out", type=int, default=0, dest="left_out")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--table", action="store_true", help="Print the tables of --out instead of running.")
    options = parser.parse_args()
    if options.table:
        print_tables([json.loads(line) for line in options.out.read_text().splitlines()])
        return
    for name in options.bearings:
        bench = Bench(name)
        for label, effects, skip in cases(bench, name, options):
            result = {} if effects is None else run_one(bench, effects, label["seed"], skip)
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps({**label, **result}) + "\n")
            names = [e["name"] for e in result.get("effects", [])]
            what = (label["kind"], label["size"], label["truth"], "->", result.get("verdict"), names)
            print(*what, result.get("groups"), result.get("seconds"), flush=True)


def judge(row: dict) -> str:
    """Correct, in a group, wrong, abstained."""
    if row["kind"] == "none":
        return "no alarm" if row["verdict"] == "consistent" else "false alarm"
    names = [e["name"] for e in row["effects"]]
    group = {n for g in row["groups"] for n in g}
    if row["verdict"] == "named":
        return "named right" if names == [row["name"]] else "named wrong"
    if row["verdict"] == "ambiguous":
        return "group right" if row["name"] in group and len(group) <= 3 else "group wrong"
    return row["verdict"]


def print_tables(rows: list[dict]) -> None:
    """Verdicts by kind and size, coverage and gap closure."""
    rows = [r for r in rows if r.get("verdict") not in {None, "failed"}]
    table: dict[tuple, Counter] = defaultdict(Counter)
    for row in rows:
        table[(row["bearing"], row["kind"], row["size"])][judge(row)] += 1
    for key, counts in sorted(table.items()):
        print(*key, dict(counts), "of", sum(counts.values()))
    inside, total, closed = 0, 0, []
    for row in rows:
        if row["kind"] == "hidden" and judge(row) == "named right":
            for name, true in row["parameters"].items():
                _, lo, hi = row["effects"][0]["parameters"][name]
                if lo < hi:
                    total += 1
                    inside += lo <= true <= hi
            before, after, floor = (row["gap"][k] for k in ("heldout_before", "heldout_after", "noise_floor"))
            if before > floor:
                closed.append(1 - (after**2 - floor**2) / (before**2 - floor**2))
    if total:
        print(f"95 % intervals hold the truth in {inside} of {total}")
        print(f"median held-out gap closure {np.median(closed):.2f}")


if __name__ == "__main__":
    sys.exit(main())
