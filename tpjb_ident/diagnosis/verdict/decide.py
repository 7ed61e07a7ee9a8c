"""Decide: what is named, what is left, and what the rest behaves like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from model.effects import kind_of
from rigdata.arrays import FloatArray
from tpjb_ident.compare.effect_words import Estimate
from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.diagnosis.observations.gap import gap, gap_by_observable, noise_floor
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem
from tpjb_ident.diagnosis.search.screen import visible
from tpjb_ident.diagnosis.search.search import Search, baseline_fit
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings
from tpjb_ident.diagnosis.verdict.behaviour import Drift, behaviours, drifts
from tpjb_ident.diagnosis.verdict.closure import Closure, closure, effects_unseen, unseen
from tpjb_ident.diagnosis.verdict.plausibility import plausible
from tpjb_ident.diagnosis.verdict.remainder import Excess, excess, localise
from tpjb_ident.diagnosis.verdict.verdict import (
    Assumption,
    FoundEffect,
    RankedCandidate,
    Remainder,
    Verdict,
    VerdictName,
)


@dataclass(frozen=True)
class Evidence:
    """What the evidence says before it is put in words."""

    name: VerdictName
    named: Fit = field(repr=False)
    closed: Closure
    left: Excess
    alike: tuple[tuple[str, ...], ...]
    reasons: tuple[str, ...]


def judge(problem: Problem, result: Search, settings: DiagnoseSettings) -> Evidence:
    """Weigh a search: the dominant causes first, then what they leave."""
    baseline, effects = result.baseline, result.effects
    before = excess(problem, baseline)
    # against the drawing: a baseline at its likeliest has tolerances exceeded in the place of an effect
    closed = closure(problem, baseline_fit(problem), effects)
    if not result.model.candidates:
        if before.p >= settings.alarm:
            text = f"no disagreement beyond noise and stated tolerances (p = {before.p:.2g})"
            return Evidence("consistent", baseline, closed, before, (), (text,))
        text = (
            f"something is the matter (p = {before.p:.1g}, most in {before.where}), and unseen points want no effect "
            "of the library"
        )
        return Evidence("unexplained", baseline, closed, before, (), (text,))
    remaining = excess(problem, effects)
    reasons = _refusals(result, closed, remaining, settings)
    if reasons and before.p >= settings.alarm:
        text = f"no disagreement beyond noise and stated tolerances (p = {before.p:.2g})"
        return Evidence("consistent", baseline, closed, before, (), (text,))
    if reasons:
        return Evidence("unexplained", baseline, closed, before, (), reasons)
    alike = _alike(result, settings)
    share = f"{100 * closed.closed:.0f} % of the squared gap on unseen points is closed"
    if math.isnan(closed.closed):
        share = "unseen points want it though what may be off closes the gap as well, beyond its tolerances"
    if remaining.p < settings.alarm or result.model.candidates != effects.candidates:
        beyond = f"more than noise and stated tolerances (p = {remaining.p:.1g}), most in {remaining.where}"
        text = f"{share}; what is left is {beyond}"
        return Evidence("partly-explained", effects, closed, remaining, alike, (text,))
    text = f"{share}; what is left is within noise and stated tolerances (p = {remaining.p:.2g})"
    return Evidence("ambiguous" if alike else "named", effects, closed, remaining, alike, (text,))


def _refusals(found: Search, closed: Closure, left: Excess, settings: DiagnoseSettings) -> tuple[str, ...]:
    """Why the effects of a search are not named; empty if they are."""
    effects = found.effects
    if not effects.candidates:
        return ("unseen points want a term that no effect of the library stands for",)
    out = []
    if effects.at_bound:
        out.append(f"the best fit ({effects.label}) runs into a physical bound")
    if left.p < settings.alarm and not closed.closed >= settings.most:
        out.append(
            f"the best fit ({effects.label}) closes {100 * closed.closed:.0f} % of the squared gap on unseen points, "
            f"less than the {100 * settings.most:.0f} % that a name takes"
        )
    return tuple(out)


def _alike(result: Search, settings: DiagnoseSettings) -> tuple[tuple[str, ...], ...]:
    """Per effect, the others that could stand in its place as well, its own label first."""
    out = []
    for candidate, row in zip(result.model.candidates, result.rivals, strict=False):
        if candidate.name in TERMS:
            continue
        near = [r for r in row if r.evidence > result.model.evidence - settings.alike and not r.at_bound]
        used = {c.label for c in result.model.candidates}
        others = [c for r in near for c in r.candidates if c.label not in used and c.name not in TERMS]
        names = tuple(dict.fromkeys(c.label if c.name == candidate.name else c.name for c in others))
        if names:
            out.append((candidate.name, *names))
    return tuple(out)


def decide(
    problem: Problem, result: Search, settings: DiagnoseSettings, exact: FloatArray | None = None
) -> Verdict:  # fmt: skip
    """Turn a search into a verdict; `exact` (n,)."""
    observations, held = problem.observations, problem.held
    evidence = judge(problem, result, settings)
    named = evidence.named
    if exact is None:
        exact = result.effects.prediction - result.effects.columns @ result.effects.nuisance
    after = exact if named.candidates else problem.base
    unseen_after = effects_unseen(problem, named, after) if named.candidates else problem.base
    worst = localise(observations, unseen(problem, named))
    return Verdict(
        verdict=evidence.name,
        effects=_effects(problem, result, evidence),
        indistinguishable=evidence.alike if evidence.name in {"ambiguous", "partly-explained"} else (),
        below_floor=_below_floor(problem, result, settings),
        next_test="",
        candidates=_ranked(problem, result),
        disagreement=localise(observations, problem.base),
        gap_by_observable=gap_by_observable(observations, problem.base, unseen_after, held),
        gap={
            "before": gap(observations, problem.base),
            "after": gap(observations, after),
            "heldout_before": gap(observations, problem.base, held),
            "heldout_after": gap(observations, unseen_after, held),
            "within_tolerances": evidence.closed.after if named.candidates else evidence.closed.before,
            "closed": evidence.closed.closed if named.candidates else math.nan,
            "noise_floor": noise_floor(observations),
        },
        remainder=_remainder(
            problem, evidence, worst[0].observable + " at " + worst[0].where if worst else "", settings.alarm
        ),
        behaves_like=behaviours(problem, result, evidence.left.p < settings.alarm),
        drift=_drifts(problem, result, evidence),
        assumptions=_assumptions(problem, result, settings),
        reasons=evidence.reasons,
    )


def _remainder(problem: Problem, evidence: Evidence, where: str, alarm: float) -> Remainder:
    """What is left on unseen points once everything that may be off is at its likeliest."""
    remaining = evidence.closed.after if evidence.named.candidates else evidence.closed.before
    floor, before = noise_floor(problem.observations) ** 2, gap(problem.observations, problem.base) ** 2
    share = max(remaining**2 - floor, 0.0) / (before - floor) if before > floor else 0.0
    return Remainder(
        remaining, min(share, 1.0), evidence.left.where if evidence.left.p < alarm else where, evidence.left.p
    )


def _drifts(problem: Problem, result: Search, evidence: Evidence) -> tuple[Drift, ...]:
    if evidence.name == "consistent":
        return ()
    if evidence.named.candidates:
        return drifts(problem, result.model)
    return drifts(problem, result.singles[0]) if result.singles else ()


def _effects(problem: Problem, result: Search, evidence: Evidence) -> tuple[FoundEffect, ...]:
    if not evidence.named.candidates:
        return ()
    rows = []
    for index, candidate in enumerate(result.model.candidates):
        if candidate.name in TERMS:
            continue
        parameters = parameters_of(result.model, index)
        order = result.effect_gain[index].unseen
        rows.append((order, FoundEffect(candidate.name, parameters, _stands_in(problem, candidate.name, parameters))))
    return tuple(e for _, e in sorted(rows, key=lambda row: -row[0]))


def _stands_in(problem: Problem, name: str, parameters: dict[str, Estimate]) -> str:
    pads = sum(n.name == "clearance_scatter" for n in problem.nuisances)
    words = []
    for key, value in parameters.items():
        limits = plausible(name, key, pads) if value.lo < value.hi else None
        if limits is not None:
            words.append(limits.words(f"{name} {key}", value.value, value.lo, value.hi))
    return "; ".join(w for w in words if w)


def parameters_of(fitted: Fit, index: int) -> dict[str, Estimate]:
    """Parameters of one candidate of a fit with their 95 % intervals."""
    candidate, amplitudes = fitted.candidates[index], fitted.amplitudes[index]
    errors = fitted.errors[fitted.slices[index]]
    value = candidate.values(amplitudes)
    if candidate.basis:
        spread = np.sqrt((np.asarray(candidate.basis).T ** 2) @ errors**2)
        units = {p.name: p.unit for p in candidate.free}
        return {p.name: Estimate(value[p.name], value[p.name] - 1.96 * s, value[p.name] + 1.96 * s, units[p.name])
                for p, s in zip(candidate.free, spread, strict=True)}  # fmt: skip
    out = {}
    for k, parameter in enumerate(candidate.free):
        step = np.zeros(len(amplitudes))
        step[k] = 1.96 * errors[k]
        ends = [candidate.values(amplitudes + s * step)[parameter.name] for s in (-1.0, 1.0)]
        out[parameter.name] = Estimate(value[parameter.name], min(ends), max(ends), parameter.unit)
    for name, fixed in candidate.fixed.items():
        unit = next((p.unit for p in kind_of(candidate.name).parameters if p.name == name), "1")
        out[name] = Estimate(fixed, fixed, fixed, "1" if unit == "pad" else unit)
    return out


def _below_floor(problem: Problem, result: Search, settings: DiagnoseSettings) -> tuple[str, ...]:
    sizes: dict[str, float] = {}
    for candidate, column in result.first.items():
        if candidate.name not in TERMS:
            size = visible(problem, result.model, candidate, column)
            sizes[candidate.name] = max(sizes.get(candidate.name, 0.0), size)
    return tuple(sorted(n for n, d in sizes.items() if d < settings.visible and n not in result.model.names))


def _ranked(problem: Problem, result: Search) -> tuple[RankedCandidate, ...]:
    fits: Sequence[Fit] = (result.model, result.effects, *result.singles, *(r for row in result.rivals for r in row))
    table: dict[str, Fit] = {}
    for f in fits:
        if f.candidates:
            table.setdefault(f.label, f)
    out = []
    for f in sorted(table.values(), key=lambda f: -f.evidence):
        told = {c.label: {k: vars(p) for k, p in parameters_of(f, i).items()} for i, c in enumerate(f.candidates)}
        held = gap(problem.observations, unseen(problem, f), problem.held)
        out.append(RankedCandidate(f.label, f.evidence - result.baseline.evidence, held, told))
    return tuple(out)


def _assumptions(problem: Problem, result: Search, settings: DiagnoseSettings) -> tuple[Assumption, ...]:
    """Every tolerance that took part, with what the fit made of it."""
    count = result.model.jacobian.shape[1]
    free = result.model.assessment.free[count:]
    fitted: dict[str, list[float]] = {}
    units: dict[str, tuple[float, str]] = {}
    for nuisance, size in zip(problem.nuisances, free, strict=True):
        fitted.setdefault(nuisance.name, []).append(float(size * nuisance.sigma))
        units[nuisance.name] = nuisance.sigma, nuisance.unit
    tolerances = settings.tolerances.stated
    out = []
    for name, values in fitted.items():
        sigma, unit = units[name]
        source = tolerances[name].source if name in tolerances else settings.tolerances.cell_gain.source
        out.append(Assumption(name, sigma, values if len(values) > 1 else values[0], unit, source))
    scales = dict(zip((c.name for c in problem.basis.components), result.model.assessment.scales, strict=True))
    if "h" in scales:
        learnt = settings.tolerance.stiffness * math.sqrt(scales["h"] + scales["beyond"])
        out.append(Assumption("model", settings.tolerance.stiffness, learnt, "1", tolerances["model"].source))
    return tuple(out)
