"""Decide: from fits to a verdict: consistent, named, ambiguous, or unexplained."""

from __future__ import annotations

import math

import numpy as np

from tpjb_ident.arrays import BoolArray
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.observations.gap import gap, gap_by_observable, noise_floor
from tpjb_ident.diagnose.observations.observe import Observations
from tpjb_ident.diagnose.search.fit import Fit
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.search import Search
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.localise import localise
from tpjb_ident.diagnose.verdict.verdict import FoundEffect, FoundParameter, RankedCandidate, Verdict, VerdictName


def decide(problem: Problem, found: Search, settings: DiagnoseSettings) -> Verdict:
    """Turn a search into a verdict.

    Parameters
    ----------
    problem : Problem
    found : Search
    settings : DiagnoseSettings
    """
    observations, held = problem.observations, problem.held
    scale = found.after.scale
    groups, spelt = _groups(found, scale, settings), _alternatives(found, scale, settings)
    name, reasons = _judge(problem, found, spelt, settings)
    model = found.model if name in {"named", "ambiguous"} else found.baseline
    shown = found.model if found.model.candidates else found.baseline
    return Verdict(
        verdict=name,
        effects=_effects(found, scale) if model.candidates else (),
        indistinguishable=groups if name == "ambiguous" else (),
        alternatives=spelt if name == "ambiguous" else (),
        below_floor=_below_floor(found, settings),
        next_test="",
        candidates=_ranked(found, observations, held, int(problem.misfit.train.sum())),
        disagreement=localise(observations, found.baseline.prediction),
        gap_by_observable=gap_by_observable(observations, found.baseline.prediction, shown.prediction, held),
        gap={
            "before": gap(observations, found.baseline.prediction),
            "after": gap(observations, shown.prediction),
            "heldout_before": gap(observations, found.baseline.prediction, held),
            "heldout_after": gap(observations, shown.prediction, held),
            "noise_floor": noise_floor(observations),
        },
        reasons=reasons,
    )


def _judge(
    problem: Problem, found: Search, alike: tuple[tuple[str, ...], ...], settings: DiagnoseSettings
) -> tuple[VerdictName, tuple[str, ...]]:
    model, before, after = found.model, found.before, found.after
    if not model.candidates:
        if before.structure.p >= settings.alarm:
            return "consistent", (f"no disagreement above noise and tolerance (p = {before.structure.p:.2g})",)
        where = before.structure.words
        return "unexplained", (
            f"something is the matter (p = {before.structure.p:.1g}, most in {where}), and no effect of the library "
            "reduces it enough",
        )
    reasons = _refusals(problem, found, settings)
    if reasons:
        return "unexplained", reasons
    gaps = [gap(problem.observations, f.prediction, problem.held) for f in (found.baseline, model)]
    text = f"held-out gap {gaps[0]:.2f} -> {gaps[1]:.2f}; what is left has no structure (p = {after.structure.p:.2g})"
    if after.structure.p < settings.adequate:
        text = (
            f"held-out gap {gaps[0]:.2f} -> {gaps[1]:.2f}; what is left is small but structured, most in "
            f"{after.structure.words}"
        )
    if alike:
        return "ambiguous", (*(f"{' or '.join(group)}: these data cannot tell" for group in alike), text)
    return "named", (text,)


def _alike(found: Search, rival: Fit, scale: float, settings: DiagnoseSettings) -> bool:
    return (rival.chi_square - found.model.chi_square) / scale < settings.rivals and not rival.at_bound


def _refusals(problem: Problem, found: Search, settings: DiagnoseSettings) -> tuple[str, ...]:
    """Why the best model is not believed; empty if it is."""
    model, after = found.model, found.after
    reasons = []
    if model.at_bound:
        reasons.append(f"the best fit ({model.label}) runs into a physical bound")
    if len(model.candidates) > 1 and _cancelling(problem, model) > settings.cancelling:
        reasons.append(f"the effects of the best fit ({model.label}) mostly cancel each other")
    left = share_left(problem, found)
    if after.structure.p < settings.adequate and left > settings.closed:
        reasons.append(
            f"the best fit ({model.label}) leaves {100 * left:.0f} % of the squared gap, and that has structure "
            f"(p = {after.structure.p:.1g}), most in {after.structure.words}"
        )
    if after.held_p < settings.held and left > settings.closed:
        reasons.append(f"points that the best fit ({model.label}) has not seen contradict it (p = {after.held_p:.1g})")
    return tuple(reasons)


def _cancelling(problem: Problem, model: Fit) -> float:
    """Whitened size of the largest effect over that of all together."""
    moved = model.amplitudes - np.array([c.neutral for c in model.candidates])
    alone = np.linalg.norm(problem.misfit.whiten(model.jacobian * moved), axis=0)
    together = np.linalg.norm(problem.misfit.whiten(model.prediction - problem.base))
    return float(alone.max() / together)


