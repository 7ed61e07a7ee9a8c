"""Dry tests to pivot curves: the whole way, for all pads of a campaign (paper, Sec. 5)."""

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import special

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign, Run
from rigdata.problem import Problem, RigDataError, refuse
from tpjb_ident.columns import amount
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import refused_runs
from tpjb_ident.pivot.bad_steps import sound_parts
from tpjb_ident.pivot.creep import without_creep
from tpjb_ident.pivot.curve import Hysteresis, PivotCurve, PivotSteps, measure_loop
from tpjb_ident.pivot.dry_record import (
    DryRecord,
    axial_channels,
    pooled_noise,
    read_dry_run,
    refusal,
    relative_calibration,
)
from tpjb_ident.pivot.law_fit import (
    FRICTION,
    OFFSET,
    SCALE,
    LawFit,
    fit_law,
    keep_likely,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.readings import fit_data, with_friction, with_shared_errors
from tpjb_ident.pivot.refusals import DISPLACEMENT_LIMIT, refused_records, structure_behind, usable_runs
from tpjb_ident.pivot.sweep_witness import SweepWitness, as_witnessed, sweep_witness

CONTACT_TOLERANCE = 0.05  # of the compliance: what incomplete contact may add where contact counts as complete
_ANGLE_WARNING = math.radians(4.0)
_MISFIT_PROBABILITY = 1e-4
_CLEAR_CHOICE = 0.5  # posterior share below which the law counts as undecided
_MANY_LOST = 0.05
_ROUNDS = 40  # of a fixed point
#: Scatter of a pad's compliance from test to test that no pivot has.
_TOO_MUCH = 0.05


def fit_pivots(
    campaign: Campaign, pivot_angles: Sequence[float], on_refusal: Literal["raise", "few", "skip"] = "raise"
) -> tuple[PivotCurve, ...]:
    """Fit a load-deflection curve to the dry tests of every pad.

    Parameters
    ----------
    campaign : Campaign
        With runs of kind ``dry_pivot``.
    pivot_angles : sequence of float
        Directions of the pads [rad], pad #1 first.
    on_refusal : {"raise", "few", "skip"}
        With ``"few"`` or ``"skip"`` refused records are left out as long as most, or any, are left, and the curves say
        so.

    Returns
    -------
    tuple of PivotCurve
        One per pad that was tested, in order of pads.

    Raises
    ------
    RigDataError
        When the campaign has no dry tests, or records are not what they claim to be (wrong pad, swapped
        channel, wrong angle); carries every refusal, not just the first.

    Examples
    --------
    >>> pads = ti.load_bearing(rocker).pads
    >>> curves = ti.fit_pivots(ti.load_campaign(demo), [pad.pivot_angle for pad in pads])
    >>> [curve.pad for curve in curves]
    [1, 2, 3, 4, 5]
    """
    angles = np.asarray(pivot_angles, dtype=float)
    witness = sweep_witness(campaign, angles)
    records, problems = _read(campaign, angles, witness)
    records, contradicted, noise = refused_records(records, angles)
    problems += contradicted
    refused = {problem.run for problem in problems}
    used = [record for record in records if record.run.id not in refused]
    many = 2 * len(refused) >= len(campaign.of_kind("dry_pivot"))
    if problems and (on_refusal == "raise" or not used or (on_refusal == "few" and many)):
        raise RigDataError(problems)
    used, noise, creeps = without_creep(witness.held_against(used), noise)
    used = [with_friction(record, noise) for record in used]
    pads = defaultdict[int, list[DryRecord]](list)
    for record in sorted(used, key=lambda record: record.pad):
        pads[record.pad] += sound_parts(record, noise)
    curves = _fit_pads(list(pads.values()), structure_behind(records))
    common = (*witness.conditions, *refused_runs(problems))
    return tuple(replace(curve, status=(*curve.status, *creeps[curve.pad], *common)) for curve in curves)


def _read(campaign: Campaign, angles: FloatArray, witness: SweepWitness) -> tuple[list[DryRecord], list[Problem]]:
    """Every dry run that can be read, and why the others cannot."""
    runs = campaign.of_kind("dry_pivot")
    if not runs:
        cure = "Record dry pivot tests, one per pad"
        raise refuse("campaign.toml", "runs", "has no runs of kind dry_pivot", cure)

    def read(run: Run) -> DryRecord:
        if run.pad is None or not 1 <= run.pad <= len(angles):
            what = f"names pad {run.pad}, the bearing has pads 1 to {len(angles)}"
            raise refusal(run, "pad", what, "Correct the manifest")
        return read_dry_run(as_witnessed(run, witness.channels), float(angles[run.pad - 1]))

    return usable_runs(runs, read)


def _fit_pads(pads: Sequence[Sequence[DryRecord]], structure: str) -> list[PivotCurve]:
    """Learn the noise about the curves, fit every law to the records of each pad, weigh the laws over the pads."""
    noise = pooled_noise(list(itertools.chain(*pads)), about_curve=True)
    data = [fit_data(records, noise) for records in pads]
    data, scatter = with_shared_errors(pads, data)
    variants = list(itertools.product(LAWS.values(), (False, True)))
    fits = []
    for pad_data in data:
        fits.append([fit_law(law, contact, pad_data) for law, contact in variants])
    fits = with_shared_shape(fits, posterior_weights(fits), data)
    curves = []
    for records, candidates, weights in zip(pads, fits, posterior_weights(fits), strict=True):
        curve = assemble_curve(records, keep_likely(candidates, weights), noise, structure)
        text = f"tests of one pad differ by {100 * scatter:.0f} % in deflection over load"
        differing = holding((scatter > _TOO_MUCH and len(records) > 1, "runs-disagree", text))
        curves.append(replace(curve, status=(*curve.status, *differing)))
    return curves


def assemble_curve(
    records: Sequence[DryRecord], likely: tuple[tuple[LawFit, ...], FloatArray], noise: NoiseModel, structure: str = ""
) -> PivotCurve:
    """Make the curve of one pad of its records and its likely laws with their shares (n,)."""
    fits = tuple(_widened(fit) for fit in likely[0])
    law, first = fits[0], records[0]
    load = np.concatenate([record.used.load for record in records])
    onset, onset_se = contact_onset(law)
    onset = max(onset, *(record.free_load for record in records))
    steps = _steps(records, law, noise)
    curve = PivotCurve(
        pad=first.pad,
        angle=first.angle,
        steps=steps,
        fits=fits,
        weights=likely[1],
        onset_load=onset,
        onset_load_se=onset_se,
        valid_from=max(onset, float(load.min())),
        valid_to=float(load.max()),
        load_direction=first.load_direction,
        displacement_direction=first.displacement_direction,
        hysteresis=_loop(steps, law),
        relative_calibration=math.hypot(
            relative_calibration(axial_channels(first.run).values(), first.angle),
            max(abs(record.elsewhere) for record in records),
        ),
        runs=tuple(dict.fromkeys(record.run.id for record in records)),
    )
    return replace(curve, status=_status(curve, records, structure))


def _misfits(fit: LawFit) -> bool:
    """Whether the points scatter about the law more than their noise allows."""
    return fit.freedom > 0 and bool(special.chdtrc(fit.freedom, fit.chi_square) < _MISFIT_PROBABILITY)


def _widened(fit: LawFit) -> LawFit:
    """The fit with its covariance scaled up where it misfits (Birge's ratio): an interval must not ignore it."""
    return replace(fit, covariance=fit.covariance * fit.chi_square / fit.freedom) if _misfits(fit) else fit


def _zero(record: DryRecord, law: LawFit) -> float:
    """Reading [m] of a record where its curve begins."""
    used = record.used
    return np.mean(used.deflection - law.reading_gradient(used.load, used.branch)[0]) + law.theta[OFFSET]


def _slips(records: Sequence[DryRecord], law: LawFit) -> str:
    """By how much the shaft slipped, wherever a run is in parts, in words."""
    slips = []
    for before, after in itertools.pairwise(records):
        if before.run.id == after.run.id:
            size, load = _zero(after, law) - _zero(before, law), after.used.load[0]
            slips.append(f"by {amount(size, 'length', '+.2g')} at {amount(load, 'force', '.0f')} of {after.run.id}")
    return ", ".join(slips)


def _steps(records: Sequence[DryRecord], law: LawFit, noise: NoiseModel) -> PivotSteps:
    """Points of every run of the pad, each from where its curve begins."""
    parts = []
    for record in records:
        blocks = record.blocks
        groups = blocks.hold if record.holds else np.arange(len(blocks))
        members = np.unique(groups[groups >= 0])[:, None] == groups
        duration = members @ blocks.duration
        share = members * blocks.duration / duration[:, None]
        branch = np.sign(share @ blocks.branch).astype(int)
        load = share @ blocks.load * (1.0 - law.theta[FRICTION] * branch)
        deflection = share @ blocks.deflection - _zero(record, law)
        error = np.sqrt([noise.mean_variance(length) for length in duration])
        aside = share @ blocks.across - blocks.across[0]
        weight = 1.0 - (members & ~record.good).any(axis=1)
        parts.append((load, deflection, error, share @ blocks.across_load, aside, branch, weight))
    return PivotSteps(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _loop(steps: PivotSteps, law: LawFit) -> Hysteresis | None:
    """Loop over the loads as applied that both branches cover: taking off the friction would close it."""
    used = steps.weight > 0
    applied = steps.load / (1.0 - law.theta[FRICTION] * steps.branch)
    up, down = applied[used & (steps.branch == 1)], applied[used & (steps.branch == -1)]
    if min(len(up), len(down)) < 2:
        return None
    return measure_loop(law, float(max(up.min(), down.min())), float(min(up.max(), down.max())))


def _status(curve: PivotCurve, records: Sequence[DryRecord], structure: str) -> Conditions:
    """Named conditions of a curve."""
    law, onset, bad = curve.law, curve.onset_load, np.sum(curve.steps.weight == 0.0)
    aside = abs(curve.displacement_direction.angle) > 0.5 * DISPLACEMENT_LIMIT
    shares: dict[str, float] = defaultdict(float)
    for fit, weight in zip(curve.fits, curve.weights, strict=True):
        shares[fit.name] += weight
    listed = ", ".join(f"{name} {share:.2f}" for name, share in shares.items())
    slipped = _slips(records, law)
    moved = {record.run.id: 100.0 * record.elsewhere for record in records if record.elsewhere}
    elsewhere = ", ".join(f"{run} by {share:+.1f} % of the clearance" for run, share in moved.items())
    return holding(
        (bad > 0, "bad-steps", f"{bad} left out"),
        (slipped, "shaft-slipped", slipped),
        (elsewhere, "starts-elsewhere", elsewhere),
        (abs(curve.load_direction.angle) > _ANGLE_WARNING, "load-off-pad", str(curve.load_direction)),
        (structure, "structure-gives", structure),
        (aside and not structure, "moves-aside", f"the shaft goes {curve.displacement_direction}"),
        (onset > 0.0, "contact-incomplete", f"the shaft is not fully in contact below {amount(onset, 'force', '.0f')}"),
        (onset >= np.max(curve.steps.load), "contact-never-complete", ""),
        (shares[law.name] < _CLEAR_CHOICE, "law-undecided", listed),
        (records[0].untared, "cells-not-tared", records[0].untared),
        (law.name == "spline", "no-physical-law", ""),
        (_misfits(law), "misfit", "the scatter exceeds the noise"),
        (not any(record.holds for record in records), "no-holds", "drift cannot be told from deflection"),
        (any(record.lost > _MANY_LOST for record in records), "samples-lost", ""),
    )


def contact_onset(fit: LawFit) -> tuple[float, float]:
    """Load [N] from which incomplete contact adds little to the compliance, its standard error; zero without any loss.

    The shaft's weight keeps it off the upper pads at first (paper, Sec. 5, pads #3 and #4): it still has to come down
    on the pad while the load already grows, and this way adds to the deflection. Contact counts as complete once that
    adds less than a stated share (5 %) to the tangent compliance. The curve itself is the pivot's alone; below the
    onset it is extrapolated.
    """
    if not fit.contact:
        return 0.0, 0.0
    gap, decay = fit.theta[-2], math.exp(fit.theta[-1])
    onset = decay
    for _ in range(_ROUNDS):
        # fixed point of (gap / F0) exp(-F / F0) = tolerance c(F): c changes slowly, so this contracts
        allowed = CONTACT_TOLERANCE * fit.compliance(np.array(max(onset, 0.05 * decay)))
        onset = decay * math.log(max(gap / decay / allowed, 1e-300))
    if onset <= 0.0:
        return 0.0, 0.0
    gradient = np.zeros(len(fit.theta))  # the compliance changes slowly: it is taken as that at the onset
    gradient[[SCALE, -2, -1]] = -decay, decay / gap, onset - decay
    return onset, math.sqrt(gradient @ fit.covariance @ gradient)
