"""Trials of next tests: campaigns that cannot tell, the test that is suggested, and a diagnosis of both together.

A campaign with a hidden effect is drawn with all tests that could follow. Where its diagnosis is ambiguous the test
that `tpjb diagnose` would suggest is added, and the two are diagnosed as one; as a control, as many tests picked
blindly. Settled means: the truth alone is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.studies.diagnosis.bench import Bench, seed
from tests.studies.diagnosis.next_test_bench import NextBench, restricted, restricted_surrogate
from tests.studies.diagnosis.surrogate import Surrogate
from tests.studies.diagnosis.trials import Trial, sized, summary
from tpjb_ident.diagnose.diagnose import solve
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.next_test.checks import Check
from tpjb_ident.diagnose.next_test.rank import Separation, apart, chance, ranked, suggested, together
from tpjb_ident.diagnose.search.fit import Fit, Misfit
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.decide import close_rivals
from tpjb_ident.diagnose.verdict.verdict import Verdict

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
#: Sizes at which campaigns are drawn.
SIZES = (6.0, 9.0, 12.0)


@dataclass(frozen=True)
class NextTrial(Trial):
    """A trial with a test to follow.

    Attributes
    ----------
    data_set : str
        Which part of the paper's campaign there was, see `data_sets`.
    """

    data_set: str = "D"


def next_trials(labels: Sequence[str], data_set: str, seeds: int) -> Iterator[NextTrial]:
    """List trials: every candidate at every size, `seeds` times."""
    for label in labels:
        for size in SIZES:
            for number in range(seeds):
                yield NextTrial("hidden", (label,), size, 1.0, number, data_set)


def run_next_trial(shared: tuple[NextBench, Bench], trial: NextTrial) -> dict[str, Any]:
    """Draw a campaign; if its diagnosis is ambiguous add tests and diagnose again.

    Parameters
    ----------
    shared : (NextBench, Bench)
        Of one data set, and its own campaign alone.
    trial : NextTrial

    Returns
    -------
    dict
        Flat row of kind ``"next test"``; without ``tests`` where the campaign alone came to another verdict.
    """
    nb, alone = shared
    rng = seed("next", *asdict(trial).values())
    chosen = [next(c for c in alone.pool if c.label == label) for label in trial.truth]
    effects = sized(alone, chosen, trial, rng)
    row: dict[str, Any] = {**asdict(trial), "kind": "next test", "names": tuple(c.name for c in chosen)}
    if effects is None:
        return {**row, "verdict": "unreachable"}
    drawn = nb.whole.problem(effects, rng, trial.noise)
    settings = DiagnoseSettings()
    campaign = restricted(drawn, nb.campaign)
    verdict, found = solve(campaign, alone.surrogate, settings)
    rivals = close_rivals(found, settings) if verdict.verdict == "ambiguous" else ()
    row |= {"verdict": verdict.verdict, "labels": summary(verdict, ())["labels"]}
    if not rivals:
        return row
    now = tuple(_apart(campaign, found.model.prediction - rival.prediction) for rival in rivals)
    tests = ranked_parts(nb, found.model, rivals)
    best = suggested(tests)
    blind = tuple(tests[int(i)] for i in rng.choice(len(tests), size=len(best), replace=False))
    truths = (chosen[0], (found.model, *rivals))
    return {
        **row, "alternatives": verdict.alternatives, "model": found.model.label, "rival": rivals[0].label,
        "apart_now": min(now), **_followed(nb, drawn, (best, now), truths, "then_"),
        **_followed(nb, drawn, (blind, now), truths, "random_"),
    }  # fmt: skip


def ranked_parts(nb: NextBench, one: Fit, rivals: Sequence[Fit]) -> tuple[Separation, ...]:
    """Expected separation of a fit from its rivals by every part; as `next_test.rank_designs`, from tables."""
    out = []
    for part in nb.parts:
        option = part.option
        if isinstance(option, Check):
            each = tuple(option.separation(one.effects, other.effects) for other in rivals)
        elif option.fits(one.effects, *(other.effects for other in rivals)):
            mine, columns = part.surrogate(one.effects), part.nuisances.columns
            each = tuple(apart(part.seen, columns, mine - part.surrogate(other.effects)) for other in rivals)
        else:
            continue
        out.append(Separation(option, each))
    return ranked(out)


def _apart(problem: Problem, difference: FloatArray) -> float:
    return apart(problem.observations, problem.nuisances.columns, difference)


def _followed(
    nb: NextBench,
    drawn: Problem,
    tests: tuple[Sequence[Separation], Sequence[float]],
    truths: tuple[Candidate, Sequence[Fit]],
    prefix: str,
) -> dict[str, Any]:
    """What comes of a campaign with some tests after it, beside what was foretold."""
    (chosen, now), (truth, fits) = tests, truths
    options = [t.design for t in chosen]
    masks = [m for m, part in zip(nb.masks, nb.parts, strict=True) if part.option in options]
    mask = np.logical_or.reduce([nb.campaign, *masks])
    problem, surrogate = restricted(drawn, mask), restricted_surrogate(nb.whole.surrogate, mask)
    verdict, _ = solve(problem, surrogate, DiagnoseSettings())
    said = summary(verdict, ())
    others = {f.candidates[0] for f in fits if len(f.candidates) == 1} - {truth}
    expected = together(chosen, now)
    found = {
        "tests": tuple(option.words for option in options), "verdict": said["verdict"], "labels": said["labels"],
        "alternatives": said["alternatives"], "settled": _settled(verdict, truth), "expected": expected,
        "chance": chance(expected), "achieved": _achieved(problem, surrogate, truth, others),
    }  # fmt: skip
    return {prefix + name: value for name, value in found.items()}


def _settled(verdict: Verdict, truth: Candidate) -> bool:
    return verdict.verdict == "named" and tuple(e.label for e in verdict.effects) == (truth.label,)


def _achieved(problem: Problem, surrogate: Surrogate, truth: Candidate, rivals: set[Candidate]) -> float:
    """Root of the chi-square by which the truth fits better than its nearest rival, negative if it fits worse."""
    everything = np.ones(len(problem.base), dtype=bool)
    misfit = Misfit(problem.observations.value, problem.covariance, everything)
    if not rivals:
        return float("nan")
    gain = min(_least(misfit, surrogate, c) for c in sorted(rivals, key=lambda c: c.label))
    gain -= _least(misfit, surrogate, truth)
    return float(np.sign(gain) * np.sqrt(abs(gain)))


def _least(misfit: Misfit, surrogate: Surrogate, candidate: Candidate) -> float:
    """Smallest chi-square along one effect's table."""
    table = surrogate.tables[surrogate.candidates.index(candidate)]
    best, width = candidate.neutral, float(np.ptp(table.amplitudes))
    for count in (161, 41, 41):
        low, high = max(best - width, table.amplitudes[0]), min(best + width, table.amplitudes[-1])
        tried = np.linspace(low, high, count)
        left = np.column_stack([misfit.value - surrogate.base - table.at(float(a)) for a in tried])
        cost = np.sum(misfit.whiten(left) ** 2, axis=0)
        best, width = float(tried[int(np.argmin(cost))]), 2.0 * float(tried[1] - tried[0])
    return float(cost.min())
