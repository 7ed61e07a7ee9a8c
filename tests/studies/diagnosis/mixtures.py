"""Mixtures: bearings within workshop tolerance of their drawings, with hidden effects, through the whole decision.

    python -m tests.studies.diagnosis.mixtures [--bearing NAME] [--count 40] [--seed 0] [--rows FILE]

Campaigns of the paper's plan (bearing `between`: another bearing and another plan, which nothing was developed on) are
drawn from an emulator of the model (`emulated`): everything that may be off is drawn from its stated tolerance (cut off
at two standard deviations), the model differs smoothly by 0.05 to 0.2 % (two programs that solve the same equations
differ by that), noise is what the sample campaigns have. Kinds: ``scatter``
(nothing hidden), ``clean`` (one effect of twelve standard deviations on a bearing as drawn), ``one``, ``two``,
``three`` (effects of the library), ``outside`` (an effect that is taken out of it, a cross-coupled stiffness, or growth
in proportion to the load), ``beside`` (an effect of the library and one outside it). Rows go to a JSON-lines file;
rows that are there are not drawn again; the tables are made from it.
"""

from __future__ import annotations

import argparse
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
from rigdata.arrays import FloatArray
from tests.studies.diagnosis.emulated import emulate
from tests.studies.diagnosis.tables import tables
from tests.studies.results import Rows
from tpjb_ident.diagnosis.comparison.problem import Problem
from tpjb_ident.diagnosis.comparison.search import Comparison, compare
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.diagnose import ACCURACY, pose
from tpjb_ident.diagnosis.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnosis.forward.forward import Forward, ForwardModel, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import predict
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.observations.gap import coordinate, direct_scale
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Layout, Observations
from tpjb_ident.diagnosis.planned import around, dry, dynamic, planned_observations
from tpjb_ident.diagnosis.verdict.decide import Decision, decide
from tpjb_ident.diagnosis.verdict.verdict import Verdict

HERE, BEARINGS = Path(__file__).parent, Path(__file__).parents[3] / "model" / "bearings"
HZ, DOWN = 2 * math.pi, -math.pi / 2
#: What the emulator does not hold.
SKIPPED = frozenset({"pad_conduction", "pad_bending", "pivot_friction"})
#: One campaign after the other; every kind comes early and often.
KINDS = (
    "scatter", "one", "two", "clean", "outside", "scatter", "one", "three", "clean", "beside",
    "scatter", "one", "two", "clean", "outside", "scatter", "one", "two", "clean", "outside",
)  # fmt: skip
HIDDEN = {"scatter": 0, "clean": 1, "one": 1, "two": 2, "three": 3, "outside": 0, "beside": 1}
#: What is hidden beyond the library.
OUTSIDE = ("left out", "cross-coupled", "growth with the load")
#: Sizes are drawn between these, in typical ones; at least this many standard deviations of everything else.
SIZES, SEEN, CLEAN = (0.8, 2.5), 10.0, 12.0
#: Smooth difference of the models, share of a coefficient.
SMOOTH = (0.0005, 0.002)


@dataclass(frozen=True)
class Bench:
    """One bearing with all that does not change from campaign to campaign."""

    problem: Problem  #: its measured values are replaced by those of each campaign
    forward: Forward  #: the emulated model at the points of the plan
    elsewhere: Forward  #: the same at points that no campaign holds
    seen: dict[str, float]  #: a typical step of each candidate, in standard deviations of everything else


def plan_of_the_paper() -> tuple[Layout, Layout]:
    """One speed, one load direction on a pad; and points that no campaign holds."""
    speed = HZ * 22
    sweep = dynamic([5000.0], [HZ * f for f in (10, 20, 25, 30, 40, 50)], speed, DOWN, 5)
    loads = dynamic([2500.0, 3750.0, 6250.0, 7500.0, 8750.0], [HZ * 25], speed, DOWN, 5)
    new = dynamic([4375.0, 10000.0], [HZ * 25, HZ * 60], speed, DOWN, 0)
    return Layout((*sweep, *loads), around(5000.0, 10, speed), dry(range(1, 6)), 200.0), Layout(new)