def share_left(problem: Problem, found: Search) -> float:
    """Share of the baseline's squared gap that the model leaves, noise deducted from both."""
    floor = noise_floor(problem.observations) ** 2
    before, after = (gap(problem.observations, f.prediction) ** 2 for f in (found.baseline, found.model))
    return max(after - floor, 0.0) / max(before - floor, 1e-12) if before > floor else 1.0


def _others(found: Search, index: int, scale: float, settings: DiagnoseSettings) -> tuple[Candidate, ...]:
    """Candidates that could stand in the place of one effect of the model as well, best first."""
    ordered = sorted(found.rivals[index], key=lambda f: f.chi_square)
    alike = (r for r in ordered if _alike(found, r, scale, settings))
    return tuple(dict.fromkeys(c for r in alike for c in r.candidates if c not in found.model.candidates))


def _groups(found: Search, scale: float, settings: DiagnoseSettings) -> tuple[tuple[str, ...], ...]:
    """Per effect that has rivals, the names of all of them, its own first.

    Another pad or direction of the same effect is a rival too; it is spelt out, since its name is the effect's own.
    """
    out = []
    for i, candidate in enumerate(found.model.candidates):
        others = _others(found, i, scale, settings)
        if others:
            rest = {c.label if c.name == candidate.name else c.name for c in others}
            out.append((candidate.name, *sorted(rest)))
    return tuple(out)


def _alternatives(found: Search, scale: float, settings: DiagnoseSettings) -> tuple[tuple[str, ...], ...]:
    """`_groups` with every pad and direction spelt out, likeliest first."""
    rows = [
        (candidate, _others(found, i, scale, settings)) for i, candidate in enumerate(found.model.candidates)
    ]  # fmt: skip
    return tuple((one.label, *(c.label for c in others)) for one, others in rows if others)


def close_rivals(found: Search, settings: DiagnoseSettings) -> tuple[Fit, ...]:
    """Return the explanations that the data cannot tell from the model, the closest first.

    Parameters
    ----------
    found : Search
    settings : DiagnoseSettings
    """
    alike = [r for row in found.rivals for r in row if _alike(found, r, found.after.scale, settings)]
    return tuple(sorted(alike, key=lambda f: f.chi_square))


def _effects(found: Search, scale: float) -> tuple[FoundEffect, ...]:
    model = found.model
    out = []
    for i, candidate in enumerate(model.candidates):
        rivals = found.rivals[i] if i < len(found.rivals) else ()
        odds = [math.exp(-0.5 * min((r.chi_square - model.chi_square) / scale, 700.0)) for r in rivals]
        parameters = {
            k: FoundParameter(v, v, v, "rad" if k == "direction" else "1") for k, v in candidate.fixed.items()
        }
        parameters[candidate.parameter.name] = _parameter(candidate, model, i, scale)
        out.append((_importance(model, i), FoundEffect(candidate.name, 1.0 / (1.0 + sum(odds)), parameters)))
    return tuple(e for _, e in sorted(out, key=lambda pair: -pair[0]))


def _importance(model: Fit, i: int) -> float:
    moved = model.amplitudes[i] - model.candidates[i].neutral
    return abs(moved) / math.sqrt(model.covariance[i, i])


def _parameter(candidate: Candidate, model: Fit, i: int, scale: float) -> FoundParameter:
    """Value and 95 % interval, transformed from the nearly linear form."""
    parameter = candidate.parameter
    value, se = float(model.amplitudes[i]), math.sqrt(float(model.covariance[i, i]) * scale)
    low, high = candidate.bounds
    ends = [parameter.from_linear(min(max(value + s * 1.96 * se, low), high)) for s in (-1, 1)]
    return FoundParameter(parameter.from_linear(value), min(ends), max(ends), parameter.unit)


def _below_floor(found: Search, settings: DiagnoseSettings) -> tuple[str, ...]:
    seen: dict[str, float] = {}
    for score in found.first_scores:
        seen[score.candidate.name] = max(seen.get(score.candidate.name, 0.0), score.detectable)
    named = {c.name for c in found.model.candidates}
    return tuple(sorted(n for n, d in seen.items() if d < settings.visible and n not in named))


def _ranked(found: Search, observations: Observations, held: BoolArray, size: int) -> tuple[RankedCandidate, ...]:
    fits = {f.label: f for f in (found.model, *found.singles, *(r for rivals in found.rivals for r in rivals))}
    fits.pop("baseline", None)
    ordered = sorted(fits.values(), key=lambda f: f.chi_square)
    return tuple(RankedCandidate(f.label, -f.chi_square / size, gap(observations, f.prediction, held)) for f in ordered)
