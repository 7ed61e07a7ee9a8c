"""Case: one campaign with a hidden effect, told entry by entry on points that no fit has seen.

Beside the baseline and the effect that was named stand the best wrong effect, a Gaussian process that closes what can
be closed, and a placebo: a campaign that hides nothing, with the effect of the largest score added all the same.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.studies.diagnosis.bench import Bench, seed
from tests.studies.diagnosis.trials import Trial, sized, summary
from tpjb_ident.diagnose.diagnose import solve
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.closure import gaussian_process

FloatArray = NDArray[np.float64]
#: What is hidden, and how large: the paper's own case, pivots softer than the formula says.
CASE = Trial("hidden", ("pivot_flexibility",), 24.0)


def run_case(bench: Bench, trial: Trial = CASE) -> dict[str, Any]:
    """Draw and diagnose the case; a row of kind ``"case"``, without gaps where no such effect can be."""
    rng = seed("case", *asdict(trial).values())
    chosen = [next(c for c in bench.pool if c.label == label) for label in trial.truth]
    effects = sized(bench, chosen, trial, rng)
    row: dict[str, Any] = {**asdict(trial), "kind": "case", "names": tuple(c.name for c in chosen)}
    if effects is None:
        return {**row, "verdict": "unreachable"}
    problem = bench.problem(effects, rng, trial.noise)
    verdict, found = solve(problem, bench.surrogate, DiagnoseSettings())
    row |= summary(verdict, effects)
    wrong = next((f for f in found.singles if not f.names & {c.name for c in chosen}), None)
    shown = {"baseline": problem.base, "named": found.model.prediction, "gaussian process": gaussian_process(problem)}
    if wrong is not None:
        shown["wrong effect"] = wrong.prediction
        row["wrong_name"] = wrong.label
    gaps = {name: _gaps(problem, prediction) for name, prediction in shown.items()}
    gaps |= _placebo(bench, rng, trial)
    row["gaps"] = {name: {by: gaps[by][name] for by in gaps} for name in gaps["baseline"]}
    row["residuals"] = _residuals(problem, found)
    return row


def _placebo(bench: Bench, rng: np.random.Generator, trial: Trial) -> dict[str, dict[str, float]]:
    problem = bench.problem((), rng, trial.noise)
    _, found = solve(problem, bench.surrogate, DiagnoseSettings())
    best = found.first_scores[0]
    forced = problem.base + best.column * (best.amplitude - best.candidate.neutral)
    return {"placebo before": _gaps(problem, problem.base), "placebo after": _gaps(problem, forced)}


def _gaps(problem: Problem, prediction: FloatArray) -> dict[str, float]:
    """Root mean square per observable of held-out residuals, calibration errors learnt from the training points."""
    held, train = problem.held, ~problem.held
    total = problem.covariance
    cross = np.linalg.solve(total[np.ix_(train, train)], total[np.ix_(train, held)])
    rest = problem.observations.value - prediction
    spread = total[np.ix_(held, held)] - cross.T @ total[np.ix_(train, held)]
    z = (rest[held] - cross.T @ rest[train]) / np.sqrt(np.diag(spread))
    names = np.array([e.observable for e in problem.observations.elements])[held]
    return {str(name): float(np.sqrt(np.mean(z[names == name] ** 2))) for name in dict.fromkeys(names)}


def _settled(problem: Problem, prediction: FloatArray) -> FloatArray:
    """Residuals less the calibration errors that fit them best, in standard deviations of single points, (n,)."""
    seen, columns = problem.observations, problem.nuisances.columns
    rest = seen.value - prediction
    errors = columns.T @ np.linalg.solve(problem.covariance, rest)  # one standard deviation each
    return np.asarray((rest - columns @ errors) / np.sqrt(np.diag(seen.covariance) + seen.fine**2))


def _residuals(problem: Problem, found: Search) -> tuple[tuple[str, str, float, float, float], ...]:
    """Model, entry, load [N], frequency [Hz] and residual of every coefficient, before and after."""
    out = []
    for model, prediction in (("before", problem.base), ("after", found.model.prediction)):
        for e, value in zip(problem.observations.elements, _settled(problem, prediction), strict=True):
            if e.family == "h":
                hertz = round(e.place("excitation") / (2.0 * np.pi), 6)
                out.append((model, e.observable, e.place("load"), hertz, float(value)))
    return tuple(out)
