"""Mixtures: bearings within workshop tolerance of their drawings, with hidden effects, through the whole decision.

    python -m tests.studies.diagnosis.mixtures [--bearing rocker] [--count 40] [--seed 0] [--rows FILE]

Campaigns of the paper's plan are drawn from the model itself on a finer film mesh: everything that may be off is drawn
from its stated tolerance (cut off at two standard deviations), the model differs smoothly by 0.05 %, noise is what the
sample campaigns have. Kinds: ``scatter`` (nothing hidden), ``one``, ``two`` (effects of the library), ``outside`` (an
effect that is taken out of the library, a cross-coupled stiffness, or growth in proportion to the load), ``beside``
(an effect of the library and one outside it). Rows go to a JSON-lines file; the tables are made from it.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.tables import tables
from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.diagnose import ACCURACY, MESH, pose, solve
from tpjb_ident.diagnose.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnose.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.forward.nuisance import predict
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.observations.observe import Observations
from tpjb_ident.diagnose.observations.scale import coordinate, direct_scale
from tpjb_ident.diagnose.plan.planned import around, dry, dynamic, planned_observations
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.screen import visible
from tpjb_ident.diagnose.search.search import baseline_fit
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

BEARINGS = Path(__file__).parents[3] / "model" / "bearings"
SPEED = 2 * math.pi * 22
#: Mesh of the truth.
FINER = Mesh(64, 6)
#: Effects whose columns take seconds each, and those that need an experimenter's mistake; left out of the library here.
SKIPPED = frozenset({"pad_conduction", "pad_bending", "pivot_friction"})
KINDS = ("scatter", "one", "two", "one", "outside", "beside")
#: Sizes are drawn between these, in typical ones; at least this many standard deviations of everything else.
SIZES, SEEN = (0.8, 2.5), 10.0
SMOOTH = 0.0005


@dataclass(frozen=True)
class Bench:
    """One bearing with all that does not change from campaign to campaign."""

    problem: Problem
    forward: Forward
    finer: Forward
    seen: dict[str, float]


def bench(name: str) -> Bench:
    """Pose the paper's plan for a bundled bearing, and solve what every campaign asks first."""
    bearing = load_bearing(BEARINGS / f"{name}.toml")
    setup = Setup(bearing, pivot_laws("kirk", bearing), mesh=MESH, accuracy=ACCURACY)
    hz = 2 * math.pi
    sweep = dynamic([5000.0], [hz * f for f in (10, 20, 25, 30, 40, 50)], SPEED, -math.pi / 2, 5)
    loads = dynamic([2500.0, 3750.0, 6250.0, 7500.0, 8750.0], [hz * 25], SPEED, -math.pi / 2, 5)
    layout = Layout((*sweep, *loads), around(5000.0, 10, SPEED), dry(range(1, 6)), 200.0)
    observations = planned_observations(setup, layout)
    forward = Forward(setup, layout, observations.elements)
    problem = pose(observations, forward, DiagnoseSettings(workers=1, skip=SKIPPED))
    base = baseline_fit(problem)
    seen = {}
    for c in problem.pool:
        columns = [_slope(forward, problem.base, c, i) for i in range(len(c.steps))]
        seen[c.label] = visible(problem, base, c, np.column_stack(columns))
    finer = Forward(setup.change(mesh=FINER), layout, observations.elements)
    finer()
    return Bench(problem, forward, finer, seen)


def _slope(forward: Forward, base: FloatArray, c: Candidate, i: int) -> FloatArray:
    """As the search asks for it; the model keeps the answer in its memory."""
    low, high = c.limits
    for share in (0.5, -0.5):
        moved = c.origin.copy()
        moved[i] = min(max(moved[i] + share * c.steps[i], low[i]), high[i])
        if moved[i] != c.origin[i]:
            try:
                return np.asarray((forward((c.effect(moved),)) - base) / (moved[i] - c.origin[i]))
            except NoEquilibriumError:
                continue
    return np.zeros_like(base)


@dataclass(frozen=True)
class Drawn:
    """One campaign: what is hidden, the pool it is diagnosed with, and what was measured."""

    truth: tuple[Effect, ...]
    outside: str
    problem: Problem


def draw(one: Bench, kind: str, rng: np.random.Generator) -> Drawn | None:
    """Draw a campaign; None where the model has no equilibrium."""
    library = [
        c for c in one.problem.pool
        if c.name not in TERMS and len(c.steps) == 1 and SIZES[1] * one.seen[c.label] >= SEEN
    ]  # fmt: skip
    count = {"scatter": 0, "one": 1, "two": 2, "outside": 0, "beside": 1}[kind]
    chosen = [library[i] for i in rng.choice(len(library), count, replace=False)]
    if len({c.name for c in chosen}) < count:
        return None
    truth = tuple(_sized(one, c, rng) for c in chosen)
    outside, hidden, pool, grown = "", truth, one.problem.pool, False
    if kind in {"outside", "beside"}:
        outside = str(rng.choice(["left out", "cross-coupled", "growth with the load"]))
        if outside == "left out":
            gone = library[rng.integers(len(library))]
            if gone.name in {c.name for c in chosen}:
                return None
            hidden, outside = (*truth, _sized(one, gone, rng)), f"left out: {gone.label}"
            pool = tuple(c for c in pool if c.name != gone.name)
        elif outside == "cross-coupled":
            size = float(rng.choice([-1, 1]) * rng.uniform(1e7, 4e7))
            hidden = (*truth, Effect("parallel_stiffness", xx=0.0, xy=size, yx=-size, yy=0.0))
        else:
            grown = True
    try:
        value = _measured(one, hidden, rng, float(rng.uniform(6e-6, 1.4e-5)) if grown else 0.0)
    except NoEquilibriumError:
        return None
    observations = replace(one.problem.observations, value=value)
    return Drawn(truth, outside, replace(one.problem, observations=observations, pool=pool))