def plan_between() -> tuple[Layout, Layout]:
    """A plan that the diagnosis was not developed on, for the bearing `between.toml`: two speeds, fewer loads."""
    slow, fast = HZ * 50, HZ * 75
    tests = (
        *dynamic([8000.0], [HZ * f for f in (20, 35, 55, 70)], slow, DOWN, 5),
        *dynamic([4000.0, 12000.0, 16000.0], [HZ * 35], slow, DOWN, 5),
        *dynamic([8000.0, 14000.0], [HZ * 35, HZ * 60], fast, DOWN, 5),
    )
    new = (
        *dynamic([6000.0, 18000.0], [HZ * 35, HZ * 85], slow, DOWN, 0),
        *dynamic([11000.0], [HZ * 45], fast, DOWN, 0),
    )
    return Layout(tests, around(8000.0, 8, slow), dry(range(1, 6)), 300.0), Layout(new)


def bench(name: str, folder: Path | None, skip: frozenset[str] = SKIPPED) -> Bench:
    """Pose a bearing's plan, on an emulator whose table is kept in a folder, or on the model."""
    bearing = load_bearing((HERE if name == "between" else BEARINGS) / f"{name}.toml")
    setup = Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(48, 4), accuracy=ACCURACY)
    layout, new = plan_between() if name == "between" else plan_of_the_paper()
    observations = planned_observations(setup, layout)
    model = Forward(setup, layout, observations.elements)
    model()
    cache = model.cache
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        cache = emulate(model, new, folder / f"{name}.table")
    forward = Forward(setup, layout, observations.elements, cache)
    elsewhere = Forward(setup, new, planned_observations(setup, new).elements, cache)
    problem = pose(observations, forward, DiagnoseSettings(workers=1, skip=skip))
    return Bench(problem, forward, elsewhere, seen_sizes(problem, forward))


def seen_sizes(problem: Problem, forward: Forward) -> dict[str, float]:
    """A typical step of each candidate, in standard deviations of everything else."""
    factor = usual_factor(problem.observations, problem.columns)
    seen = {}
    for c in problem.pool:
        columns = [_slope(forward.fresh(), problem.base, c, i) for i in range(len(c.steps))]
        seen[c.label] = float(np.linalg.norm(np.linalg.solve(factor, np.column_stack(columns) @ c.steps)))
    return seen


def _slope(forward: Forward, base: FloatArray, c: Candidate, i: int) -> FloatArray:
    low, high = c.limits
    for share in (0.05, -0.05):
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
    """One campaign."""

    truth: tuple[Effect, ...]  #: hidden effects that the library holds
    outside: str  #: what is hidden beyond it
    problem: Problem  #: with the pool it is diagnosed with, and what was measured
    shares: tuple[float, ...]  #: squared change in sigma of each effect of `truth` with the others present
    size: FloatArray  #: (m,), what is off, in standard deviations
    hidden: tuple[Effect, ...]
    growth: float  #: of the clearance, in proportion to the load, at the top load [m]


