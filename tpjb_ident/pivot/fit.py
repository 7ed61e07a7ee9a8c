"""Dry tests to pivot curves: the whole way, for all pads of a campaign (paper, Sec. 5).

A slip, a knock, a probe that jumped and came back: each hold is tested as a whole against the most flexible law, with
the noise as it is correlated. Would a shift of this hold alone explain the record better, and by how many standard
errors? The worst goes first, then the remainder is tested again without it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.problem import Problem, RigDataError, refuse
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import refused_runs
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.creep import without_creep
from tpjb_ident.pivot.curve import Hysteresis, PivotCurve, PivotSteps, measure_loop
from tpjb_ident.pivot.dry_record import (
    DryRecord,
    axial_channels,
    noise_about_curve,
    read_dry_run,
    relative_calibration,
)
from tpjb_ident.pivot.law_fit import (
    FRICTION,
    OFFSET,
    FitData,
    LawFit,
    fit_law,
    keep_likely,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.refusals import refused_records, structure_of

if TYPE_CHECKING:
    from rigdata.campaign import Campaign

REFERENCE_SHARE = 0.4  # reference load of the laws, as a share of the largest load
MODEL_ERROR = 3e-4  # of the deflection: what averaging over a curved law leaves; matters in computed records only
UNKNOWN_ZERO = 2.0e-5  # [m], spread of the reading at zero load from run to run of one pad
_MOST_BAD = 0.3  # share of the groups that may be dropped
GROUPS_ON_RAMP = 15
_STICKS_WITHIN = 0.08  # of the load at a reversal: twice the friction of a poor pivot


def fit_data(records: Sequence[DryRecord], noise: NoiseModel, settings: PivotSettings) -> FitData:
    """Join the good blocks of one pad's runs; each run has its own drift and its own zero."""
    parts = [record.blocks.take(record.good) for record in records]
    load = np.concatenate([blocks.load for blocks in parts])
    deflection = np.concatenate([blocks.deflection for blocks in parts])
    branch = np.concatenate([blocks.branch for blocks in parts]).astype(float)
    compliance = float(np.ptp(deflection)) / max(float(np.ptp(load)), 1e-300)
    covariance = np.zeros((len(load), len(load)))
    start = 0
    for record, blocks in zip(records, parts, strict=True):
        part = slice(start, start + len(blocks))
        start += len(blocks)
        covariance[part, part] = noise.covariance(blocks.time, blocks.duration) + np.diag(
            (compliance * blocks.load_spread) ** 2
            + (settings.lag_allowance * compliance * blocks.rate) ** 2
            + (MODEL_ERROR * float(np.ptp(deflection))) ** 2
        )
        one_hold = (blocks.hold[:, None] == blocks.hold[None, :]) & (blocks.hold >= 0)
        covariance[part, part] += record.quantisation**2 * (one_hold | np.eye(len(blocks), dtype=bool))
        if len(records) > 1:
            covariance[part, part] += UNKNOWN_ZERO**2
    both, creep = len(np.unique(branch)) > 1, max(record.creep for record in records)
    return FitData(
        load=load,
        deflection=deflection - deflection[int(np.argmin(load))],
        branch=branch,
        whitener=np.linalg.inv(np.linalg.cholesky(covariance)),
        reference_load=REFERENCE_SHARE * float(np.max(load)),
        # on one branch a share of the load and a share of the deflection that creeps are one error
        friction=(0.0, 0.05) if both else (settings.friction_share, max(settings.friction_share_se, creep)),
    )


def bad_blocks(record: DryRecord, noise: NoiseModel, settings: PivotSettings) -> BoolArray:
    """Blocks (m,) that belong to bad steps, or to a reversal."""
    groups = _groups(record)
    bad = sticking(record.blocks.load, record.blocks.branch)
    for _ in range(int(_MOST_BAD * len(np.unique(groups)))):
        data = fit_data([replace(record, good=~bad)], noise, settings)
        worst, size = _worst(fit_law(LAWS["spline"], True, data), data, groups[~bad])
        if size < settings.bad_hold_limit:
            break
        # a hold goes with the ramps on either side: whatever spoilt it need not have kept to its limits
        bad |= np.abs(groups - worst) <= worst % 2
    return bad


