"""Decide: from a comparison to a verdict with everything that it rests on."""

import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from model.effects import kind_of
from rigdata.arrays import FloatArray
from tpjb_ident.compare.effect_words import Estimate
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.comparison.search import Comparison
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import contradictions, gap, gap_by_observable, localise, noise_floor
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.verdict.behaviour import behaviours
from tpjb_ident.diagnosis.verdict.held_out import as_stated, free_prediction
from tpjb_ident.diagnosis.verdict.interval import errors_each_way
from tpjb_ident.diagnosis.verdict.rules import Judgement, judge
from tpjb_ident.diagnosis.verdict.verdict import Assumption, FoundEffect, RankedCandidate, Remainder, Verdict
from tpjb_ident.schema import HALF_INTERVAL

#: What a source allows where that is not three typical sizes of the library, whose sources stand with the effects.
_PIVOTS, _SPRINGS = (0.2, 2.0), (1e8, math.inf)
_RANGES = {
    "oil_viscosity": (0.9, 1.1), "pivot_flexibility": _PIVOTS, "soft_pivot": _PIVOTS,
    "housing_flexibility": _SPRINGS, "structure_compliance": _SPRINGS,
}  # fmt: skip


def _stands_in(fault: Fault, value: Estimate) -> str:
    """What to say of a size that lies wholly beyond what its source allows; empty where it does not."""
    parameter, (neutral, width, _, _) = fault.candidate.parameter, fault.candidate.prior[:, 0].tolist()
    ends = sorted(parameter.from_linear(end) for end in (neutral - width, neutral + width))
    low, high = _RANGES.get(fault.name, (max(ends[0], parameter.low), min(ends[1], parameter.high)))
    if value.lo <= high and value.hi >= low:
        return ""
    limit = high if value.value > high else low
    return (
        f"{fault.name} {parameter.name} {value.value:.3g} is beyond {limit:.3g}, as far as its source goes "
        f"({kind_of(fault.name).source}): another cause, or a second one, may stand behind this name"
    )


#: Explanations that are listed.
_MOST_LISTED = 10


@dataclass(frozen=True)
class Decision:
    """A verdict, and what the model predicts with exactly its effects."""

    verdict: Verdict
    model: Fit = field(repr=False)
    after: FloatArray = field(repr=False)  #: (n,)


def decide(run: Map, problem: Problem, comparison: Comparison, tolerances: Tolerances) -> Decision:
    """Turn a comparison into a verdict."""
    observations, judgement = problem.observations, judge(run, comparison)
    held, model = judgement.held, judgement.held.fit
    rows = held.rows
    effects = _effects(run, comparison, judgement) if judgement.has_effects else ()
    after = unseen = problem.base
    if effects and held.exact is not None:
        unseen, exact = held.exact, as_stated(run, model, model.posterior.mean)
        after = unseen if exact is None else exact
    heldout_after = gap(observations, unseen, rows)
    worst = localise(observations, free_prediction(model))
    verdict = Verdict(
        verdict=judgement.name,
        effects=effects,
        indistinguishable=(judgement.family,) if judgement.family else (),
        below_floor=_below_floor(problem, comparison),
        next_test="",
        candidates=_ranked(comparison),
        disagreement=localise(observations, problem.base),
        gap_by_observable=gap_by_observable(observations, problem.base, unseen, problem.held),
        gap={
            "before": gap(observations, problem.base),
            "after": gap(observations, after),
            "heldout_numbers": 0 if rows.all() else int(rows.sum()),
            "heldout_before": held.before,
            "heldout_after": heldout_after,
            "within_tolerances": held.free,
            "closed": 1.0 - held.remaining(heldout_after) if effects else math.nan,
            "noise_floor": noise_floor(observations, rows),
            **(held.along_effects if effects else {}),
        },
        remainder=Remainder(
            held.free, min(held.remaining(held.free), 1.0),
            f"{worst[0].observable} at {worst[0].where}" if worst else "", model.p,
        ),
        behaves_like=() if judgement.name in {"consistent", "named"} else behaviours(model),
        drift=judgement.drift,
        assumptions=_assumptions(problem, model, tolerances),
        reasons=judgement.reasons,
        beforehand=contradictions(observations, problem.base),
    )  # fmt: skip
    return Decision(verdict, model, after)


