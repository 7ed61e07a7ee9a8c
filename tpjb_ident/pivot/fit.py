"""Dry tests to pivot curves: the whole way, for all pads of a campaign (paper, Sec. 5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigdata.problem import Problem, RigDataError
from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.pivot.assemble import Choice, assemble_curve
from tpjb_ident.pivot.bad_holds import bad_blocks
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.laws.choice import keep_likely, posterior_weights, with_shared_shape
from tpjb_ident.pivot.laws.law_fit import FitData, LawFit, ShapePrior, fit_law
from tpjb_ident.pivot.laws.laws import Bilinear, HertzLine, HertzPoint, Law, Linear, PointInSeries, Power
from tpjb_ident.pivot.laws.spline_law import SplineLaw
from tpjb_ident.pivot.records.dry_record import DryRecord, noise_about_curve, noise_within_holds, read_dry_run
from tpjb_ident.pivot.records.projection import PadDirection
from tpjb_ident.pivot.records.refusals import check_directions, check_pickup, check_placement, structure_of
from tpjb_ident.pivot.records.settings import PivotSettings
from tpjb_ident.slow_records.noise import NoiseModel

if TYPE_CHECKING:
    from rigdata.campaign import Campaign


REFERENCE_SHARE = 0.4  # reference load of the laws, as a share of the largest load
MODEL_ERROR = 3e-4  # of the deflection: what averaging over a curved law leaves; matters in computed records only
UNKNOWN_ZERO = 2.0e-5  # [m], spread of the reading at zero load from run to run of one pad
LAWS: dict[str, Law] = {
    law.name: law for law in (HertzLine(), HertzPoint(), Power(), Linear(), PointInSeries(), Bilinear(), SplineLaw())
}


def fit_pivots(
    campaign: Campaign, pivot_angles: Sequence[float], settings: PivotSettings | None = None
) -> tuple[PivotCurve, ...]:
    """Fit a load-deflection curve to the dry tests of every pad.

    Parameters
    ----------
    campaign : Campaign
        With runs of kind ``dry_pivot``.
    pivot_angles : sequence of float
        Directions of the pads [rad], pad #1 first.
    settings : PivotSettings, optional
        Defaults suit staircase tests.

    Returns
    -------
    tuple of PivotCurve
        One per pad that was tested, in order of pads.

    Raises
    ------
    RigDataError
        When the campaign has no dry tests, or records are not what they claim to be (wrong pad, swapped
        channel, wrong angle); carries every refusal, not just the first. With ``settings.on_refusal =
        "few"`` or ``"skip"`` refused records are left out as long as most, or any, are left, and the curves say so.
    """
    chosen = settings or PivotSettings()
    angles = np.asarray(pivot_angles, dtype=float)
    records, problems = _read(campaign, angles, chosen)
    problems += check_placement(records) + check_pickup(records)
    refused = {problem.run for problem in problems}
    noise = noise_within_holds(records, chosen.drift_rate) if records else NoiseModel(1.0, 1.0, 1.0)
    structure = structure_of(records, noise, chosen)
    pads: dict[int, list[tuple[DryRecord, tuple[PadDirection, PadDirection]]]] = {}
    for record in records:
        try:
            directions = check_directions(record, noise, chosen, angles, structure)
        except RigDataError as error:
            problems += error.problems
            continue
        if record.run.id not in refused:
            pads.setdefault(record.pad, []).append((record, directions))
    reasons = {str(p.run): p.what for p in reversed(problems)}
    many = 2 * len(reasons) >= len(campaign.of_kind("dry_pivot"))
    if problems and (chosen.on_refusal == "raise" or not pads or (chosen.on_refusal == "few" and many)):
        raise RigDataError(problems)
    left_out = tuple(f"{run} ({reasons[run]})" for run in sorted(reasons))
    return _curves(pads, noise, chosen, str(structure or ""), left_out)


def _read(campaign: Campaign, angles: FloatArray, settings: PivotSettings) -> tuple[list[DryRecord], list[Problem]]:
    runs = campaign.of_kind("dry_pivot")
    if not runs:
        raise RigDataError(
            Problem(
                "error", "campaign.toml", "runs", "has no runs of kind dry_pivot", "Record dry pivot tests, one per pad"
            )
        )
    records: list[DryRecord] = []
    problems: list[Problem] = []
    for run in runs:
        try:
            records.append(read_dry_run(run, angles, settings))
        except RigDataError as error:
            problems += error.problems
    return records, problems


def _curves(
    pads: dict[int, list[tuple[DryRecord, tuple[PadDirection, PadDirection]]]],
    first_noise: NoiseModel,
    settings: PivotSettings,
    structure: str,
    refused: tuple[str, ...],
) -> tuple[PivotCurve, ...]:
    """Drop bad holds, learn the noise about the curves, fit every law, weigh the laws over the pads."""
    numbers = sorted(pads)
    members = []
    for number in numbers:
        records = tuple(record for record, _ in pads[number])
        good = tuple(~bad_blocks(record, first_noise, LAWS, _fit_data, settings) for record in records)
        members.append(Choice(records, good, tuple(d for _, d in pads[number]), structure=structure))
    noise = noise_about_curve(
        [r for m in members for r in m.records], [g for m in members for g in m.good], settings.drift_rate
    )
    data = [_fit_data(member.records, member.good, noise, settings) for member in members]
    fits = [_fit_all(one, settings) for one in data]
    fits = with_shared_shape(fits, posterior_weights(fits), [_refit(one) for one in data])
    weights = posterior_weights(fits)
    curves = []
    for member, candidates, shares in zip(members, fits, weights, strict=True):
        likely, kept = keep_likely(candidates, shares)
        curves.append(assemble_curve(replace(member, fits=likely, weights=kept), noise, settings, refused))
    return tuple(curves)


def _fit_all(data: FitData, settings: PivotSettings) -> list[LawFit]:
    return [fit_law(LAWS[name], contact, data) for name in settings.laws for contact in (False, True)]


def _refit(data: FitData) -> Callable[[LawFit, ShapePrior], LawFit]:
    return lambda fit, known: fit_law(fit.law, fit.contact, data, known, start=fit.theta)


def _fit_data(
    records: Sequence[DryRecord], good: Sequence[BoolArray], noise: NoiseModel, settings: PivotSettings
) -> FitData:
    """Join the runs of one pad; each has its own drift and its own zero."""
    load = np.concatenate([r.projection.load[g] for r, g in zip(records, good, strict=True)])
    deflection = np.concatenate([r.projection.deflection[g] for r, g in zip(records, good, strict=True)])
    branch = np.concatenate([r.blocks.branch[g] for r, g in zip(records, good, strict=True)]).astype(float)
    compliance = float(np.ptp(deflection)) / max(float(np.ptp(load)), 1e-300)
    covariance = np.zeros((len(load), len(load)))
    at = 0
    for record, mask in zip(records, good, strict=True):
        blocks = record.blocks.take(mask)
        part = slice(at, at + len(blocks))
        covariance[part, part] = noise.covariance(blocks.time, blocks.duration) + np.diag(
            (compliance * blocks.load_spread) ** 2
            + (settings.lag_allowance * compliance * blocks.rate) ** 2
            + (MODEL_ERROR * float(np.ptp(deflection))) ** 2
        )
        one_level = (blocks.hold[:, None] == blocks.hold[None, :]) & (blocks.hold >= 0) | np.eye(
            len(blocks), dtype=bool
        )
        covariance[part, part] += record.quantisation**2 * one_level
        if len(records) > 1:
            covariance[part, part] += UNKNOWN_ZERO**2
        at += len(blocks)
    both = len(np.unique(branch)) > 1
    friction = (0.0, 0.05) if both else (settings.friction_share, settings.friction_share_se)
    return FitData(
        load=load,
        deflection=deflection - deflection[int(np.argmin(load))],
        branch=branch,
        whitener=np.linalg.inv(np.linalg.cholesky(covariance)),
        reference_load=REFERENCE_SHARE * float(np.max(load)),
        friction=friction,
    )