def sticking(load: FloatArray, branch: IntArray) -> BoolArray:
    """Blocks (m,) just after a reversal of the load, where friction holds the pivot and no law applies."""
    stuck = np.zeros(len(load), dtype=bool)
    reversal: float | None = None
    for k in range(1, len(load)):
        if branch[k] != branch[k - 1]:
            reversal = float(load[k - 1])
        if reversal is None:
            continue
        if abs(load[k] - reversal) < _STICKS_WITHIN * abs(reversal):
            stuck[k] = True
        else:
            reversal = None
    return stuck


def _groups(record: DryRecord) -> IntArray:
    """Number (m,) of the stretch that each block belongs to: odd for holds, even for ramps, in order of time."""
    hold = record.blocks.hold
    m = len(hold)
    if not record.holds:
        return np.asarray(2 * (np.arange(m) * GROUPS_ON_RAMP // m))
    before = np.maximum.accumulate(hold)
    return np.asarray(np.where(hold >= 0, 2 * hold + 1, 2 * before + 2))


def _worst(fit: LawFit, data: FitData, groups: IntArray) -> tuple[int, float]:
    """The group (of m) whose shift is most significant, and its size in standard errors."""
    reading, jacobian = fit.reading_gradient(data.load, data.branch)
    residual = data.whitener @ (data.deflection - reading)
    # what the law could take up of a shift is not held against the hold
    scale = np.sqrt(np.diag(fit.covariance))
    design = data.whitener @ (jacobian * scale)
    hat = fit.covariance / np.outer(scale, scale)
    worst, size = -1, 0.0
    for group in np.unique(groups):
        shift = data.whitener @ (groups == group).astype(float)
        absorbed = design.T @ shift
        information = float(shift @ shift - absorbed @ hat @ absorbed)
        if information > 1e-6 * float(shift @ shift):
            statistic = abs(float(shift @ residual - absorbed @ hat @ (design.T @ residual))) / np.sqrt(information)
            if statistic > size:
                worst, size = int(group), statistic
    return worst, size


_MISFIT_PROBABILITY = 1e-4
_CLEAR_CHOICE = 0.5  # posterior share below which the law counts as undecided
_MANY_LOST = 0.05


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

    Examples
    --------
    >>> pads = ti.load_bearing(rocker).pads
    >>> curves = ti.fit_pivots(ti.load_campaign(demo), [pad.pivot_angle for pad in pads])
    >>> [curve.pad for curve in curves]
    [1, 2, 3, 4, 5]
    """
    settings = settings or PivotSettings()
    angles = np.asarray(pivot_angles, dtype=float)
    records, problems = _read(campaign, angles, settings)
    records, contradicted, noise = refused_records(records, settings, angles)
    problems += contradicted
    refused = {problem.run for problem in problems}
    pads: dict[int, list[DryRecord]] = {}
    for record in records:
        if record.run.id not in refused:
            pads.setdefault(record.pad, []).append(record)
    many = 2 * len(refused) >= len(campaign.of_kind("dry_pivot"))
    if problems and (settings.on_refusal == "raise" or not pads or (settings.on_refusal == "few" and many)):
        raise RigDataError(problems)
    used = [record for pad_records in pads.values() for record in pad_records]
    used, noise, creeps = without_creep(used, noise, settings.drift_rate)
    for number in pads:
        pad_records = [record for record in used if record.pad == number]
        pads[number] = [replace(record, good=~bad_blocks(record, noise, settings)) for record in pad_records]
    curves = _fit_pads([pads[number] for number in sorted(pads)], settings, str(structure_of(records, settings) or ""))
    return tuple(replace(curve, status=(*curve.status, *creeps, *refused_runs(problems))) for curve in curves)


def _read(campaign: Campaign, angles: FloatArray, settings: PivotSettings) -> tuple[list[DryRecord], list[Problem]]:
    """Every dry run that can be read, and why the others cannot."""
    runs = campaign.of_kind("dry_pivot")
    if not runs:
        cure = "Record dry pivot tests, one per pad"
        raise refuse("campaign.toml", "runs", "has no runs of kind dry_pivot", cure)
    records: list[DryRecord] = []
    problems: list[Problem] = []
    for run in runs:
        try:
            if run.pad is None or not 1 <= run.pad <= len(angles):
                what = f"run {run.id} names pad {run.pad}, the bearing has pads 1 to {len(angles)}"
                raise refuse(run.file, "pad", what, "Correct the manifest", run.id)
            records.append(read_dry_run(run, float(angles[run.pad - 1]), settings))
        except RigDataError as error:
            problems += error.problems
    return records, problems


def _fit_pads(pads: Sequence[Sequence[DryRecord]], settings: PivotSettings, structure: str) -> tuple[PivotCurve, ...]:
    """Learn the noise about the curves, fit every law to the records of each pad, weigh the laws over the pads."""
    noise = noise_about_curve([record for records in pads for record in records], settings.drift_rate)
    data = [fit_data(records, noise, settings) for records in pads]
    variants = list(itertools.product(settings.laws, (False, True)))
    fits = [[fit_law(LAWS[name], contact, pad_data) for name, contact in variants] for pad_data in data]
    fits = with_shared_shape(fits, posterior_weights(fits), data)
    curves = []
    for records, candidates, weights in zip(pads, fits, posterior_weights(fits), strict=True):
        curves.append(assemble_curve(records, keep_likely(candidates, weights), noise, settings, structure))
    return tuple(curves)


def assemble_curve(
    records: Sequence[DryRecord],
    likely: tuple[tuple[LawFit, ...], FloatArray],
    noise: NoiseModel,
    settings: PivotSettings,
    structure: str = "",
) -> PivotCurve:
    """Make the curve of one pad of its records and its likely laws with their shares (n,)."""
    fits = tuple(_widened(fit) for fit in likely[0])
    law, first = fits[0], records[0]
    loads = [record.blocks.load[record.good] for record in records]
    onset = max(contact_onset(law, settings.contact_tolerance), *(record.free_load for record in records))
    steps = _all_steps(records, law, noise)
    curve = PivotCurve(
        pad=first.pad,
        angle=first.angle,
        steps=steps,
        fits=fits,
        weights=likely[1],
        onset_load=onset,
        onset_load_se=contact_onset_se(law, settings.contact_tolerance),
        valid_from=max(onset, min(float(load.min()) for load in loads)),
        valid_to=max(float(load.max()) for load in loads),
        load_direction=first.load_direction,
        displacement_direction=first.displacement_direction,
        hysteresis=_loop(steps, law),
        relative_calibration=relative_calibration(axial_channels(first.run).values(), first.angle),
        runs=tuple(record.run.id for record in records),
    )
    return replace(curve, status=tuple(_status(curve, records, settings, structure)))


def _misfits(fit: LawFit) -> bool:
    """Whether the points scatter about the law more than their noise allows."""
    return fit.freedom > 0 and bool(special.chdtrc(fit.freedom, fit.chi_square) < _MISFIT_PROBABILITY)


def _widened(fit: LawFit) -> LawFit:
    """The fit with its covariance scaled up where it misfits (Birge's ratio): an interval must not ignore it."""
    return replace(fit, covariance=fit.covariance * fit.chi_square / fit.freedom) if _misfits(fit) else fit


def _all_steps(records: Sequence[DryRecord], law: LawFit, noise: NoiseModel) -> PivotSteps:
    """Points of every run of the pad, counted from the reading at the lowest load of any run."""
    lowest = min(records, key=lambda record: float(record.blocks.load[record.good].min()))
    used = lowest.blocks.take(lowest.good)
    zero = float(used.deflection[int(np.argmin(used.load))])
    parts = [_steps(record, law, noise, zero) for record in records]
    return PivotSteps(*(np.concatenate([getattr(p, column.name) for p in parts]) for column in fields(PivotSteps)))


def _steps(record: DryRecord, law: LawFit, noise: NoiseModel, zero: float) -> PivotSteps:
    """Points of one run, counted from the reading `zero` [m]."""
    blocks = record.blocks
    groups = blocks.hold if record.holds else np.arange(len(blocks))
    members = np.unique(groups[groups >= 0])[:, None] == groups
    duration = members @ blocks.duration
    share = members * blocks.duration / duration[:, None]
    branch = blocks.branch[np.argmax(members, axis=1)]
    return PivotSteps(
        load=share @ blocks.load * (1.0 - law.theta[FRICTION] * branch),
        deflection=share @ blocks.deflection - zero - law.theta[OFFSET],
        deflection_se=np.sqrt([noise.mean_variance(float(length)) for length in duration]),
        across_load=share @ blocks.across_load,
        across_deflection=share @ blocks.across - blocks.across[0],
        branch=branch,
        weight=1.0 - (members & ~record.good).any(axis=1),
    )


def _loop(steps: PivotSteps, law: LawFit) -> Hysteresis | None:
    """Loop over the loads as applied: taking off the friction would close it.

    The deflections are those of the fit at the steps: it knows drift from friction by what goes on within the holds,
    while the area between the points themselves takes every drift from the way up to the way down for a loss.
    """
    used = steps.weight > 0
    applied = (steps.load / (1.0 - law.theta[FRICTION] * steps.branch))[used]
    reading, gradient = law.reading_gradient(applied, steps.branch[used].astype(float))
    return measure_loop(applied, reading, gradient @ law.covariance @ gradient.T, steps.branch[used])


def _status(
    curve: PivotCurve, records: Sequence[DryRecord], settings: PivotSettings, structure: str
) -> list[Condition]:
    """Named conditions of a curve."""
    law, onset = curve.law, curve.onset_load
    status = []
    bad = int(np.sum(curve.steps.weight == 0.0))
    if bad:
        status.append(Condition("bad-steps", f"{bad} left out"))
    if abs(curve.load_direction.angle) > settings.angle_warning:
        status.append(Condition("load-off-pad", str(curve.load_direction)))
    if structure:
        status.append(Condition("structure-gives", structure))
    elif abs(curve.displacement_direction.angle) > 0.5 * settings.displacement_angle_limit:
        status.append(Condition("moves-aside", f"the shaft goes {curve.displacement_direction}"))
    if onset > 0.0:
        status.append(Condition("contact-incomplete", f"the shaft is not fully in contact below {onset:.0f} N"))
    if onset >= float(np.max(curve.steps.load)):
        status.append(Condition("contact-never-complete"))
    shares: dict[str, float] = {}
    for fit, weight in zip(curve.fits, curve.weights, strict=True):
        shares[fit.name] = shares.get(fit.name, 0.0) + float(weight)
    if shares[law.name] < _CLEAR_CHOICE:
        listed = ", ".join(f"{name} {share:.2f}" for name, share in shares.items())
        status.append(Condition("law-undecided", listed))
    if law.name == "spline":
        status.append(Condition("no-physical-law"))
    if _misfits(law):
        status.append(Condition("misfit", "the scatter exceeds the noise"))
    if not any(record.holds for record in records):
        status.append(Condition("no-holds", "drift cannot be told from deflection"))
    if any(record.lost > _MANY_LOST for record in records):
        status.append(Condition("samples-lost"))
    return status


def contact_onset(fit: LawFit, tolerance: float) -> float:
    """Load [N] from which incomplete contact adds less than `tolerance` to the compliance; zero without contact loss.

    The shaft's weight keeps it off the upper pads at first (paper, Sec. 5, pads #3 and #4): it still has to come down
    on the pad while the load already grows, and this way adds to the deflection. Contact counts as complete once that
    adds less than a stated share (5 %) to the tangent compliance. The curve itself is the pivot's alone; below the
    onset it is extrapolated.
    """
    if not fit.contact:
        return 0.0
    gap, decay = float(fit.theta[-2]), float(np.exp(fit.theta[-1]))
    if gap <= 0.0:
        return 0.0
    load = decay
    for _ in range(60):
        # fixed point of (gap / F0) exp(-F / F0) = tolerance c(F): c changes slowly, so this contracts
        compliance = float(fit.compliance(np.array([max(load, 0.05 * decay)]))[0])
        share = gap / decay / (tolerance * compliance)
        updated = decay * float(np.log(max(share, 1e-300)))
        if abs(updated - load) < 1e-6 * decay:
            break
        load = updated
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
            gradient[k] = (contact_onset(replace(fit, theta=theta), tolerance) - centre) / step
    return float(np.sqrt(gradient @ fit.covariance @ gradient))