def draw(one: Bench, kind: str, rng: np.random.Generator, beyond: Sequence[str] = OUTSIDE) -> Drawn | None:
    """Draw a campaign; None where the model has no equilibrium."""
    library = [
        c for c in one.problem.pool
        if c.name not in TERMS and len(c.steps) == 1 and SIZES[1] * one.seen[c.label] >= SEEN
    ]  # fmt: skip
    names = sorted({c.name for c in library})
    chosen = [_of(library, str(n), rng) for n in rng.choice(names, HIDDEN[kind], replace=False)]
    truth = tuple(_sized(one, c, rng, kind == "clean") for c in chosen)
    outside, hidden, pool, growth = "", truth, one.problem.pool, 0.0
    if kind in {"outside", "beside"}:
        outside = str(rng.choice(list(beyond)))
        if outside == "left out":
            gone = _of(library, str(rng.choice([n for n in names if n not in {c.name for c in chosen}])), rng)
            hidden, outside = (*truth, _sized(one, gone, rng, False)), f"left out: {gone.label}"
            pool = tuple(c for c in pool if c.name != gone.name)
        elif outside == "cross-coupled":
            size = float(rng.choice([-1, 1]) * rng.uniform(1e7, 4e7))
            hidden = (*truth, Effect("parallel_stiffness", xx=0.0, xy=size, yx=-size, yy=0.0))
        else:
            growth = float(rng.uniform(6e-6, 1.4e-5))
    size = np.clip(rng.standard_normal(len(one.problem.nuisances)), -2.0, 2.0) * (kind != "clean")
    try:
        value = measured(one, hidden, size, growth)
        shares = []
        for e in truth:
            without = measured(one, [h for h in hidden if h is not e], size, growth)
            shares.append(float(np.sum(((value - without) / one.problem.sigma) ** 2)))
    except NoEquilibriumError:
        return None
    noisy = value + noise(one.problem.observations, value, rng)
    observations = replace(one.problem.observations, value=noisy)
    return Drawn(truth, outside, replace(one.problem, observations=observations, pool=pool), tuple(shares), size,
                 tuple(hidden), growth)  # fmt: skip


def _of(library: Sequence[Candidate], name: str, rng: np.random.Generator) -> Candidate:
    mine = [c for c in library if c.name == name]
    return mine[rng.integers(len(mine))]


def _sized(one: Bench, c: Candidate, rng: np.random.Generator, clean: bool) -> Effect:
    """An effect of a size that one would not be surprised by; its direction, where it has one, is anywhere."""
    low, high = c.bounds
    sign = float(rng.choice([-1.0, 1.0]))
    least = SEEN / max(one.seen[c.label], 1e-6)
    size = (CLEAN / one.seen[c.label] if clean else max(float(rng.uniform(*SIZES)), least)) * c.step
    if not low <= c.neutral + sign * size <= high:
        sign = -sign
    amplitude = c.neutral + sign * size
    if math.isfinite(low) and math.isfinite(high):
        amplitude = min(max(amplitude, 0.8 * low + 0.2 * c.neutral), 0.8 * high + 0.2 * c.neutral)
    parameters = c.values(np.array([amplitude]))
    if "direction" in parameters:
        parameters["direction"] = float(rng.uniform(0.0, math.pi))
    return Effect(c.name, **parameters)


def measured(one: Bench, hidden: Sequence[Effect], size: FloatArray, growth: float) -> FloatArray:
    """What a bearing that is off its drawing shows, with hidden effects."""
    known = one.problem.nuisances
    value = predict(one.forward, hidden, known, size)
    if growth:  # the clearance grows in proportion to the load: no effect of the library
        elements, layout = one.problem.observations.elements, one.problem.observations.layout
        top = max(test.load for test in layout.dynamic)
        for load in sorted({e.place("load") for e in elements if e.family == "h"}):
            mine = np.array([e.family in {"h", "temperature"} and e.place("load") == load for e in elements])
            more = (*hidden, Effect("thermal_growth", clearance_change=growth * load / top))
            value = np.where(mine, predict(one.forward, more, known, size), value)
        mine = np.array([e.family in {"locus", "load"} for e in elements])
        if layout.locus:
            more = (*hidden, Effect("thermal_growth", clearance_change=growth * layout.locus[0].load / top))
            value = np.where(mine, predict(one.forward, more, known, size), value)
    return value


