"""Trials: hidden effects of a set size, nothing hidden, the true effect left out of the library, two effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from model.effects import Effect
from tests.studies.diagnosis.bench import Bench, seed
from tests.studies.diagnosis.naive import naive_names
from tpjb_ident.diagnose.diagnose import solve
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.closure import closure, held_out_misfit
from tpjb_ident.diagnose.verdict.verdict import Verdict

Kind = Literal["none", "hidden", "left out", "two"]


@dataclass(frozen=True)
class Trial:
    """One campaign to draw and diagnose.

    Attributes
    ----------
    kind : str
    truth : tuple of str
        Labels of the hidden candidates.
    size : float
        d' of every one of them.
    noise : float
        Factor on the noise of identification.
    number : int
        Makes the draw different from others of its kind.
    """

    kind: Kind
    truth: tuple[str, ...] = ()
    size: float = 0.0
    noise: float = 1.0
    number: int = 0


@dataclass(frozen=True)
class Plan:
    """How many trials.

    Attributes
    ----------
    sizes : tuple of float
    noises : tuple of float
    seeds : int
        Per effect, size and noise.
    none : int
        Campaigns without effects.
    left_out : int
        Per effect, at d' = 12 and 24.
    two : int
        Campaigns with two effects at d' = 12 each.
    raw : int
        Campaigns as raw volts.
    """

    sizes: tuple[float, ...] = (3.0, 6.0, 12.0, 36.0)
    noises: tuple[float, ...] = (1.0, 2.0)
    seeds: int = 1
    none: int = 300
    left_out: int = 2
    two: int = 60
    raw: int = 0


def trials(labels: Sequence[str], plan: Plan) -> Iterator[Trial]:
    """List the trials of a plan; candidates are those of a bench."""
    for number in range(plan.none):
        yield Trial("none", noise=plan.noises[number % len(plan.noises)], number=number)
    for label in labels:
        for size in plan.sizes:
            for noise in plan.noises:
                for number in range(plan.seeds):
                    yield Trial("hidden", (label,), size, noise, number)
        for number in range(plan.left_out):
            yield Trial("left out", (label,), (12.0, 24.0)[number % 2], 1.0, number)
    rng = seed("two")
    for number in range(plan.two):
        pair = rng.choice(len(labels), 2, replace=False)
        yield Trial("two", tuple(labels[i] for i in sorted(pair)), 12.0, 1.0, number)


def run_trial(bench: Bench, trial: Trial) -> dict[str, Any]:
    """Draw a campaign and diagnose it; a flat row with what came out.

    Rows of effects that cannot reach the size within their bounds have the verdict ``"unreachable"``.
    """
    rng = seed(*asdict(trial).values())
    chosen = [next(c for c in bench.pool if c.label == label) for label in trial.truth]
    effects = sized(bench, chosen, trial, rng)
    row: dict[str, Any] = {**asdict(trial), "names": tuple(c.name for c in chosen)}
    if effects is None:
        return {**row, "verdict": "unreachable"}
    problem = bench.problem(effects, rng, trial.noise)
    if trial.kind == "left out":
        problem = replace(problem, pool=tuple(c for c in problem.pool if c.name not in row["names"]))
    settings = DiagnoseSettings()
    verdict, found = solve(problem, bench.surrogate, settings)
    row |= summary(verdict, effects)
    row["p_before"], row["p_after"] = found.before.structure.p, found.after.structure.p
    row["held_p"], row["scale"] = found.after.held_p, found.after.scale
    row["size_all"] = bench.size(effects, bench.factor(trial.noise))
    row["naive"] = naive_names(problem, found, rng)
    measured = closure(problem, found)
    if measured is not None:
        row |= {"closed": measured.closed, "closed_wrong": measured.wrong, "closed_ceiling": measured.ceiling}
        row["placebo_fall"] = _forced_fall(problem, found, measured.before)
    return row


def _forced_fall(problem: Problem, found: Search, before: float) -> float:
    """Fall of the squared misfit per held-out point when the effect of the largest score is simply added."""
    best = found.first_scores[0]
    forced = found.baseline.prediction + best.column * (best.amplitude - best.candidate.neutral)
    return before - held_out_misfit(problem, forced)


def sized(
    bench: Bench, chosen: Sequence[Candidate], trial: Trial, rng: np.random.Generator
) -> tuple[Effect, ...] | None:
    """Effects of the trial's size, each with a random sign where both can be; None where bounds forbid."""
    factor = bench.factor(trial.noise)
    out = []
    for c in chosen:
        signs = [1.0, -1.0] if rng.random() < 0.5 else [-1.0, 1.0]
        found = (bench.sized(c, trial.size, s, factor) for s in signs)
        effect = next((e for e in found if e is not None), None)
        if effect is None:
            return None
        out.append(effect)
    return tuple(out)


def summary(verdict: Verdict, effects: Sequence[Effect]) -> dict[str, Any]:
    """What a verdict says, flat."""
    row: dict[str, Any] = {
        "verdict": verdict.verdict,
        "found": tuple(e.name for e in verdict.effects),
        "labels": tuple(e.label for e in verdict.effects),
        "groups": tuple(tuple(g) for g in verdict.indistinguishable),
        "alternatives": verdict.alternatives,
        "reasons": verdict.reasons,
        **{f"gap_{k}": v for k, v in verdict.gap.items()},
    }
    if len(effects) == 1 and len(verdict.effects) == 1 and verdict.effects[0].name == effects[0].name:
        name, p = next((k, p) for k, p in verdict.effects[0].parameters.items() if p.lo < p.hi)
        row |= {"true_value": effects[0].parameters[name], "value": p.value, "lo": p.lo, "hi": p.hi}
    return row
