"""Decide: from fits to a verdict: consistent, named, ambiguous, or unexplained."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tpjb_ident.diagnose.candidates import Candidate
from tpjb_ident.diagnose.fit import Fit, Misfit
from tpjb_ident.diagnose.gap import gap, gap_by_observable, noise_floor
from tpjb_ident.diagnose.localise import localise
from tpjb_ident.diagnose.observe import Observations
from tpjb_ident.diagnose.search import Search
from tpjb_ident.diagnose.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict import FoundEffect, FoundParameter, RankedCandidate, Verdict, VerdictName

BoolArray = NDArray[np.bool_]


def decide(
    observations: Observations, misfit: Misfit, found: Search, held: BoolArray, settings: DiagnoseSettings
) -> Verdict:
    """Turn a search into a verdict.

    Parameters
    ----------
    observations : Observations
    misfit : Misfit
    found : Search
    held : (n,) ndarray of bool
        Elements no fit has seen.
    settings : DiagnoseSettings
    """
    size = int(misfit.train.sum())
    scale = misfit_scale(found.model, size)
    groups = _groups(found, scale, settings)
    name, reasons = _judge(found, misfit, observations, held, groups, settings)
    model = found.model if name in {"named", "ambiguous"} else found.baseline
    shown = found.model if found.model.candidates else found.baseline
    return Verdict(
        verdict=name,
        effects=_effects(found, scale) if model.candidates else (),
        indistinguishable=groups if name == "ambiguous" else (),
        below_floor=_below_floor(found, settings),
        next_test="",
        candidates=_ranked(found, observations, held, size),
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


def misfit_scale(model: Fit, size: int) -> float:
    """How large whitened residuals really are, squared: tolerances are upper bounds, and mostly generous ones."""
    return float(np.clip(model.chi_square / max(size - len(model.candidates), 1), 0.15, 1.0))


def _judge(
    found: Search, misfit: Misfit, observations: Observations, held: BoolArray,
    groups: tuple[tuple[str, ...], ...], settings: DiagnoseSettings,
) -> tuple[VerdictName, tuple[str, ...]]:  # fmt: skip
    size = int(misfit.train.sum())
    model = found.model
    left = math.sqrt(model.chi_square / size)
    if not model.candidates:
        if left <= settings.closed:
            return "consistent", ("no disagreement above noise and tolerance",)
        return "unexplained", (f"whitened residuals of {left:.2f} remain, and no effect of the library reduces them",)
    reasons = []
    before, after = gap(observations, found.baseline.prediction, held), gap(observations, model.prediction, held)
    if left > settings.closed and after > 0.3 * before:
        reasons.append(f"whitened residuals of {left:.2f} remain after the best fit")
    if after > 1.0 and after > 0.5 * before:
        reasons.append(f"held-out points keep a gap of {after:.2f} (before: {before:.2f})")
    if model.at_bound:
        reasons.append("the best fit runs into a physical bound")
    if reasons:
        return "unexplained", tuple(reasons)
    if groups:
        return "ambiguous", tuple(f"{' or '.join(group)}: these data cannot tell" for group in groups)
    return "named", (f"held-out gap {before:.2f} -> {after:.2f}",)


def _groups(found: Search, scale: float, settings: DiagnoseSettings) -> tuple[tuple[str, ...], ...]:
    """Per effect, the names of those that could stand in its place as well."""
    out = []
    for candidate, rivals in zip(found.model.candidates, found.rivals, strict=True):
        names = {candidate.name}
        for rival in rivals:
            other = [c.name for c in rival.candidates if c not in found.model.candidates]
            if (rival.chi_square - found.model.chi_square) / scale < settings.rivals and not rival.at_bound:
                names |= set(other)
        if len(names) > 1:
            out.append((candidate.name, *sorted(names - {candidate.name})))
    return tuple(out)


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
