"""One bearing on an emulator of the model, a campaign that was drawn on it, and what is said of that campaign.

What may be off scatters as stated, noise is what the sample campaigns have, and the model differs smoothly by 0.05 to
0.2 %: two programs that solve the same equations differ by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from model.effects import Effect
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.comparison.problem import Problem
from tpjb_ident.diagnosis.comparison.search import Comparison, compare
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import predict
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.observations.gap import coordinate
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Observations, direct_scale
from tpjb_ident.diagnosis.verdict.decide import Decision, decide
from tpjb_ident.diagnosis.verdict.verdict import Verdict

#: What the emulator does not hold.
SKIPPED = frozenset({"pad_conduction", "pad_bending", "pivot_friction"})
#: Smooth difference of the models, share of a coefficient.
SMOOTH = (0.0005, 0.002)


@dataclass(frozen=True)
class Bench:
    """One bearing with all that does not change from campaign to campaign."""

    problem: Problem  #: its measured values are replaced by those of each campaign
    forward: Forward  #: the emulated model at the points of the plan
    seen: dict[str, float]  #: a typical step of each candidate, in standard deviations of everything else


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


def noise(
    observations: Observations, value: FloatArray, rng: np.random.Generator, shares: Sequence[float] = SMOOTH
) -> FloatArray:
    """Noise of identification, and a smooth difference of the models between two shares of a coefficient."""
    scale = direct_scale(observations.elements, value)
    smooth = np.zeros(len(value))
    size = rng.uniform(*shares)
    for name in dict.fromkeys(e.observable for e in observations.elements if e.family == "h"):
        mine = np.array([e.observable == name for e in observations.elements])
        a, b = rng.standard_normal(2)
        smooth += np.where(mine, size * scale * (a + b * coordinate(observations.elements, "load")), 0.0)
    factor = np.sqrt(np.diag(observations.covariance))
    return np.asarray(smooth + factor * rng.standard_normal(len(value)))


def solve(problem: Problem, forward: Forward, settings: DiagnoseSettings) -> tuple[Decision, Comparison]:
    """Compare and decide in this process, whatever stands behind the model; without a next test."""
    with workers(forward, problem, 1) as run:
        comparison = compare(run, problem)
        return decide(run, problem, comparison, settings.tolerances), comparison


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
