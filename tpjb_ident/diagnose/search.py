"""Search: forward selection of effects by nonlinear fits, a backward check, and the rivals of every effect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.diagnose.candidates import Candidate
from tpjb_ident.diagnose.fit import Fit, Misfit, fit
from tpjb_ident.diagnose.screen import Score, screen
from tpjb_ident.diagnose.settings import DiagnoseSettings
from tpjb_ident.diagnose.workers import Map

FloatArray = NDArray[np.float64]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Search:
    """What the search found.

    Attributes
    ----------
    baseline : Fit
        The model with nothing added.
    model : Fit
        The model with the effects that were found; `baseline` if none.
    first_scores : tuple of Score
        Of every candidate, at the baseline.
    last_scores : tuple of Score
        Of every candidate, at `model`.
    singles : tuple of Fit
        Fits of one candidate each, best first.
    rivals : tuple of tuple of Fit
        Per effect of `model`: fits in which another candidate takes its place, best first.
    """

    baseline: Fit
    model: Fit
    first_scores: tuple[Score, ...] = field(repr=False)
    last_scores: tuple[Score, ...] = field(repr=False)
    singles: tuple[Fit, ...] = field(repr=False)
    rivals: tuple[tuple[Fit, ...], ...] = field(repr=False)


def search(
    run: Map, misfit: Misfit, baseline: FloatArray, pool: Sequence[Candidate], settings: DiagnoseSettings,
    progress: Progress | None = None,
) -> Search:  # fmt: skip
    """Look for the effects that close the gap on the training elements."""
    say = progress or (lambda what, share: None)
    empty = Fit((), np.zeros(0), baseline, np.zeros((len(baseline), 0)), misfit.chi_square(baseline), np.zeros((0, 0)))
    say("every effect of the library", 0.1)
    first = screen(run, misfit, empty, pool)
    model, scores = empty, first
    rounds: list[tuple[Fit, ...]] = []
    for count in range(settings.most_effects):
        least = max(settings.detect, settings.further * model.chi_square if rounds else 0.0)
        if scores[0].gain < 0.8 * least:
            break
        say(f"fits, effect {count + 1}", 0.2 + 0.2 * count)
        fits = _fits(run, misfit, model, _most_promising(scores, settings), settings)
        if not fits or model.chi_square - fits[0].chi_square < least:
            break
        rounds.append(fits)
        model = fits[0]
        scores = screen(run, misfit, model, [c for c in pool if c not in model.candidates])
    model = _backward(run, misfit, model, settings)
    singles = rounds[0] if rounds else ()
    say("rivals", 0.9)
    rivals = _rivals(run, misfit, model, singles, pool, settings)
    return Search(empty, model, tuple(first), tuple(scores), singles, rivals)


def _most_promising(scores: Sequence[Score], settings: DiagnoseSettings) -> list[Score]:
    """Best by score, and the best of every effect that promises a fair share: a first step can mislead."""
    chosen = [s for s in scores[: settings.tried] if s.gain > 0.25 * settings.detect]
    names = {s.candidate.name for s in chosen}
    for s in scores[settings.tried :]:
        if s.gain > 0.1 * scores[0].gain and s.candidate.name not in names:
            chosen.append(s)
            names.add(s.candidate.name)
    return chosen


def _fits(run: Map, misfit: Misfit, model: Fit, scores: Sequence[Score], settings: DiagnoseSettings) -> tuple[Fit, ...]:
    jobs = [(misfit, (*model.candidates, s.candidate), np.append(model.amplitudes, _careful(s))) for s in scores]
    found = [f for f in run(fit, jobs) if f is not None]
    return tuple(sorted(found, key=lambda f: f.chi_square))


def _careful(score: Score) -> float:
    """Start no further out than three typical sizes: beyond, the first-order step means little."""
    c = score.candidate
    return c.neutral + float(np.clip(score.amplitude - c.neutral, -3 * c.step, 3 * c.step))


def _without(model: Fit, index: int) -> tuple[tuple[Candidate, ...], FloatArray]:
    return (
        tuple(c for i, c in enumerate(model.candidates) if i != index),
        np.delete(model.amplitudes, index),
    )


def _backward(run: Map, misfit: Misfit, model: Fit, settings: DiagnoseSettings) -> Fit:
    """Drop effects whose removal costs next to nothing once the others are there."""
    while len(model.candidates) > 1:
        jobs = [(misfit, *_without(model, i)) for i in range(len(model.candidates))]
        reduced = [f for f in run(fit, jobs) if f is not None]
        if not reduced:
            return model
        best = min(reduced, key=lambda f: f.chi_square)
        if best.chi_square - model.chi_square >= settings.detect:
            return model
        model = best
    return model


def _rivals(
    run: Map, misfit: Misfit, model: Fit, singles: tuple[Fit, ...], pool: Sequence[Candidate],
    settings: DiagnoseSettings,
) -> tuple[tuple[Fit, ...], ...]:  # fmt: skip
    """For every effect, fits in which another candidate takes its place."""
    if not model.candidates:
        return ()
    if len(model.candidates) == 1:
        return (tuple(f for f in singles if f.candidates != model.candidates),)
    out: list[tuple[Fit, ...]] = []
    for index, gone in enumerate(model.candidates):
        chosen, start = _without(model, index)
        (rest,) = tuple(run(fit, [(misfit, chosen, start)]))
        if rest is None:
            out.append(())
            continue
        others = [c for c in pool if c not in model.candidates]
        scores = [s for s in screen(run, misfit, rest, others) if s.gain > 0.5 * (rest.chi_square - model.chi_square)]
        out.append(tuple(f for f in _fits(run, misfit, rest, scores[:4], settings) if gone not in f.candidates))
    return tuple(out)
