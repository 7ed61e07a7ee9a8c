"""Selection: effects are added forward and dropped backward as unseen points want it; rivals of all that stay."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.search.converge import converge
from tpjb_ident.diagnosis.search.effect_gain import EffectGain, effect_gain
from tpjb_ident.diagnosis.search.fit import Fit, InitialFit
from tpjb_ident.diagnosis.search.minimise import fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.proposals import ROUNDS_ON_THE_WAY, Proposals, best_of
from tpjb_ident.diagnosis.search.screen import scores, with_model
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings

Progress = Callable[[str, float], None]
#: Log evidence [nats] below which two fits of the same candidates are one.
CLEARLY = 1.0
#: Candidates of every round that are compared with derivatives of their own.
_FIRST = 3
#: Of these, the ones that may yet be the best: derivatives from elsewhere mistake a fit by up to 25 nats where it rises
#: by as many, and by a third of its rise where that is large (`docs/diagnosis.md`).
_NEAR, _HALF = 30.0, 0.5
#: Effects with a direction that are turned off their grid where a generic term leads.
_TURNED = 2
#: Evidence [nats] that no tolerance makes up once an effect is taken away: 45 at the most in all samples.
_HOPELESS = 100.0
#: Candidates that are fitted in the place of every effect.
_RIVALS = 3


@dataclass(frozen=True)
class Selection:
    """Steps of a search, and what they have at hand."""

    run: Map
    problem: Problem
    settings: DiagnoseSettings
    proposed: Proposals
    _nothing: list[Fit]
    _known: dict[tuple[int, int], tuple[Fit, EffectGain]] = field(default_factory=dict, repr=False)
    _less: dict[tuple[int, int], tuple[Fit, Fit | None]] = field(default_factory=dict, repr=False)
    _places: dict[str, Fit] = field(default_factory=dict, repr=False)

    @property
    def baseline(self) -> Fit:
        """The likeliest model with nothing added that was met so far."""
        return self._nothing[0]

    def _likeliest(self, model: Fit) -> Fit:
        """The likeliest fit of a model's candidates met so far; the model itself if none is much better."""
        best_fit = self._places.get(model.label, model) if model.candidates else self.baseline
        return best_fit if best_fit.evidence > model.evidence + CLEARLY else model

    def forward(self, say: Progress, afar: bool = False) -> tuple[Fit, tuple[Fit, ...]]:
        """Add what unseen points want, one at a time or two at once; drop what they do not want any more."""
        model, table = self.baseline, self.proposed.first
        singles: tuple[Fit, ...] = ()
        count, again = 0, {""}
        while count < self.settings.most_effects:
            say(f"fits, effect {count + 1}", 0.2 + 0.2 * count)
            tried = self.proposed.extended(model, table)
            afresh = self.proposed.afresh(self.proposed.drawn, table) if not count else []
            if not count:
                tried = best_of([*tried, *afresh])
            if count == 1:
                tried = sorted([*tried, *self.proposed.pairs(singles)], key=lambda f: -f.evidence)
            # what may be off acts otherwise beside a large effect, a direction between those of the grid shows not its
            # worth: the likeliest have derivatives and directions of their own
            lead = self._leading(model, tried)
            near = self.run.together([functools.partial(self.proposed.refined, f) for f in lead])
            if afar:
                near += self.proposed.far(near, afresh or self.proposed.afresh(self.proposed.as_drawn(model), table))
            tried = [*near, *(f for f in tried if not any(f is best_fit for best_fit in lead))]
            singles = singles or tuple(best_of(tried))
            chosen = self._chosen(model, tried)
            if chosen is None:
                likelier = self._likeliest(model)
                if not count or likelier is model or model.label in again:
                    break
                # one effect more only showed where the others have their place
                again.add(model.label)
                model = converge(self.run, self.problem, likelier)
                table = self.proposed.renewed(model)
                continue
            chosen = chosen if any(chosen is f for f in near) else self.proposed.refined(chosen)
            model = self.backward(converge(self.run, self.problem, chosen))
            if len(model.candidates) <= count:
                break
            table = self.proposed.renewed(model)
            count = len(model.candidates)
        return model, singles

    def _leading(self, model: Fit, tried: Sequence[Fit]) -> list[Fit]:
        """Those of the first fits that may yet be the best; behind a generic term, effects with a direction too."""
        first = tried[:_FIRST]
        best = first[0].evidence if first else 0.0
        least = best - max(_NEAR, _HALF * (best - model.evidence))
        lead = [f for f in first if f.evidence > least]
        if lead and lead[0].names & set(TERMS):
            # free numbers of a term find any direction, an effect on its grid none between
            turned = [f for f in tried if not f.names & set(TERMS) and any(c.refined() != c for c in f.candidates)]
            lead += [f for f in turned[:_TURNED] if not any(f is best_fit for best_fit in lead)]
        return lead

    def _chosen(self, model: Fit, tried: Sequence[Fit]) -> Fit | None:
        """The best that unseen points want; an effect of the library before a generic term that does no better."""
        best: Fit | None = None
        for f in sorted(tried, key=lambda f: -f.evidence):
            # two effects that are each wanted beside the other may still explain less than the one that is there
            if f.evidence <= self._likeliest(model).evidence:
                break
            if best is not None and f.evidence < best.evidence - self._spared(best, model):
                break
            generic = bool(f.names & set(TERMS))
            if (best is None or not generic) and self._all_wanted(f, model):
                if not generic:
                    return f
                best = f
        return best

    def _spared(self, found: Fit, model: Fit) -> float:
        """Log evidence that an effect of the library may lack beside a fit with generic terms to be taken before it."""
        # three free numbers of a term take up part of what a second effect does
        return max(self.settings.alike, self.settings.spare * (found.evidence - model.evidence))

    def better(self, model: Fit, rivals: Sequence[Fit]) -> Fit | None:
        """The likeliest rival that explains more than a model, or as much with fewer generic terms."""
        terms = sum(c.name in TERMS for c in model.candidates)
        least = model.evidence - self._spared(model, self.baseline)
        for r in sorted(rivals, key=lambda f: -f.evidence):
            fewer = sum(c.name in TERMS for c in r.candidates) < terms
            if r.evidence > (least if fewer else model.evidence + CLEARLY):
                return r
        return None

    def _all_wanted(self, found: Fit, model: Fit) -> bool:
        """Whether unseen points want every candidate that is new in a fit."""
        new = [c for c in found.candidates if c not in model.candidates]
        if len(new) == 1 and set(found.candidates) - set(new) == set(model.candidates):
            if not self._enough(effect_gain(self.problem, found, model, new[0])):
                return False
            return self._enough(self.effect_gain_in(found, found.candidates.index(new[0])))
        return all(self._enough(self.effect_gain_in(found, i)) for i in range(len(found.candidates)))

    def _enough(self, value: EffectGain) -> bool:
        """Whether an effect is worth its place."""
        return value.unseen > self.settings.wanted and value.beside > self.settings.exceeds

    def effect_gain_in(self, model: Fit, index: int) -> EffectGain:
        """What one candidate of a model is worth: the others are fitted again without it."""
        cached = self._known.get((id(model), index))
        if cached is None:
            # the model is kept with the answer: its number must not be given to another one
            cached = self._known[(id(model), index)] = model, self._effect_gain_in(model, index)
        return cached[1]

    def _effect_gain_in(self, model: Fit, index: int) -> EffectGain:
        less = self.without(model, index)
        if less is None:
            return EffectGain(np.inf, np.inf)
        value = effect_gain(self.problem, model, less, model.candidates[index])
        if self._enough(value) and less is not self.baseline and value.beside < _HOPELESS:
            # what may be off does without the effect all that it can, not to first order only, and from where it
            # stands beside the effect too: else an effect is named for what a tolerance does
            less = converge(self.run, self.problem, less, ROUNDS_ON_THE_WAY)
            value = effect_gain(self.problem, model, less, model.candidates[index])
        return value

    def without(self, model: Fit, index: int) -> Fit | None:
        """A model without one of its candidates, the others fitted again."""
        cached = self._less.get((id(model), index))
        if cached is None:
            cached = self._less[(id(model), index)] = model, self._without(model, index)
        return cached[1] if len(model.candidates) > 1 else self.baseline

    def _without(self, model: Fit, index: int) -> Fit | None:
        indices = [i for i in range(len(model.candidates)) if i != index]
        start = InitialFit(
            tuple(model.candidates[i] for i in indices), tuple(model.amplitudes[i] for i in indices),
            np.column_stack([model.jacobian[:, :0], *(model.jacobian[:, model.slices[i]] for i in indices)]),
            model.nuisance, model.columns,
        )  # fmt: skip
        less = next(iter(self.run(fit, [(start,)])))
        if indices and less is not None:
            self._places[less.label] = max(self._places.get(less.label, less), less, key=lambda f: f.evidence)
        if indices or less is None:
            return less if indices else self.baseline
        if model.evidence - max(less.evidence, self.baseline.evidence) > _HOPELESS:
            return self.baseline
        # the way from an effect back to nothing may end at a better place than the way from the drawing
        self._nothing[:] = best_of([self.baseline, converge(self.run, self.problem, less)])[:1]
        return self.baseline

    def kept(self, model: Fit) -> Fit:
        """The model itself, or less of it where its last derivatives take an effect's worth away."""
        model = self.backward(model)
        if len(model.candidates) == 1 and not self._enough(self.effect_gain_in(model, 0)):
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
        return converge(self.run, self.problem, model)

    def backward(self, model: Fit) -> Fit:
        """Drop what unseen points do not want once the others are there."""
        while len(model.candidates) > 1:
            values = [self.effect_gain_in(model, i) for i in range(len(model.candidates))]
            weak = [i for i, v in enumerate(values) if not self._enough(v)]
            if not weak:
                return model
            less = self.without(model, min(weak, key=lambda i: values[i].unseen))
            if less is None:
                return model
            model = converge(self.run, self.problem, less)
        return model

    def rivals(self, model: Fit, singles: Sequence[Fit]) -> tuple[tuple[Fit, ...], ...]:
        """For every candidate of a model, fits in which another one takes its place."""
        if len(model.candidates) == 1:
            return (tuple(f for f in singles if f.label != model.label),)
        out: list[tuple[Fit, ...]] = []
        for index, gone in enumerate(model.candidates):
            reduced = self.without(model, index)
            if reduced is None:
                out.append(())
                continue
            used = {gone.label, *(o.label for o in reduced.candidates)}
            table = {c: v for c, v in self.proposed.first.items() if c.label not in used}
            best = [s for s in scores(self.problem, reduced, table, paths=self.proposed.paths) if s.gain > 0.0][
                :_RIVALS
            ]
            fits = self.proposed.fits([with_model(reduced, s, table, self.proposed.paths) for s in best])
            if gone.name in TERMS:  # an effect that lies off its grid does not do what free numbers do
                fits = self.run.together([functools.partial(self.proposed.refined, f) for f in fits])
            out.append(tuple(fits))
        return tuple(out)