def _sized(one: Bench, c: Candidate, rng: np.random.Generator) -> Effect:
    low, high = c.bounds
    sign = float(rng.choice([-1.0, 1.0]))
    size = max(float(rng.uniform(*SIZES)), SEEN / max(one.seen[c.label], 1e-6)) * c.step
    if not low <= c.neutral + sign * size <= high:
        sign = -sign
    return c.effect(min(max(c.neutral + sign * size, 0.8 * low + 0.2 * c.neutral), 0.8 * high + 0.2 * c.neutral)
                    if math.isfinite(low) and math.isfinite(high) else c.neutral + sign * size)  # fmt: skip


def _measured(one: Bench, hidden: Sequence[Effect], rng: np.random.Generator, growth: float) -> FloatArray:
    """Records of a bearing that is off its drawing, with hidden effects."""
    known = one.problem.nuisances
    size = np.clip(rng.standard_normal(len(known)), -2.0, 2.0)
    value = predict(one.finer.fresh(), hidden, known, size)
    if growth:  # the clearance grows in proportion to the load: no effect of the library
        elements = one.problem.observations.elements
        for load in sorted({e.place("load") for e in elements if e.family == "h"}):
            mine = np.array([e.family in {"h", "temperature"} and e.place("load") == load for e in elements])
            more = (*hidden, Effect("thermal_growth", clearance_change=growth * load / 8750.0))
            value = np.where(mine, predict(one.finer.fresh(), more, known, size), value)
        mine = np.array([e.family in {"locus", "load"} for e in elements])
        more = (*hidden, Effect("thermal_growth", clearance_change=growth * 5000.0 / 8750.0))
        value = np.where(mine, predict(one.finer.fresh(), more, known, size), value)
    return value + _noise(one.problem.observations, value, rng)


def _noise(observations: Observations, value: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Noise of identification, and a smooth difference of the models."""
    scale = direct_scale(observations.elements, value)
    smooth = np.zeros(len(value))
    for name in dict.fromkeys(e.observable for e in observations.elements if e.family == "h"):
        mine = np.array([e.observable == name for e in observations.elements])
        a, b = rng.standard_normal(2)
        smooth += np.where(mine, SMOOTH * scale * (a + b * coordinate(observations.elements, "load")), 0.0)
    factor = np.sqrt(np.diag(observations.covariance))
    return np.asarray(smooth + factor * rng.standard_normal(len(value)))


def run(one: Bench, kind: str, seed: int, settings: DiagnoseSettings) -> dict[str, Any] | None:
    """Draw and diagnose one campaign; a flat row with what came out."""
    rng = np.random.default_rng([seed, 20190761])
    drawn = draw(one, kind, rng)
    if drawn is None:
        return None
    began = time.process_time()
    verdict, found = solve(drawn.problem, one.forward, settings)
    named = [
        {"name": e.name, "label": e.label, "parameters": {k: (p.value, p.lo, p.hi) for k, p in e.parameters.items()}}
        for e in verdict.effects
    ]
    return {
        "kind": kind, "seed": seed, "truth": [{"name": e.name, **e.parameters} for e in drawn.truth],
        "outside": drawn.outside, "verdict": verdict.verdict, "named": named,
        "alike": [list(g) for g in verdict.indistinguishable], "behaves_like": [b.words for b in verdict.behaves_like],
        "drift": [f"{d.effect}: {d.words}" for d in verdict.drift], "gap": verdict.gap,
        "remainder": verdict.remainder.sigma, "reasons": list(verdict.reasons),
        "worth": [(c.label, w.unseen, w.beside) for c, w in zip(found.model.candidates, found.worth, strict=True)],
        "seconds": time.process_time() - began,
    }  # fmt: skip


def main() -> None:
    """Draw, diagnose, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bearing", default="rocker")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path, default=Path("mixtures.jsonl"))
    asked = parser.parse_args()
    one = bench(asked.bearing)
    settings = DiagnoseSettings(workers=1, skip=SKIPPED)
    for number in range(asked.count):
        row = run(one, KINDS[number % len(KINDS)], asked.seed + number, settings)
        if row is not None:
            with asked.rows.open("a", encoding="utf-8") as out:
                out.write(json.dumps({"bearing": asked.bearing, **row}, default=float) + "\n")
    print(tables([json.loads(line) for line in asked.rows.read_text(encoding="utf-8").splitlines()]))


if __name__ == "__main__":
    main()
