"""Dry tests to pivot curves: the whole way, for all pads of a campaign (paper, Sec. 5)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from rigdata.arrays import BoolArray, FloatArray
from rigdata.problem import Problem, RigDataError
from tpjb_ident.conditions import Condition
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.curve import Hysteresis, PivotCurve, PivotSteps, measure_loop
from tpjb_ident.pivot.dry_record import DryRecord, PadDirection, noise_about_curve, noise_within_holds, read_dry_run
from tpjb_ident.pivot.fit_data import bad_blocks
from tpjb_ident.pivot.law_fit import (
    FRICTION,
    OFFSET,
    FitData,
    LawFit,
    ShapePrior,
    fit_law,
    keep_likely,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import Bilinear, HertzLine, HertzPoint, Law, Linear, PointInSeries, Power, SplineLaw
from tpjb_ident.pivot.refusals import check_directions, check_pickup, check_placement, structure_of
from tpjb_ident.slow_records.noise import NoiseModel

if TYPE_CHECKING:
    from rigdata.calibration import Channel
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


MISFIT_PROBABILITY = 1e-4
CLEAR_CHOICE = 0.5  # posterior share below which the law counts as undecided
MANY_LOST = 0.05


@dataclass(frozen=True)
class Choice:
    """What was fitted to one pad."""

    records: tuple[DryRecord, ...]
    good: tuple[BoolArray, ...]
    directions: tuple[tuple[PadDirection, PadDirection], ...]
    fits: tuple[LawFit, ...] = ()
    weights: FloatArray = field(default_factory=lambda: np.empty(0))
    structure: str = ""


def assemble_curve(choice: Choice, noise: NoiseModel, settings: PivotSettings, refused: tuple[str, ...]) -> PivotCurve:
    """Make the curve of one pad."""
    choice = replace(choice, fits=tuple(_widened(fit) for fit in choice.fits))
    law = choice.fits[0]
    first = choice.records[0]
    steps = _all_steps(choice, noise)
    onset = contact_onset(law, settings.contact_tolerance)
    loads = np.concatenate([r.projection.load[g] for r, g in zip(choice.records, choice.good, strict=True)])
    return PivotCurve(
        pad=first.pad,
        angle=first.angle,
        steps=steps,
        fits=choice.fits,
        weights=choice.weights,
        onset_load=onset,
        onset_load_se=contact_onset_se(law, settings.contact_tolerance),
        valid_from=max(onset, float(loads.min())),
        valid_to=float(loads.max()),
        load_direction=choice.directions[0][0],
        displacement_direction=choice.directions[0][1],
        hysteresis=_loop(steps, law),
        relative_calibration=_calibration(first.run.channels, first.angle),
        status=_status(choice, steps, settings, onset, refused),
        runs=tuple(record.run.id for record in choice.records),
    )


def _misfits(fit: LawFit) -> bool:
    """Whether the points scatter about the law more than their noise allows."""
    return fit.freedom > 0 and bool(special.chdtrc(fit.freedom, fit.chi_square) < MISFIT_PROBABILITY)


def _widened(fit: LawFit) -> LawFit:
    """The fit with its covariance scaled up where it misfits (Birge's ratio): an interval must not ignore it."""
    return replace(fit, covariance=fit.covariance * fit.chi_square / fit.freedom) if _misfits(fit) else fit


def _all_steps(choice: Choice, noise: NoiseModel) -> PivotSteps:
    """Points of every run of the pad, on one common zero."""
    law = choice.fits[0]
    parts = []
    zero_load = min(float(r.projection.load[g].min()) for r, g in zip(choice.records, choice.good, strict=True))
    reference = next(
        float(r.projection.deflection[g][int(np.argmin(r.projection.load[g]))])
        for r, g in zip(choice.records, choice.good, strict=True)
        if float(r.projection.load[g].min()) == zero_load
    )
    for record, good in zip(choice.records, choice.good, strict=True):
        parts.append(_steps(record, good, law, noise, reference))
    joined = [np.concatenate([getattr(p, name) for p in parts]) for name in PivotSteps.__dataclass_fields__]
    return PivotSteps(*joined)


def _steps(record: DryRecord, good: BoolArray, law: LawFit, noise: NoiseModel, reference: float) -> PivotSteps:
    blocks, projection = record.blocks, record.projection
    groups = blocks.hold if record.holds else np.arange(len(blocks))
    names = np.unique(groups[groups >= 0])
    columns: list[FloatArray] = []
    for name in names:
        mine = groups == name
        share = blocks.duration[mine] / blocks.duration[mine].sum()
        load = float(share @ projection.load[mine])
        branch = int(blocks.branch[mine][0])
        columns.append(
            np.array(
                [
                    load * (1.0 - law.theta[FRICTION] * branch),
                    float(share @ projection.deflection[mine]) - reference - law.theta[OFFSET],
                    math.sqrt(noise.mean_variance(float(blocks.duration[mine].sum()))),
                    float(share @ projection.across_load[mine]),
                    float(share @ projection.across[mine]) - float(projection.across[0]),
                    branch,
                    float(good[mine].all()),
                ]
            )
        )
    table = np.array(columns)
    load, deflection, se, across_load, across, branch, weight = table.T
    return PivotSteps(load, deflection, se, across_load, across, branch.astype(int), weight)


def _loop(steps: PivotSteps, law: LawFit) -> Hysteresis | None:
    """Loop over the loads as applied: taking off the friction would close it.

    The deflections are those of the fit at the steps: it knows drift from friction by what goes on within the holds,
    while the area between the points themselves takes every drift from the way up to the way down for a loss.
    """
    used = steps.weight > 0
    applied = (steps.load / (1.0 - law.theta[FRICTION] * steps.branch))[used]
    reading, gradient = law.reading_gradient(applied, steps.branch[used].astype(float))
    return measure_loop(applied, reading, gradient @ law.covariance @ gradient.T, steps.branch[used])


def _calibration(channels: Mapping[str, Channel], angle: float) -> float:
    """Relative standard uncertainty of the stiffness from the certificates of probes and cells."""
    total = 0.0
    for quantity in ("displacement", "force"):
        members = [c for c in channels.values() if c.quantity == quantity and c.axis is not None]
        # two channels at right angles share a direction as the squares of their cosines
        total += sum((math.cos((c.axis or 0.0) - angle) ** 2 * (c.uncertainty or 0.0)) ** 2 for c in members)
    return math.sqrt(total)


def _status(
    choice: Choice, steps: PivotSteps, settings: PivotSettings, onset: float, refused: tuple[str, ...]
) -> tuple[Condition, ...]:
    law = choice.fits[0]
    found = []
    if np.any(steps.weight == 0.0):
        found.append(Condition("bad-steps", f"{int(np.sum(steps.weight == 0.0))} left out"))
    if abs(choice.directions[0][0].angle) > settings.angle_warning:
        found.append(Condition("load-off-pad", str(choice.directions[0][0])))
    aside = choice.directions[0][1]
    if choice.structure:
        found.append(Condition("structure-gives", choice.structure))
    elif abs(aside.angle) > 0.5 * settings.displacement_angle_limit:
        found.append(Condition("moves-aside", f"the shaft goes {aside}"))
    if onset > 0.0:
        found.append(Condition("contact-incomplete", f"the shaft is not fully in contact below {onset:.0f} N"))
    if onset >= float(np.max(steps.load)):
        found.append(Condition("contact-never-complete"))
    shares: dict[str, float] = {}
    for fit, weight in zip(choice.fits, choice.weights, strict=True):
        shares[fit.name] = shares.get(fit.name, 0.0) + float(weight)
    if shares[law.name] < CLEAR_CHOICE:
        listed = ", ".join(f"{name} {share:.2f}" for name, share in shares.items())
        found.append(Condition("law-undecided", listed))
    if law.name == "spline":
        found.append(Condition("no-physical-law"))
    if _misfits(law):
        found.append(Condition("misfit", "the scatter exceeds the noise"))
    if not any(record.holds for record in choice.records):
        found.append(Condition("no-holds", "drift cannot be told from deflection"))
    if any(record.lost > MANY_LOST for record in choice.records):
        found.append(Condition("samples-lost"))
    if refused:
        found.append(Condition("runs-refused", "; ".join(refused)))
    return tuple(found)


def contact_onset(fit: LawFit, tolerance: float) -> float:
    """Load [N] from which incomplete contact adds less than `tolerance` to the compliance.

    The shaft's weight keeps it off the upper pads at first (paper, Sec. 5, pads #3 and #4): it still has to come down
    on the pad while the load already grows, and this way adds to the deflection. Contact counts as complete once that
    adds less than a stated share (5 %) to the tangent compliance. The curve itself is the pivot's alone; below the
    onset it is extrapolated.

    Zero where no contact loss was fitted.
    """
    if not fit.contact:
        return 0.0
    gap, decay = float(fit.theta[-2]), float(np.exp(fit.theta[-1]))
    if gap <= 0.0:
        return 0.0
    load = decay
    for _ in range(60):
        # fixed point of (gap / F0) exp(-F / F0) = tolerance c(F): c changes slowly, so this contracts
        share = gap / decay / (tolerance * float(fit.compliance(np.array([max(load, 0.05 * decay)]))[0]))
        new = decay * float(np.log(max(share, 1e-300)))
        if abs(new - load) < 1e-6 * decay:
            break
        load = new
    return max(load, 0.0)


def contact_onset_se(fit: LawFit, tolerance: float) -> float:
    """Standard error of the onset [N], by finite differences through the parameters."""
    if not fit.contact:
        return 0.0
    centre = contact_onset(fit, tolerance)
    gradient = np.zeros(len(fit.theta))
    steps = 0.1 * np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    for k, step in enumerate(steps):
        if step > 0.0:
            theta = fit.theta.copy()
            theta[k] += step
            moved = LawFit(fit.law, fit.reference_load, True, theta, fit.covariance, 0.0, 0.0, 1)
            gradient[k] = (contact_onset(moved, tolerance) - centre) / step
    return float(np.sqrt(gradient @ fit.covariance @ gradient))