def _effects(run: Map, comparison: Comparison, judgement: Judgement) -> tuple[FoundEffect, ...]:
    """The effects of the model, the largest change of the prediction first."""
    fit, shares = judgement.held.fit, comparison.shares
    rows, errors = [], errors_each_way(run, fit)
    for index, (fault, at) in enumerate(zip(fit.faults, fit.unknowns.slices, strict=True)):
        if fault.is_term:
            continue
        parameters = parameters_of(fit, index, errors[index])
        change = float(np.linalg.norm(fit.linear.jacobian[:, at] @ fit.linear.theta[at]))
        words = _stands_in(fault, parameters[fault.candidate.parameter.name])
        rows.append((change, FoundEffect(fault.name, parameters, words, round(shares[fault.name], 4))))
    return tuple(effect for _, effect in sorted(rows, key=lambda row: -row[0]))


def parameters_of(fit: Fit, index: int, each_way: FloatArray | None = None) -> dict[str, Estimate]:
    """Parameters of one fault of a fit with their 95 % intervals, by errors below and above (2, k)."""
    fault, amplitudes = fit.faults[index], fit.amplitudes[index]
    errors = fit.errors[index] if each_way is None else each_way
    below, above = HALF_INTERVAL * np.broadcast_to(errors, (2, len(amplitudes)))
    free = fault.candidate.free

    def sizes(at: FloatArray) -> FloatArray:
        values = fault.values(at)
        return np.array([values[parameter.name] for parameter in free])

    value, steps = sizes(amplitudes), zip(np.diag(below), np.diag(above), strict=True)
    with np.errstate(invalid="ignore"):  # what does not give is infinitely stiff
        ends = np.array([[sizes(amplitudes - low), sizes(amplitudes + high)] for low, high in steps]) - value
    below, above = (np.linalg.norm(end, axis=0) for end in (ends.min(axis=1), ends.max(axis=1)))
    rows = zip(free, value.tolist(), (value - below).tolist(), (value + above).tolist(), strict=True)
    out = {parameter.name: Estimate(size, low, high, parameter.unit) for parameter, size, low, high in rows}
    for name, fixed in fault.candidate.fixed.items():
        units = {parameter.name: parameter.unit for parameter in kind_of(fault.name).parameters}
        out[name] = Estimate(fixed, fixed, fixed, units[name].replace("pad", "1"))
    return out


def _below_floor(problem: Problem, comparison: Comparison) -> tuple[str, ...]:
    """Effects that this campaign could not have seen at a typical size."""
    paths = [path for path in comparison.paths if not path.fault.is_term]
    typical = [problem.sigma * (path.neutral_slope @ path.fault.width) / Deciding.width for path in paths]
    factor = usual_factor(problem.observations, problem.columns)
    white = np.linalg.solve(factor, np.reshape(typical, (-1, len(factor))).T)
    hidden = np.linalg.norm(white, axis=0) < Deciding.visible
    names, best = {path.fault.name for path in paths}, comparison.best
    exceeding = {d.name for d in best.tolerances if abs(d.significance) > Deciding.visible}
    listed = {n.effect.split()[0] for n in problem.nuisances if n.label in exceeding and n.effect} | best.names
    visible = {path.fault.name for path, is_hidden in zip(paths, hidden, strict=True) if not is_hidden}
    return tuple(sorted(names - visible - listed))


def _ranked(comparison: Comparison) -> tuple[RankedCandidate, ...]:
    """The most probable explanations with their sizes; score: log evidence beside no fault at all."""
    reference = comparison.nothing.posterior.total
    out = []
    for fit, probability in comparison.probabilities.items():
        if fit.faults:
            parameters = {}
            for i, fault in enumerate(fit.faults):
                parameters[fault.label] = {k: vars(p) for k, p in parameters_of(fit, i).items()}
            score, problem = fit.posterior.total - reference, fit.problem
            held_gap = gap(problem.observations, free_prediction(fit), problem.held)
            out.append(RankedCandidate(fit.label, score, held_gap, parameters, probability))
    return tuple(out[:_MOST_LISTED])


def _assumptions(problem: Problem, fit: Fit, tolerances: Tolerances) -> tuple[Assumption, ...]:
    """Every tolerance that took part, with what the fit made of it, and how far out its farthest number is."""
    farthest = {d.name.split(" ")[0]: d.significance for d in reversed(fit.tolerances)}
    out = []
    for name, rows in itertools.groupby(zip(problem.nuisances, fit.sizes.tolist()), key=lambda row: row[0].name):
        members = list(rows)
        first, values = members[0][0], [size * nuisance.sigma for nuisance, size in members]
        source = tolerances.stated[name].source if name in tolerances.stated else "default"
        value = values if len(values) > 1 else values[0]
        out.append(Assumption(name, first.sigma, value, first.unit, source, farthest.get(name, 0.0)))
    model = tolerances.stated["model"]
    return (*out, Assumption("model", model.value, model.value * fit.posterior.scale, "1", model.source))
