"""Search: survey the library, select effects, let rivals try for the place of every one that stays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.search.converge import converge
from tpjb_ident.diagnosis.search.effect_gain import EffectGain
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit, fitted
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.proposals import Proposals
from tpjb_ident.diagnosis.search.screen import Columns, survey
from tpjb_ident.diagnosis.search.selection import CLEARLY, Progress, Selection
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings

#: How often another explanation may take the place of one effect of the model.
_SWAPS = 2
#: Variance of the error beyond what is stated, in stated ones, above which a model is wrong: of the mixtures right ones
#: need 0.011 at the most, those that miss a large effect 0.1 to 70.
WRONG = 0.05


@dataclass(frozen=True)
class Search:
    """What the search found."""

    baseline: Fit
    model: Fit
    effects: Fit
    effect_gain: tuple[EffectGain, ...]
    first: Columns = field(repr=False)  #: (n, k): what every candidate does at the baseline, per unit of its amplitudes
    singles: tuple[Fit, ...] = field(repr=False)
    rivals: tuple[tuple[Fit, ...], ...] = field(repr=False)


def search(run: Map, problem: Problem, settings: DiagnoseSettings, progress: Progress | None = None) -> Search:
    """Look for the effects and terms that unseen points want."""
    report = progress or (lambda what, share: None)
    drawn = baseline_fit(problem)
    report("every effect of the library", 0.1)
    first = survey(run, drawn, problem.pool)
    # what is off by two tolerances at once acts no longer to first order: a bearing that is merely off must not need
    # an effect for that
    baseline = converge(run, problem, drawn)
    proposals = Proposals(run, problem, settings, drawn, first.slopes, first.paths)
    selection = Selection(run, problem, settings, proposals, [baseline])
    model, singles, rivals = _selected(selection, report)
    if model.assessment.scales[-1] > WRONG:
        again = _selected(selection, report, afar=True)
        if again[0].evidence > model.evidence + CLEARLY:
            model, singles, rivals = again
    values = tuple(selection.effect_gain_in(model, i) for i in range(len(model.candidates)))
    effects = selection.named(model)
    return Search(selection.baseline, model, effects, values, first.secants, singles, rivals)


def _selected(
    selection: Selection, say: Progress, afar: bool = False
) -> tuple[Fit, tuple[Fit, ...], tuple[tuple[Fit, ...], ...]]:
    """The model that unseen points want, fits of one candidate each, and what may stand in for each of its own."""
    model, singles = selection.forward(say, afar)
    say("rivals", 0.8)
    rivals: tuple[tuple[Fit, ...], ...] = ()
    for _ in range(_SWAPS):
        rivals = selection.rivals(model, singles)
        better = selection.better(model, [r for row in rivals for r in row])
        if better is None:
            break
        model = selection.backward(selection.proposed.refined(better))
    if model.candidates:
        model = selection.kept(converge(selection.run, selection.problem, model))
    if model.candidates:
        return model, singles, rivals
    return selection.baseline, singles, ()


def baseline_fit(problem: Problem) -> Fit:
    """The model with nothing added, nuisances to first order."""
    n, m = problem.columns.shape
    return fitted(problem, InitialFit((), (), np.zeros((n, 0)), np.zeros(m), problem.columns), problem.base)
