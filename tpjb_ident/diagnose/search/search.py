"""Search: effects are added and dropped as unseen points want it; rivals of every effect that stays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnose.forward.workers import Map
from tpjb_ident.diagnose.search.assessment import assess
from tpjb_ident.diagnose.search.fit import Fit, Start, fit, fitted, settle
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.screen import Columns, Score, columns, scores, with_model, without_twins
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

Progress = Callable[[str, float], None]
#: How often another explanation may take the place of one effect of the model.
SWAPS = 2
#: How often a model takes derivatives of its own while the search goes on.
ROUNDS_ON_THE_WAY = 2
#: First effects that are compared with derivatives of their own.
FIRST = 3
#: Pairs of candidates that are fitted from the baseline: forward selection can begin with a compromise.
PAIRS = 2
#: Candidates that are fitted in the place of every effect of the model.
RIVALS = 3


@dataclass(frozen=True)
class Worth:
    """What an effect is worth in a model.

    Attributes
    ----------
    unseen : float
        Rise of the log score of folds that are left out in turn, nuisances that do the same set aside [nats].
    beside : float
        Rise of the log evidence beside all stated tolerances [nats].
    """

    unseen: float
    beside: float


@dataclass(frozen=True)
class Search:
    """What the search found.

    Attributes
    ----------
    baseline : Fit
        The model with nothing added.
    model : Fit
        The model with all that unseen points want; `baseline` if nothing.
    effects : Fit
        The model without generic terms, fitted again; `model` if it has none.
    worth : tuple of Worth
        Of every candidate of `model`.
    less : tuple of Fit or None
        `effects` without each of its own.
    first : dict of Candidate to (n, k) ndarray
        Derivatives of every candidate at the baseline.
    singles : tuple of Fit
        Fits of one candidate each, best first.
    rivals : tuple of tuple of Fit
        Per candidate of `model`: fits in which another one takes its place, best first.
    """

    baseline: Fit
    model: Fit
    effects: Fit
    worth: tuple[Worth, ...]
    less: tuple[Fit | None, ...] = field(repr=False)
    first: Columns = field(repr=False)
    singles: tuple[Fit, ...] = field(repr=False)
    rivals: tuple[tuple[Fit, ...], ...] = field(repr=False)


def worth(problem: Problem, model: Fit, less: Fit, candidate: Candidate) -> Worth:
    """What a candidate is worth in a model, beside the same model without it."""
    unseen = []
    for one in (model, less):
        told = one.assessment
        if problem.twins(candidate):
            told = assess(problem.basis, without_twins(problem, one, candidate), told.scales)
        unseen.append(float(np.sum(told.scores())))
    return Worth(unseen[0] - unseen[1], model.evidence - less.evidence)


def search(run: Map, problem: Problem, settings: DiagnoseSettings, progress: Progress | None = None) -> Search:
    """Look for the effects and terms that unseen points want.

    Parameters
    ----------
    run : Map
        See `workers`.
    problem : Problem
    settings : DiagnoseSettings
    progress : callable, optional
    """
    say = progress or (lambda what, share: None)
    baseline = baseline_fit(problem)
    say("every effect of the library", 0.1)
    first = columns(run, baseline, problem.pool)
    hunt = _Hunt(run, problem, settings, baseline, first)
    model, singles = hunt.forward(say)
    say("rivals", 0.8)
    rivals: tuple[tuple[Fit, ...], ...] = ()
    for _ in range(SWAPS):
        rivals = hunt.rivals(model, singles)
        better = max((r for row in rivals for r in row), key=lambda f: f.evidence, default=model)
        if better.evidence <= model.evidence + 1.0:
            break
        model = hunt.backward(hunt.refined(better))
    if model.candidates:
        model = hunt.kept(settle(run, problem, model))
    rivals = rivals if model.candidates else ()
    values = tuple(hunt.worth_in(model, i) for i in range(len(model.candidates)))
    effects = hunt.named(model)
    less = tuple(hunt.without(effects, i) for i in range(len(effects.candidates)))
    return Search(baseline, model, effects, values, less, first, singles, rivals)


def baseline_fit(problem: Problem) -> Fit:
    """The model with nothing added, nuisances to first order."""
    n, m = problem.columns.shape
    return fitted(problem, Start((), (), np.zeros((n, 0)), np.zeros(m), problem.columns), problem.base)


@dataclass(frozen=True)
class _Hunt:
    """What every step of a search has at hand."""

    run: Map
    problem: Problem
    settings: DiagnoseSettings
    baseline: Fit
    first: Columns

    def forward(self, say: Progress) -> tuple[Fit, tuple[Fit, ...]]:
        """Add what unseen points want, one at a time or two at once; drop what they do not want any more."""
        model, table = self.baseline, self.first
        singles: tuple[Fit, ...] = ()
        for count in range(self.settings.most_effects):
            say(f"fits, effect {count + 1}", 0.2 + 0.2 * count)
            tried = self.extended(model, table)
            singles = singles or tuple(tried)
            if count == 1:
                tried = sorted([*tried, *self.pairs(singles)], key=lambda f: -f.evidence)
            # what may be off acts otherwise beside a large effect: the likeliest are told with derivatives of their own
            near = FIRST if not count else 1
            tried = [settle(self.run, self.problem, f, ROUNDS_ON_THE_WAY) for f in tried[:near]] + tried[near:]
            chosen = self.chosen(model, tried)
            if chosen is None:
                break
            model = self.backward(self.refined(chosen))
            if len(model.candidates) <= count:
                break
            table = self.renewed(model)
        return model, singles

    def chosen(self, model: Fit, tried: Sequence[Fit]) -> Fit | None:
        """The best that unseen points want; an effect of the library before a generic term that does no better."""
        wanted = [f for f in tried if self.all_wanted(f, model)]
        if not wanted:
            return None
        best = max(wanted, key=lambda f: f.evidence)
        if best.names & set(TERMS):
            near = [f for f in wanted if f.evidence > best.evidence - self.settings.alike]
            named = [f for f in near if not f.names & set(TERMS)]
            best = max(named, key=lambda f: f.evidence, default=best)
        return best

    def all_wanted(self, found: Fit, model: Fit) -> bool:
        """Whether unseen points want every candidate that is new in a fit."""
        new = [c for c in found.candidates if c not in model.candidates]
        if len(new) == 1 and set(found.candidates) - set(new) == set(model.candidates):
            return self.enough(worth(self.problem, found, model, new[0]))
        return all(self.enough(self.worth_in(found, i)) for i in range(len(found.candidates)))

    def enough(self, value: Worth) -> bool:
        """Whether an effect is worth its place."""
        return value.unseen > self.settings.wanted and value.beside > self.settings.exceeds

    def worth_in(self, model: Fit, index: int) -> Worth:
        """What one candidate of a model is worth: the others are fitted again without it."""
        less = self.without(model, index)
        return worth(self.problem, model, less, model.candidates[index]) if less is not None else Worth(np.inf, np.inf)

    def without(self, model: Fit, index: int) -> Fit | None:
        """A model without one of its candidates, the others fitted again."""
        if len(model.candidates) == 1:
            return self.baseline
        keep = [i for i in range(len(model.candidates)) if i != index]
        start = Start(
            tuple(model.candidates[i] for i in keep), tuple(model.amplitudes[i] for i in keep),
            np.column_stack([model.jacobian[:, model.slices[i]] for i in keep]), model.nuisance, model.columns,
        )  # fmt: skip
        return next(iter(self.run(fit, [(start,)])))

    def kept(self, model: Fit) -> Fit:
        """The model itself, or less of it where its last derivatives take an effect's worth away."""
        model = self.backward(model)
        if len(model.candidates) == 1 and not self.enough(self.worth_in(model, 0)):
            return self.baseline
        return model

    def named(self, model: Fit) -> Fit:
        """A model without its generic terms."""
        terms = [i for i, c in enumerate(model.candidates) if c.name in TERMS]
        if not terms:
            return model
        if len(terms) == len(model.candidates):
            return self.baseline
        for i in reversed(terms):
            model = self.without(model, i) or model
        return settle(self.run, self.problem, model)

    def backward(self, model: Fit) -> Fit:
        """Drop what unseen points do not want once the others are there."""
        while len(model.candidates) > 1:
            values = [self.worth_in(model, i) for i in range(len(model.candidates))]
            weak = [i for i, v in enumerate(values) if not self.enough(v)]
            if not weak:
                return model
            less = self.without(model, min(weak, key=lambda i: values[i].unseen))
            if less is None:
                return model
            model = settle(self.run, self.problem, less)
        return model

    def extended(self, model: Fit, table: Columns) -> list[Fit]:
        """Fits of a model with one candidate more, best first."""
        free = {c: v for c, v in table.items() if c.label not in {o.label for o in model.candidates}}
        ranked = self.promising(scores(self.problem, model, free))
        return self.fits([with_model(model, s, free) for s in ranked])

    def promising(self, ranked: Sequence[Score]) -> list[Score]:
        """The best, and the best of every other effect that promises a fair share: a first step can mislead."""
        chosen = list(ranked[: self.settings.tried])
        names = {s.candidates[0].name for s in chosen}
        for s in ranked[self.settings.tried :]:
            if s.gain > 0.3 * ranked[0].gain and s.candidates[0].name not in names:
                chosen.append(s)
                names.add(s.candidates[0].name)
        return [s for s in chosen if s.gain > self.settings.exceeds]

    def pairs(self, singles: Sequence[Fit]) -> list[Fit]:
        """Fits of two candidates at once from the baseline: what a compromise between two would hide."""
        table = dict(self.first)
        for f in singles:  # the secant of a fit tells more than the derivative at the baseline
            (c,), (a,) = f.candidates, f.amplitudes
            if len(a) == 1 and abs(a[0] - c.neutral) > 1e-3 * c.step:
                table[c] = (f.prediction - self.problem.base)[:, None] / (a[0] - c.neutral)
        ranked = scores(self.problem, self.baseline, table, pairs=True)[:PAIRS]
        return self.fits([with_model(self.baseline, s, table) for s in ranked])

    def fits(self, starts: Sequence[Start]) -> list[Fit]:
        """Fits from their starts, best first."""
        found = self.run(fit, [(start,) for start in starts])
        return sorted((f for f in found if f is not None), key=lambda f: -f.evidence)

    def refined(self, model: Fit) -> Fit:
        """The same model with directions off their grid and derivatives of its own."""
        swapped = tuple(c.refined() for c in model.candidates)
        if swapped != model.candidates:
            parts, amplitudes = [], []
            for old, new, a, at in zip(model.candidates, swapped, model.amplitudes, model.slices, strict=True):
                more = len(new.free) - len(old.free) if not new.form else 0
                parts.append(np.column_stack([model.jacobian[:, at], np.zeros((len(model.prediction), more))]))
                amplitudes.append(np.append(a, [new.about["direction"]] * more))
            model = replace(model, candidates=swapped, amplitudes=tuple(amplitudes), jacobian=np.column_stack(parts))
            start = Start(model.candidates, model.amplitudes, model.jacobian, model.nuisance, model.columns)
            model = fitted(self.problem, start, model.prediction, model.assessment.scales)
        return settle(self.run, self.problem, model, ROUNDS_ON_THE_WAY)

    def renewed(self, model: Fit) -> dict[Candidate, FloatArray]:
        """Derivatives at a model: new ones for the candidates that rank best by those of the baseline."""
        labels = {c.label for c in model.candidates}
        table = {c: v for c, v in self.first.items() if c.label not in labels}
        best = [s.candidates[0] for s in scores(self.problem, model, table)[: 2 * self.settings.tried]]
        return table | columns(self.run, model, best)

    def rivals(self, model: Fit, singles: Sequence[Fit]) -> tuple[tuple[Fit, ...], ...]:
        """For every candidate of a model, fits in which another one takes its place."""
        if len(model.candidates) == 1:
            return (tuple(f for f in singles if f.label != model.label),)
        out: list[tuple[Fit, ...]] = []
        for index, gone in enumerate(model.candidates):
            rest = self.without(model, index)
            if rest is None:
                out.append(())
                continue
            used = {gone.label, *(o.label for o in rest.candidates)}
            table = {c: v for c, v in self.first.items() if c.label not in used}
            best = [s for s in scores(self.problem, rest, table) if s.gain > 0.0][:RIVALS]
            out.append(tuple(self.fits([with_model(rest, s, table) for s in best])))
        return tuple(out)
