"""Proposals: fits that a search chooses among; one or two candidates more, from where a model stands or afresh."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import Candidate
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.search.converge import converge
from tpjb_ident.diagnosis.search.effect_gain import STAND_IN
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit, fitted
from tpjb_ident.diagnosis.search.minimise import attempt, fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.screen import (
    AmplitudePaths,
    Columns,
    Score,
    alone,
    columns,
    instead,
    scores,
    with_model,
)
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings

#: How often a model takes derivatives of its own while the search goes on.
ROUNDS_ON_THE_WAY = 2
#: Candidates that are fitted since they explain most by themselves, whatever else may be off.
_ALONE = 3
#: Pairs of candidates that are fitted from the baseline: forward selection can begin with a compromise.
_PAIRS = 2
#: Fits afresh that are settled in a second search.
_FAR = 2


@dataclass(frozen=True)
class Proposals:
    """Makes fits of models with candidates more."""

    run: Map
    problem: Problem
    settings: DiagnoseSettings
    drawn: Fit
    first: Columns = field(repr=False)  #: (n, k): derivatives of every candidate there
    paths: AmplitudePaths = field(repr=False)

    def extended(self, model: Fit, table: Columns) -> list[Fit]:
        """Fits of a model with one candidate more, best first; `table` (n, k) each."""
        free = self._free(model, table)
        ranked = self._promising(scores(self.problem, model, free, paths=self.paths))
        scored = {s.candidates for s in ranked}
        starts = [with_model(model, s, free, self.paths) for s in ranked]
        starts += [s for s in instead(self.problem, model, free, STAND_IN) if s.candidates[-1:] not in scored]
        return self.fits(starts)

    def afresh(self, drawn: Fit, table: Columns) -> list[Fit]:
        """Fits of one candidate more where everything else is as drawn; those too that close most by themselves.

        `table` (n, k) each.
        """
        free = self._free(drawn, table)
        ranking = scores(self.problem, drawn, free, paths=self.paths)
        ranked = self._promising(ranking)
        # a fit of a large effect may end on either side of a hill: it begins at both sizes that were proposed
        first = alone(self.problem, drawn, free, self.paths)[:_ALONE]
        names = {s.candidates for s in first} - {s.candidates for s in ranked}
        ranked = [*ranked, *first, *(s for s in ranking if s.candidates in names)]
        return best_of(self.fits([with_model(drawn, s, free, self.paths) for s in ranked]))

    def _free(self, model: Fit, table: Columns) -> Columns:
        """Derivatives of the candidates that a model has not."""
        return {c: v for c, v in table.items() if c.label not in {o.label for o in model.candidates}}

    def _promising(self, ranked: Sequence[Score]) -> list[Score]:
        """The best, and the best of every other effect that promises a fair share: a first step can mislead."""
        chosen = list(ranked[: self.settings.tried])
        names = {s.candidates[0].name for s in chosen}
        for s in ranked[self.settings.tried :]:
            if s.gain > 0.3 * ranked[0].gain and s.candidates[0].name not in names:
                chosen.append(s)
                names.add(s.candidates[0].name)
        # what it is worth is told by the fit
        return [s for s in chosen if s.gain > 0.0]

    def pairs(self, singles: Sequence[Fit]) -> list[Fit]:
        """Fits of two candidates at once from the baseline: what a compromise between two would hide."""
        table = dict(self.first)
        for f in singles:  # the secant of a fit tells more than the derivative at the baseline
            (c,), (a,) = f.candidates, f.amplitudes
            if len(a) == 1 and abs(a[0] - c.neutral) > 1e-3 * c.step:
                alone = f.prediction - f.columns @ f.nuisance - self.problem.base
                table[c] = alone[:, None] / (a[0] - c.neutral)
        ranked = scores(self.problem, self.drawn, table, pairs=True)[:_PAIRS]
        return self.fits([with_model(self.drawn, s, table) for s in ranked])

    def fits(self, starts: Sequence[InitialFit]) -> list[Fit]:
        """Fits from their starts, best first."""
        results = self.run(fit, [(start,) for start in starts])
        return sorted((f for f in results if f is not None), key=lambda f: -f.evidence)

    def refined(self, model: Fit) -> Fit:
        """The same model with directions off their grid and derivatives of its own."""
        swapped = tuple(c.refined() for c in model.candidates)
        if swapped != model.candidates:
            parts, amplitudes = [], []
            for old, new, a, at in zip(model.candidates, swapped, model.amplitudes, model.slices, strict=True):
                more = len(new.free) - len(old.free) if not new.form else 0
                parts.append(np.column_stack([model.jacobian[:, at], np.zeros((len(model.prediction), more))]))
                amplitudes.append(np.append(a, [new.about.get("direction", 0.0)] * more))
            model = replace(model, candidates=swapped, amplitudes=tuple(amplitudes), jacobian=np.column_stack(parts))
            model = fitted(self.problem, model.start, model.prediction, model.assessment.scales)
        return converge(self.run, self.problem, model, ROUNDS_ON_THE_WAY)

    def renewed(self, model: Fit) -> dict[Candidate, FloatArray]:
        """Derivatives at a model: new ones for the candidates that rank best by those of the baseline."""
        labels = {c.label for c in model.candidates}
        table = {c: v for c, v in self.first.items() if c.label not in labels}
        best = [
            s.candidates[0] for s in scores(self.problem, model, table, paths=self.paths)[: 2 * self.settings.tried]
        ]
        return table | columns(self.run, model, best)

    def as_drawn(self, model: Fit) -> Fit:
        """The effects of a model, everything else as drawn."""
        start = replace(model.start, nuisance=np.zeros_like(model.nuisance))
        (y,) = self.run(attempt, [(start,)])
        return model if y is None else fitted(self.problem, start, y)

    def far(self, near: Sequence[Fit], afresh: Sequence[Fit]) -> list[Fit]:
        """Fits afresh that close most of the gap, settled, where they come to be likelier than what leads."""
        least = max((f.evidence for f in near), default=-np.inf)
        remaining = [self.problem.scaled(self.problem.observations.value - f.prediction) for f in afresh]
        order = np.argsort([float(z @ z) for z in remaining])[:_FAR]
        fits = self.run.together([functools.partial(self.refined, afresh[i]) for i in order])
        return [converge(self.run, self.problem, f) for f in fits if f.evidence > least]


def best_of(fits: Sequence[Fit]) -> list[Fit]:
    """The better fit of every set of candidates, best first."""
    by_label: dict[str, Fit] = {}
    for f in sorted(fits, key=lambda f: -f.evidence):
        by_label.setdefault(f.label, f)
    return list(by_label.values())
