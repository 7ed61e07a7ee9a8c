"""Decide: from a comparison to a verdict with everything that it rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from model.effects import kind_of
from rigdata.arrays import FloatArray
from tpjb_ident.compare.effect_words import Estimate
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.comparison.search import Comparison
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import contradictions, gap, gap_by_observable, localise, noise_floor
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.verdict.behaviour import behaviours
from tpjb_ident.diagnosis.verdict.held_out import Touched, free_gap, free_prediction
from tpjb_ident.diagnosis.verdict.rules import Judgement, judge
from tpjb_ident.diagnosis.verdict.verdict import Assumption, FoundEffect, RankedCandidate, Remainder, Verdict

#: Effect and parameter: what its source allows. What is not here is bounded by three typical sizes of the library,
#: whose sources stand with the effects.
_RANGES = {
    ("oil_viscosity", "factor"): (
        0.9,
        1.1,
        "ISO 3448 holds a grade within 10 %, the next one is 1.5 times as thick or thin",
    ),
    ("pivot_flexibility", "stiffness_factor"): (0.2, 2.0, "pivots are measured 2 to 3 times softer than the formula"),
    ("soft_pivot", "stiffness_factor"): (0.2, 2.0, "pivots are measured 2 to 3 times softer than the formula"),
    ("hot_oil_carryover", "fraction"): (0.0, 0.95, "groove mixing of 0.4 to 0.95 in flooded bearings"),
    ("starvation", "arc_fraction"): (0.0, 0.4, "leading-edge starvation of 10 to 40 % at low flow"),
    ("heat_loss", "share"): (0.0, 0.4, "pads, shaft and drained oil take 5 to 25 % of a film's heat"),
    ("pad_bending", "compliance_factor"): (0.0, 2.5, "1 is as computed"),
    ("housing_flexibility", "stiffness"): (1e8, math.inf, "rig housings have 1e9 to 5e9 N/m"),
    ("structure_compliance", "stiffness"): (1e8, math.inf, "rig structures have 1e9 to 5e9 N/m"),
    ("channel_delay", "delay"): (-5e-4, 5e-4, "demodulators and anti-alias filters take 20 to 500 us"),
    ("fluid_inertia", "added_mass"): (0.0, 60.0, "K-C-M fits of tilting-pad bearings: 0 to 60 kg at 100 mm"),
}


def _stands_in(name: str, parameter: str, value: Estimate, pads: int) -> str:
    """What to say of a size that lies wholly beyond what its source allows; empty where it does not."""
    kind = kind_of(name)
    described = next((p for p in kind.parameters_of(pads) if p.name == parameter), None)
    if value.lo == value.hi:
        return ""
    if (name, parameter) in _RANGES:
        low, high, source = _RANGES[(name, parameter)]
    elif described is None or math.isnan(described.neutral) or math.isnan(described.typical):
        return ""
    else:
        origin, reach = described.to_linear(described.neutral), Deciding.width * described.typical_step
        ends = sorted(described.from_linear(origin + s * reach) for s in (-1.0, 1.0))
        low, high = max(ends[0], described.low), min(ends[1], described.high)
        source = f"three times a typical size; {kind.source}"
    if value.lo <= high and value.hi >= low:
        return ""
    limit = high if value.value > high else low
    return (
        f"{name} {parameter} {value.value:.3g} is beyond {limit:.3g}, as far as its source goes ({source}): "
        "another cause, or a second one, may stand behind this name"
    )


#: Explanations that are listed.
_MOST_LISTED = 10


@dataclass(frozen=True)
class Decision:
    """A verdict, and what the model predicts with exactly its effects."""

    verdict: Verdict
    model: Fit = field(repr=False)
    after: FloatArray = field(repr=False)  #: (n,)


def decide(run: Map, problem: Problem, comparison: Comparison, settings: DiagnoseSettings) -> Decision:
    """Turn a comparison into a verdict."""
    observations, held = problem.observations, problem.held
    judgement = judge(run, comparison, settings)
    effects = _effects(comparison, judgement) if judgement.has_effects else ()
    after = unseen = problem.base
    if effects and judgement.held.stated is not None:
        (exact,) = tuple(run(_exact, [(effects,)]))
        unseen = judgement.held.stated
        after = unseen if exact is None else exact
    model = judgement.held.fit
    worst = localise(observations, free_prediction(model))
    remaining = judgement.held.free
    heldout_after = gap(observations, unseen, held)
    verdict = Verdict(
        verdict=judgement.name,
        effects=effects,
        indistinguishable=(judgement.family,) if judgement.family else (),
        below_floor=_below_floor(problem, comparison, settings),
        next_test="",
        candidates=_ranked(comparison),
        disagreement=localise(observations, problem.base),
        gap_by_observable=gap_by_observable(observations, problem.base, unseen, held),
        gap={
            "before": gap(observations, problem.base),
            "after": gap(observations, after),
            "heldout_numbers": 0 if held.all() else int(held.sum()),
            "heldout_before": judgement.held.before,
            "heldout_after": heldout_after,
            "within_tolerances": remaining,
            "closed": 1.0 - judgement.held.remaining(heldout_after) if effects else math.nan,
            "noise_floor": noise_floor(observations, held),
            **(_touched(judgement.held.touched[0]) if effects and judgement.held.touched else {}),
        },
        remainder=Remainder(
            remaining, min(judgement.held.remaining(remaining), 1.0),
            f"{worst[0].observable} at {worst[0].where}" if worst else "", model.p,
        ),
        behaves_like=() if judgement.name in {"consistent", "named"} else behaviours(model),
        drift=judgement.drift,
        assumptions=_assumptions(problem, model, settings),
        reasons=judgement.reasons,
        beforehand=contradictions(observations, problem.base),
    )  # fmt: skip
    return Decision(verdict, model, after)


def _touched(deciding: Touched) -> dict[str, float]:
    """The gap along what the effect moves that shrinks it least, and whether unseen points tell it."""
    return {
        "touched_before": deciding.before, "touched_after": deciding.after, "touched_unseen": float(deciding.is_unseen),
    }  # fmt: skip


def _exact(forward: Forward, problem: Problem, effects: tuple[FoundEffect, ...]) -> FloatArray | None:
    """Job: the prediction with exactly the effects listed; None where it has no equilibrium."""
    try:
        return forward([effect.effect for effect in effects])
    except NoEquilibriumError:
        return None


def _effects(comparison: Comparison, judgement: Judgement) -> tuple[FoundEffect, ...]:
    """The effects of the model, the largest change of the prediction first."""
    fit, shares = judgement.held.fit, comparison.shares
    pads = sum(n.name == "clearance_scatter" for n in fit.problem.nuisances)
    rows = []
    for index, (fault, at) in enumerate(zip(fit.faults, fit.unknowns.slices, strict=True)):
        if fault.is_term:
            continue
        parameters = parameters_of(fit, index)
        change = float(np.linalg.norm(fit.point.jacobian[:, at] @ fit.point.theta[at]))
        said = (_stands_in(fault.name, key, value, pads) for key, value in parameters.items())
        words = "; ".join(word for word in said if word)
        rows.append((change, FoundEffect(fault.name, parameters, words, round(shares[fault.name], 4))))
    return tuple(effect for _, effect in sorted(rows, key=lambda row: -row[0]))


def parameters_of(fit: Fit, index: int) -> dict[str, Estimate]:
    """Parameters of one fault of a fit with their 95 % intervals."""
    fault, amplitudes, errors = fit.faults[index], fit.amplitudes[index], fit.errors[index]
    if fault.candidate.basis:
        return _term_parameters(fault, amplitudes, errors)
    value, out = fault.values(amplitudes), {}
    for k, parameter in enumerate(fault.candidate.free):
        step = np.zeros(len(amplitudes))
        step[k] = 1.96 * errors[k]
        ends = [fault.values(amplitudes + sign * step)[parameter.name] for sign in (-1.0, 1.0)]
        out[parameter.name] = Estimate(value[parameter.name], min(ends), max(ends), parameter.unit)
    for name, fixed in fault.candidate.fixed.items():
        unit = next((p.unit for p in kind_of(fault.name).parameters if p.name == name), "1")
        out[name] = Estimate(fixed, fixed, fixed, "1" if unit == "pad" else unit)
    return out


def _term_parameters(fault: Fault, amplitudes: FloatArray, errors: FloatArray) -> dict[str, Estimate]:
    value = fault.values(amplitudes)
    spread = 1.96 * np.sqrt((np.asarray(fault.candidate.basis).T ** 2) @ errors**2)
    pairs = zip(fault.candidate.free, map(float, spread), strict=True)
    return {p.name: Estimate(value[p.name], value[p.name] - s, value[p.name] + s, p.unit) for p, s in pairs}


def _below_floor(problem: Problem, comparison: Comparison, settings: DiagnoseSettings) -> tuple[str, ...]:
    """Effects that this campaign could not have seen at a typical size."""
    factor = usual_factor(problem.observations, problem.columns)
    sizes: dict[str, float] = {}
    for path in comparison.paths:
        if not path.fault.is_term:
            typical = problem.sigma * (path.neutral_slope @ path.fault.width) / settings.width
            size = float(np.linalg.norm(np.linalg.solve(factor, typical)))
            sizes[path.fault.name] = max(sizes.get(path.fault.name, 0.0), size)
    beyond = [d.name for d in comparison.best.tolerances if abs(d.significance) > settings.visible]
    far = {n.effect.split()[0] for n in problem.nuisances if f"{n.name} {n.place}".strip() in beyond and n.effect}
    names = comparison.best.names | far
    return tuple(sorted(name for name, size in sizes.items() if size < settings.visible and name not in names))


def _ranked(comparison: Comparison) -> tuple[RankedCandidate, ...]:
    """The most probable explanations with their sizes; score: log evidence beside no fault at all."""
    rest = comparison.nothing.posterior.total
    out = []
    for fit, probability in zip(comparison.fits, comparison.probabilities, strict=True):
        if fit.faults:
            parameters = {
                fault.label: {k: vars(p) for k, p in parameters_of(fit, i).items()}
                for i, fault in enumerate(fit.faults)
            }
            score = fit.posterior.total - rest
            out.append(RankedCandidate(fit.label, score, free_gap(fit), parameters, probability))
    return tuple(out[:_MOST_LISTED])


def _assumptions(problem: Problem, fit: Fit, settings: DiagnoseSettings) -> tuple[Assumption, ...]:
    """Every tolerance that took part, with what the fit made of it, and how far out its farthest number is."""
    farthest: dict[str, float] = {}
    for deviation in fit.tolerances:
        farthest.setdefault(deviation.name.split(" ")[0], deviation.significance)
    fitted: dict[str, list[float]] = {}
    units: dict[str, tuple[float, str]] = {}
    for nuisance, size in zip(problem.nuisances, fit.sizes, strict=True):
        fitted.setdefault(nuisance.name, []).append(float(size * nuisance.sigma))
        units[nuisance.name] = nuisance.sigma, nuisance.unit
    tolerances = settings.tolerances.stated
    out = []
    for name, values in fitted.items():
        sigma, unit = units[name]
        source = tolerances[name].source if name in tolerances else "default"
        value = values if len(values) > 1 else values[0]
        out.append(Assumption(name, sigma, value, unit, source, farthest.get(name, 0.0)))
    stated = settings.tolerance.stiffness
    learnt = stated * fit.posterior.scale
    return (*out, Assumption("model", stated, learnt, "1", tolerances["model"].source))
