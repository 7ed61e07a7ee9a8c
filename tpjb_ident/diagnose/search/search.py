"""Search: forward selection of effects by nonlinear fits, a backward check, and the rivals of every effect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.workers import Map
from tpjb_ident.diagnose.search.examine import Examination, examine
from tpjb_ident.diagnose.search.fit import Fit, Start, fit, settle
from tpjb_ident.diagnose.search.pairs import best_pairs
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.screen import Score, screen
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

Progress = Callable[[str, float], None]
#: How often another explanation may take the place of one effect of the model.
SWAPS = 2


@dataclass(frozen=True)
class Search:
    """What the search found.

    Attributes
    ----------
    baseline : Fit
        The model with nothing added.
    model : Fit
        The model with the effects that were found; `baseline` if none.
    before, after : Examination
        What `baseline` and `model` leave.
    first_scores : tuple of Score
        Of every candidate, at the baseline.
    singles : tuple of Fit
        Fits of one candidate each, best first.
    rivals : tuple of tuple of Fit
        Per effect of `model`: fits in which another candidate takes its place, best first.
    """

    baseline: Fit
    model: Fit
    before: Examination = field(repr=False)
    after: Examination = field(repr=False)
    first_scores: tuple[Score, ...] = field(repr=False)
    singles: tuple[Fit, ...] = field(repr=False)
    rivals: tuple[tuple[Fit, ...], ...] = field(repr=False)


@dataclass(frozen=True)
class _Hunt:
    """What every step of a search has at hand."""

    run: Map
    problem: Problem
    settings: DiagnoseSettings
    columns: dict[Candidate, FloatArray]

    def screened(self, model: Fit) -> list[Score]:
        """Candidates at a model; those that promise most with new derivatives."""
        others = [c for c in self.problem.pool if c not in model.candidates]
        return screen(self.run, self.problem.misfit, model, others, self.columns, self.settings.tried)

    def extended(self, model: Fit, scores: Sequence[Score]) -> list[Fit]:
        """Fits of a model with one candidate more, best first."""
        starts = [
            ((*model.candidates, s.candidate),
             Start(np.append(model.amplitudes, _careful(s)), np.column_stack([model.jacobian, s.column])))
            for s in scores
        ]  # fmt: skip
        return self.fitted(starts)

    def fitted(self, starts: Sequence[tuple[tuple[Candidate, ...], Start]]) -> list[Fit]:
        """Fits from their starts, best first."""
        found = self.run(fit, [(self.problem.misfit, chosen, start) for chosen, start in starts])
        return sorted((f for f in found if f is not None), key=lambda f: f.chi_square)

    def settled(self, model: Fit) -> Fit:
        """The same fit with derivatives of its own."""
        (one,) = tuple(self.run(settle, [(self.problem.misfit, model)]))
        return one

    def examined(self, model: Fit) -> Examination:
        """What a model leaves."""
        return examine(self.problem, model, self.columns)


def search(run: Map, problem: Problem, settings: DiagnoseSettings, progress: Progress | None = None) -> Search:
    """Look for the effects that close the gap on the training elements."""
    say = progress or (lambda what, share: None)
    empty = problem.empty
    say("every effect of the library", 0.1)
    first = screen(run, problem.misfit, empty, problem.pool)
    hunt = _Hunt(run, problem, settings, {s.candidate: s.column for s in first})
    before = hunt.examined(empty)
    if before.structure.p >= settings.alarm:
        return Search(empty, empty, before, before, tuple(first), (), ())
    model, after, singles = _forward(hunt, empty, before, first, say)
    model = _backward(hunt, model, after.scale)
    say("rivals", 0.9)
    rivals: tuple[tuple[Fit, ...], ...] = ()
    for _ in range(SWAPS + 1):
        rivals = _rivals(hunt, model, singles)
        better = min((r for row in rivals for r in row), key=lambda f: f.chi_square, default=model)
        if better.chi_square >= model.chi_square - 0.5:
            break
        model = hunt.settled(better)
    if model.candidates:
        after = hunt.examined(model)
    return Search(empty, model, before, after, tuple(first), tuple(singles), rivals)


def _forward(
    hunt: _Hunt, empty: Fit, before: Examination, first: Sequence[Score], say: Progress
) -> tuple[Fit, Examination, list[Fit]]:
    """Add effects until what is left has no structure, or nothing helps any more."""
    model, after, scores = empty, before, list(first)
    singles: list[Fit] = []
    for count in range(hunt.settings.most_effects):
        say(f"fits, effect {count + 1}", 0.2 + 0.2 * count)
        fits = hunt.extended(model, _most_promising(scores, hunt.settings))
        if count == 1:
            pairs = best_pairs(hunt.problem.misfit, empty, singles, hunt.columns)
            fits = sorted([*fits, *hunt.fitted(pairs)], key=lambda f: f.chi_square)
        least = after.scale * (hunt.settings.further if count else hunt.settings.detect)
        if not fits or model.chi_square - fits[0].chi_square < least:
            break
        singles = singles or fits
        model = hunt.settled(fits[0])
        after = hunt.examined(model)
        if after.structure.p >= hunt.settings.adequate:
            break
        scores = hunt.screened(model)
    return model, after, singles


def _most_promising(scores: Sequence[Score], settings: DiagnoseSettings) -> list[Score]:
    """Best by score, and the best of every effect that promises a fair share: a first step can mislead."""
    chosen = [s for s in scores[: settings.tried] if s.gain > 0.25 * settings.detect]
    names = {s.candidate.name for s in chosen}
    for s in scores[settings.tried :]:
        if s.gain > 0.1 * scores[0].gain and s.candidate.name not in names:
            chosen.append(s)
            names.add(s.candidate.name)
    return chosen


def _careful(score: Score) -> float:
    """Start no further out than three typical sizes: beyond, the first-order step means little."""
    c = score.candidate
    return c.neutral + float(np.clip(score.amplitude - c.neutral, -3 * c.step, 3 * c.step))


def _without(model: Fit, index: int) -> tuple[tuple[Candidate, ...], Start]:
    return (
        tuple(c for i, c in enumerate(model.candidates) if i != index),
        Start(np.delete(model.amplitudes, index), np.delete(model.jacobian, index, axis=1)),
    )


def _backward(hunt: _Hunt, model: Fit, scale: float) -> Fit:
    """Drop effects whose removal costs next to nothing once the others are there."""
    while len(model.candidates) > 1:
        reduced = hunt.fitted([_without(model, i) for i in range(len(model.candidates))])
        if not reduced or reduced[0].chi_square - model.chi_square >= hunt.settings.further * scale:
            return model
        model = hunt.settled(reduced[0])
    return model


def _rivals(hunt: _Hunt, model: Fit, singles: Sequence[Fit]) -> tuple[tuple[Fit, ...], ...]:
    """For every effect, fits in which another candidate takes its place."""
    if not model.candidates:
        return ()
    if len(model.candidates) == 1:
        return (tuple(f for f in singles if f.candidates != model.candidates),)
    out: list[tuple[Fit, ...]] = []
    for index, gone in enumerate(model.candidates):
        (rest, *_) = [*hunt.fitted([_without(model, index)]), None]
        if rest is None:
            out.append(())
            continue
        lost = rest.chi_square - model.chi_square
        scores = [s for s in hunt.screened(rest) if s.gain > 0.5 * lost and s.candidate != gone]
        out.append(tuple(hunt.extended(rest, scores[:4])))
    return tuple(out)
