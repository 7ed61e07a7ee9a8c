"""Rules: what a comparison says, in their order. Constants and what set them: `Deciding`."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.search import Comparison
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.verdict.behaviour import Drift, drifts
from tpjb_ident.diagnosis.verdict.held_out import HeldOut, held_out_gap
from tpjb_ident.diagnosis.verdict.verdict import VerdictName


@dataclass(frozen=True)
class Judgement:
    """What the rules say of a comparison."""

    name: VerdictName
    held: HeldOut = field(repr=False)  #: the explanation that the verdict is about
    reasons: tuple[str, ...]
    family: tuple[str, ...] = ()
    drift: tuple[Drift, ...] = ()

    @property
    def has_effects(self) -> bool:
        """Whether effects are listed."""
        return self.name in {"named", "ambiguous", "partly-explained"}


def judge(run: Map, comparison: Comparison) -> Judgement:
    """Apply the rules in their order."""
    nothing = comparison.nothing
    held = held_out_gap(run, nothing)
    likely = nothing in comparison.tenable and comparison.probabilities[nothing] >= Deciding.nothing
    if likely:
        return _without_effects(held)
    sure = frozenset(name for name, share in comparison.shares.items() if share >= Deciding.included)
    model = _exactly(comparison, sure) or comparison.best
    held, drift = held_out_gap(run, model), drifts(model)
    return replace(_of_model(comparison, sure, held, drift), drift=drift)


def _of_model(comparison: Comparison, sure: frozenset[str], held: HeldOut, drift: Sequence[Drift]) -> Judgement:
    """What is said of the model that counts: the one with exactly the sure names, or the most probable one."""
    model = held.fit
    if model.needs_more(Deciding.trusted):
        reason = f"the best explanation ({model.label}) leaves {model.leftover}, more than the model is trusted to"
    elif model not in comparison.tenable:
        reason = _untenable(model)
    elif model.names != sure:
        return look_alikes(held, _family(comparison, sure), comparison.shares)
    elif model.faults and all(fault.is_term for fault in model.faults):
        reason = "what describes it is a term that no effect of the library stands for"
    else:
        return _named(held, drift, _places(comparison, model))
    return Judgement("unexplained", held, (reason,))


def _without_effects(held: HeldOut) -> Judgement:
    nothing = held.fit
    if not nothing.needs_more(Deciding.trusted):
        reason = f"no disagreement beyond noise and stated tolerances (p = {nothing.p:.2g})"
        return Judgement("consistent", held, (reason,))
    reason = f"something is the matter ({nothing.leftover}), and no effect of the library explains it"
    return Judgement("unexplained", held, (reason,))


def _exactly(comparison: Comparison, sure: frozenset[str]) -> Fit | None:
    """The most probable tenable fit with exactly these names, unless it is as sure that one of a few stands beside."""
    fit = next((f for f in comparison.fits if sure and f.names == sure and f in comparison.tenable), None)
    is_ambiguous = fit is not None and comparison.probabilities[fit] <= 1.0 - Deciding.included
    return None if is_ambiguous and _family(comparison, sure) else fit


def _family(comparison: Comparison, sure: frozenset[str]) -> tuple[str, ...]:
    """Names of which one or another has the probability that a name takes; none where these are too many."""
    shares = comparison.shares
    names = sorted(shares.keys() - sure, key=lambda name: (-shares[name], name))[: Deciding.family]
    for count in range(2, len(names) + 1):
        if comparison.holding(*names[:count]) >= Deciding.included:
            return tuple(names[:count])
    return ()


def _places(comparison: Comparison, model: Fit) -> tuple[str, ...]:
    """Labels of a model's effects on whichever pad, where which one it is has not the probability that a name takes."""
    places: dict[tuple[str, ...], float] = {}
    for fit, probability in comparison.probabilities.items():
        if fit.names == model.names and fit in comparison.tenable:
            # of a direction every start leads to the same
            labels = tuple(sorted(fault.label if fault.candidate.fixed else fault.name for fault in fit.faults))
            places[labels] = places.get(labels, 0.0) + probability
    likeliest = sorted(places, key=lambda labels: -places[labels])
    if places[likeliest[0]] >= Deciding.included * sum(places.values()):
        return ()
    shared = set(likeliest[0]).intersection(*likeliest)
    listed = dict.fromkeys(itertools.chain(*likeliest))
    return tuple(label for label in listed if label not in shared)[: Deciding.family]


def look_alikes(held: HeldOut, family: tuple[str, ...], shares: Mapping[str, float]) -> Judgement:
    """The most probable model with what a campaign cannot tell from it, which sentences count from the second on."""
    if not family or held.fit.has_terms:
        likeliest = ", ".join(sorted(shares, key=lambda name: -shares[name])[: Deciding.likeliest])
        reason = f"no effect, and no group of three, reaches the probability that a name takes (likeliest: {likeliest})"
        return Judgement("unexplained", held, (reason,))
    listed_first = tuple(sorted(family, key=lambda name: name not in held.fit.names))
    return Judgement("ambiguous", held, (_shrunk(held),), listed_first)


def _named(held: HeldOut, drift: Sequence[Drift], places: tuple[str, ...]) -> Judgement:
    """Named where each effect halves the gap along what it moves, and no effect changes over the operating range."""
    terms, wrong = held.fit.has_terms, held.fit.needs_more(Deciding.right)
    if held.is_shrunk and not (drift or terms or wrong):
        return Judgement("ambiguous" if places else "named", held, (_shrunk(held),), places)
    reason = f"{_shrunk(held)}: a name leaves half of the first above noise at the most, and the second no larger"
    if wrong:
        reason = (
            f"{_shrunk(held)}; left is {held.fit.leftover}: the model may be trusted to that, or it is another cause"
        )
    if drift:
        reason = f"the size of {drift[0].effect} {drift[0].words}, so its name is not the whole story"
    if terms:
        reason = f"{_shrunk(held)}; beside it stands a term that no effect of the library stands for"
    partly = held.earns_all and held.remaining(held.free) <= Deciding.rest
    return Judgement("partly-explained" if partly else "unexplained", held, (reason,))


def _shrunk(held: HeldOut) -> str:
    name = "gap" if held.rows.all() else "held-out gap"
    overall = f"the {name} goes from {held.before:.2f} to {held.as_stated:.2f} sigma with all tolerances as stated"
    if not held.touched:
        return overall
    touched = held.touched[0]
    points = "on points left out of the fit" if touched.unseen else "over all points (those left out do not show it)"
    return (
        f"along what {touched.label} does the gap goes from {touched.before:.2f} to {touched.after:.2f} standard "
        f"deviations of all else that may be off, {points}; over everything {overall}"
    )


def _untenable(model: Fit) -> str:
    if model.on_bound:
        return f"the best explanation ({model.label}) is on a physical bound"
    far = model.tolerances[0]
    needed = f"{far.name} {far.size:+.1f} stated deviations"
    return f"the best explanation ({model.label}) needs {needed} away (p = {model.p:.1g})"
