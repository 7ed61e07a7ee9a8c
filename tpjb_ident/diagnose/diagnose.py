"""Diagnose: observe -> screen -> fit -> decide, in one call."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from model.setup import Setup
from tpjb_ident.diagnose.forward.candidates import candidates
from tpjb_ident.diagnose.forward.forward import Forward, ForwardModel
from tpjb_ident.diagnose.forward.memory import Memory
from tpjb_ident.diagnose.forward.nuisance import nuisances
from tpjb_ident.diagnose.forward.workers import workers
from tpjb_ident.diagnose.next_test.rank import options_for, rank_designs, say, suggested
from tpjb_ident.diagnose.observations.observe import Observations
from tpjb_ident.diagnose.search.laws import frequency_laws, sensor_map_test
from tpjb_ident.diagnose.search.problem import Problem, loosened
from tpjb_ident.diagnose.search.search import Progress, Search, search
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.closure import closure
from tpjb_ident.diagnose.verdict.decide import close_rivals, decide
from tpjb_ident.diagnose.verdict.verdict import Verdict

#: Of equilibria while models are compared: far below any tolerance, and a third faster than the default.
ACCURACY = 1e-5


@dataclass(frozen=True)
class Diagnosis:
    """A verdict and everything it rests on (for reports and next tests).

    Attributes
    ----------
    verdict : Verdict
    problem : Problem
    found : Search
    """

    verdict: Verdict
    problem: Problem = field(repr=False)
    found: Search = field(repr=False)

    @property
    def observations(self) -> Observations:
        """What was measured."""
        return self.problem.observations


def diagnose(
    observations: Observations,
    setup: Setup,
    settings: DiagnoseSettings | None = None,
    progress: Progress | None = None,
    memory: Memory | None = None,
) -> Diagnosis:
    """Find the effects that a baseline lacks to describe a campaign.

    Parameters
    ----------
    observations : Observations
        See `observe`.
    setup : Setup
        The baseline model.
    settings : DiagnoseSettings, optional
    progress : callable, optional
        Called with a text and a share done.
    memory : Memory, optional
        Answers known from before; it is not changed.

    Raises
    ------
    NoEquilibriumError
        The baseline itself has no equilibrium at an operating point of the campaign.
    """
    settings = settings or DiagnoseSettings()
    forward = Forward(setup.change(accuracy=ACCURACY), observations.layout, observations.elements)
    if memory is not None:
        forward = forward.knowing(memory)
    problem = pose(observations, forward, settings)
    with workers(forward, settings.workers) as run:
        found = search(run, problem, settings, progress)
    verdict = decide(problem, found, settings)
    verdict = replace(verdict, next_test=_next_test(verdict, found, setup, observations, settings))
    return Diagnosis(_with_evidence(verdict, problem, found), problem, found)


def _with_evidence(verdict: Verdict, problem: Problem, found: Search) -> Verdict:
    """Add what the contract does not ask for: tests of structure, closure beside its controls, laws."""
    sensors, measured = sensor_map_test(problem), closure(problem, found)
    notes: dict[str, Any] = {
        "structure": {
            "p_before": found.before.structure.p, "p_after": found.after.structure.p,
            "left_in": [t.label for t in found.after.structure.tests[:3] if t.p < 0.01],
            "scatter_over_stated": found.after.scale,
        },
        "closure": measured.to_dict() if measured is not None else None,
        "sensor_map": None if sensors is None else {**vars(sensors), "words": sensors.words},
        "frequency_laws": [{**vars(law), "words": law.words} for law in frequency_laws(problem)],
    }  # fmt: skip
    return replace(verdict, notes={**verdict.notes, **notes})


def pose(observations: Observations, forward: Forward, settings: DiagnoseSettings) -> Problem:
    """Set a campaign beside a model: baseline, nuisances, candidates."""
    base = forward()
    trusted = loosened(observations, forward.pad_shares(), settings.tolerance)
    known = nuisances(forward.fresh(), (), base, settings.certificates)
    pool = candidates(forward.setup.bearing, settings.skip)
    return Problem(trusted, base, known, pool, settings.tolerance.shape)


def solve(problem: Problem, forward: ForwardModel, settings: DiagnoseSettings) -> tuple[Verdict, Search]:
    """Search and decide in this process, whatever stands behind the model; without a next test."""
    with workers(forward, 1) as run:
        found = search(run, problem, settings)
    return decide(problem, found, settings), found


def _next_test(
    verdict: Verdict, found: Search, setup: Setup, observations: Observations, settings: DiagnoseSettings
) -> str:
    """What one more test would tell, in words."""
    if verdict.verdict == "consistent":
        return "none needed"
    if verdict.verdict == "unexplained":
        worst = verdict.disagreement[0]
        return f"repeat {worst.observable} at {worst.where}, where the unknown shows most, with another sensor set"
    if verdict.verdict == "named":
        return "none needed to tell these effects from the others in the library"
    rivals = close_rivals(found, settings)
    if not rivals:
        return ""
    options = options_for(setup, observations.layout)
    others = [rival.effects for rival in rivals]
    ranked = rank_designs(setup, found.model.effects, others, options, settings.certificates)
    return say(suggested(ranked), found.model.label, *(r.label for r in rivals)) if ranked else ""