def noise(observations: Observations, value: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Noise of identification, and a smooth difference of the models."""
    scale = direct_scale(observations.elements, value)
    smooth = np.zeros(len(value))
    size = rng.uniform(*SMOOTH)
    for name in dict.fromkeys(e.observable for e in observations.elements if e.family == "h"):
        mine = np.array([e.observable == name for e in observations.elements])
        a, b = rng.standard_normal(2)
        smooth += np.where(mine, size * scale * (a + b * coordinate(observations.elements, "load")), 0.0)
    factor = np.sqrt(np.diag(observations.covariance))
    return np.asarray(smooth + factor * rng.standard_normal(len(value)))


def solve(problem: Problem, forward: ForwardModel, settings: DiagnoseSettings) -> tuple[Decision, Comparison]:
    """Compare and decide in this process, whatever stands behind the model; without a next test."""
    with workers(forward, problem, 1) as run:
        comparison = compare(run, problem, settings)
        return decide(run, problem, comparison, settings), comparison


def run(one: Bench, kind: str, seed: int, settings: DiagnoseSettings) -> dict[str, Any] | None:
    """Draw and diagnose one campaign; a flat row with what came out."""
    rng = np.random.default_rng([seed, 20190761])
    drawn = draw(one, kind, rng)
    if drawn is None:
        return None
    began = time.process_time()
    decision, comparison = solve(drawn.problem, one.forward, settings)
    verdict = decision.verdict
    return {
        "kind": kind, "seed": seed, **hidden(drawn), **said(verdict), "gap": verdict.gap,
        "remainder": verdict.remainder.sigma, "p": verdict.remainder.p, "reasons": list(verdict.reasons),
        "fits": [(f.label, f.posterior.total, p) for f, p in zip(comparison.fits[:5], comparison.probabilities)],
        "elsewhere": _elsewhere(one, drawn, [e.effect for e in verdict.effects]),
        "seconds": time.process_time() - began,
    }  # fmt: skip


def hidden(drawn: Drawn) -> dict[str, Any]:
    """What is hidden, for a row."""
    truth = [{"name": e.name, **e.parameters} for e in drawn.truth]
    return {"truth": truth, "shares": drawn.shares, "outside": drawn.outside}


def said(verdict: Verdict) -> dict[str, Any]:
    """What was said of it."""
    named = [
        {"name": e.name, "parameters": {k: (p.value, p.lo, p.hi) for k, p in e.parameters.items()}}
        for e in verdict.effects
    ]
    return {
        "verdict": verdict.verdict, "named": named, "alike": [list(g) for g in verdict.indistinguishable],
        "behaves_like": [b.words for b in verdict.behaves_like],
        "drift": [f"{d.effect}: {d.words}" for d in verdict.drift],
    }  # fmt: skip


def _elsewhere(one: Bench, drawn: Drawn, named: Sequence[Effect]) -> dict[str, float]:
    """Relative rms error of K and of C at loads and frequencies that no campaign holds, before and after."""
    known = tuple(n for n in one.problem.nuisances if n.column is None)
    size = np.array([s for s, n in zip(drawn.size, one.problem.nuisances, strict=True) if n.column is None])
    try:
        true = predict(one.elsewhere, drawn.hidden, known, size)
        told = {"before": one.elsewhere(), "after": one.elsewhere(named)}
    except NoEquilibriumError:
        return {}
    elements = one.elsewhere.elements
    scale = direct_scale(elements, true)
    parts = {p: np.array([e.family == "h" and e.observable[0] == p for e in elements]) for p in "kc"}
    return {f"{p}_{when}": float(np.sqrt(np.mean(((y - true) / scale)[mine] ** 2)))
            for p, mine in parts.items() for when, y in told.items()}  # fmt: skip


def main() -> None:
    """Draw, diagnose, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bearing", choices=("rocker", "spherical", "between"), default="rocker")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path, default=Path("mixtures.jsonl"))
    asked = parser.parse_args()
    stored = Rows(asked.rows, "bearing", "seed")
    one = bench(asked.bearing, asked.rows.parent)
    settings = DiagnoseSettings(workers=1, skip=SKIPPED)
    for number in range(asked.count):
        seed = asked.seed + number
        if (asked.bearing, seed) not in stored.known:
            row = run(one, KINDS[number % len(KINDS)], seed, settings)
            if row is not None:
                stored.add({"bearing": asked.bearing, **row})
    print(tables([*stored.known.values()]))


if __name__ == "__main__":
    main()
