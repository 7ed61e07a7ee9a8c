"""Dry tests to pivot curves: the whole way, for all pads of a campaign (paper, Sec. 5).

A slip, a knock, a probe that jumped and came back: each hold is tested as a whole against the most flexible law, with
the noise as it is correlated. Would a shift of this hold alone explain the record better, and by how many standard
errors? The worst goes first, then the remainder is tested again without it.
"""

import itertools
import math
import operator
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy import linalg, optimize, special

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.campaign import Campaign, Run
from rigdata.problem import Problem, RigDataError, refuse
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import refused_runs
from tpjb_ident.pivot.blocks import slid
from tpjb_ident.pivot.creep import without_creep
from tpjb_ident.pivot.curve import Hysteresis, PivotCurve, PivotSteps, measure_loop
from tpjb_ident.pivot.dry_record import (
    FRICTION_SE,
    FRICTION_SHARE,
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
    FitData,
    LawFit,
    fit_law,
    keep_likely,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.refusals import (
    DISPLACEMENT_LIMIT,
    refused_records,
    structure_behind,
    usable_runs,
)

REFERENCE_SHARE = 0.4  # reference load of the laws, as a share of the largest load
MODEL_ERROR = 3e-4  # of the deflection: what averaging over a curved law leaves; matters in computed records only
UNKNOWN_ZERO = 2.0e-5  # [m], spread of the reading at zero load from run to run of one pad
LAG = 0.002  # [s], by which displacement may lag behind load
_TIMES = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # the usual share of friction, where the load comes back
GROUPS_ON_RAMP = 15
CONTACT_TOLERANCE = 0.05  # of the compliance: what incomplete contact may add where contact counts as complete
_BAD_LIMIT = 5.0  # standard errors
_MOST_BAD = 0.3  # share of the groups that may be dropped
_ANGLE_WARNING = math.radians(4.0)
_MISFIT_PROBABILITY = 1e-4
_CLEAR_CHOICE = 0.5  # posterior share below which the law counts as undecided
_MANY_LOST = 0.05
_ROUNDS = 40  # of a fixed point
#: Share of a difference that a curve must leave for the tests to tell it.
_LEAST_SHARE = 1e-3
#: Fall of the deviance from which tests of one pad differ: one in twenty sets of equal tests shows it.
_CLEAR_SCATTER = 2.7
#: Scatter of a pad's compliance from test to test that no pivot has.
_TOO_MUCH = 0.05


def fit_data(records: Sequence[DryRecord], noise: NoiseModel) -> FitData:
    """Join the good blocks of one pad's runs; each run has its own drift and its own zero."""
    parts = [record.used for record in records]
    load = np.concatenate([part.load for part in parts])
    deflection = np.concatenate([part.deflection for part in parts])
    branch = np.concatenate([part.branch for part in parts])
    compliance = np.ptp(deflection) / max(np.ptp(load), 1e-300)
    covariances = []
    for record, part in zip(records, parts, strict=True):
        error = compliance * np.hypot(part.load_spread, LAG * part.rate)
        own = np.diag(error**2 + (MODEL_ERROR * np.ptp(deflection)) ** 2)
        one_level = (part.hold[:, None] == part.hold) & (part.hold >= 0) | np.eye(len(part), dtype=bool)
        zero = UNKNOWN_ZERO**2 if len(records) > 1 else 0.0
        covariances.append(part.covariance(noise) + record.quantisation**2 * one_level + own + zero)
    friction, spread = max((record.friction for record in records), key=operator.itemgetter(1))
    return FitData(
        load=load,
        deflection=deflection - deflection[np.argmin(load)],
        branch=branch,
        whitener=np.linalg.inv(np.linalg.cholesky(linalg.block_diag(*covariances))),
        reference_load=REFERENCE_SHARE * np.max(load),
        # on one branch a share of the load and a share of the deflection that creeps are one error
        friction=(friction, max(spread, *(record.creep for record in records))),
    )


def with_friction(record: DryRecord, noise: NoiseModel) -> DryRecord:
    """The record at the loads at which its pivot last slid, by the friction that explains best how it moved.

    A load that overshoots, wanders or turns shows how far it must come back before the pivot follows.
    """
    if np.ptp(slid(record.blocks, record.course, FRICTION_SHARE).branch) == 0.0:
        return record
    data, likeliest, evidence, fitted, start = fit_data([record], noise), record, -math.inf, 0.0, None
    for times in (*_TIMES, None, None):
        share = fitted if times is None else times * FRICTION_SHARE
        blocks, friction = slid(record.blocks, record.course, share), (share, max(share, FRICTION_SE))
        trial = replace(data, load=blocks.load, branch=blocks.branch, friction=friction)
        fit = fit_law(LAWS["spline"], True, trial, start)
        start = fit.theta
        # nothing else tells much friction from more
        likely = fit.log_evidence - math.log1p((share / FRICTION_SHARE - 1.0) ** 2)
        if likely > evidence:
            likeliest, evidence = replace(record, blocks=blocks, friction=friction), likely
            fitted = abs(fit.theta[FRICTION])
    return likeliest


def bad_blocks(record: DryRecord, noise: NoiseModel) -> BoolArray:
    """Blocks (m,) that belong to bad steps."""
    groups = _groups(record)
    bad = ~record.good
    for _ in range(int(_MOST_BAD * len(np.unique(groups)))):
        data = fit_data([replace(record, good=~bad)], noise)
        numbers = np.unique(groups[~bad])
        fit = fit_law(LAWS["spline"], True, data)
        shift, remainder, score = _score_of(fit, data, groups[~bad][:, None] == numbers)
        information, whole = np.sum(shift * remainder, axis=0), np.sum(shift**2, axis=0)
        # by how many standard errors each group is off; what the law can take up tells nothing
        size = np.abs(score) / np.sqrt(np.maximum(information, 1e-6 * whole))
        size[information <= 1e-6 * whole] = 0.0
        if np.max(size) < _BAD_LIMIT:
            break
        worst = numbers[np.argmax(size)]
        # a hold goes with the ramps on either side: whatever spoilt it need not have kept to its limits
        bad |= np.abs(groups - worst) <= worst % 2
    return bad


def _groups(record: DryRecord) -> IntArray:
    """Number (m,) of the stretch that each block belongs to: odd for holds, even for ramps, in order of time."""
    hold = record.blocks.hold
    if not record.holds:
        return 2 * (np.arange(len(hold)) * GROUPS_ON_RAMP // len(hold))
    return np.where(hold >= 0, 2 * hold + 1, 2 * np.maximum.accumulate(hold) + 2)


def _score_of(fit: LawFit, data: FitData, columns: FloatArray | BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes (m, k) of the readings, whitened; what the law cannot take up of them; the residual along that (k,)."""
    reading, jacobian = fit.reading_gradient(data.load, data.branch)
    design, residual = data.whitener @ jacobian, data.whitener @ (data.deflection - reading)
    shift = data.whitener @ columns
    remainder = shift - design @ (fit.covariance @ (design.T @ shift))
    return shift, remainder, residual @ remainder


def with_shared_errors(pads: Sequence[Sequence[DryRecord]], data: Sequence[FitData]) -> tuple[list[FitData], float]:
    """Data of pads with what is off alike in all readings of a test or of a pad.

    Compliance is another one in every test of a pad, by a scatter that all pads' tests tell together; and the load has
    a zero that is known so well.
    """
    if all(len(records) < 2 and not records[0].load_error for records in pads):
        return list(data), 0.0
    fits = [fit_law(LAWS["spline"], True, pad) for pad in data]
    runs = [np.repeat(np.arange(len(records)), [len(record.used) for record in records]) for records in pads]
    # of the curve, not of the readings: these would favour the softer test
    changes = [fit.reading_gradient(pad.load, pad.branch)[0] - fit.theta[OFFSET] for fit, pad in zip(fits, data)]
    scatter = _scatter(fits, data, runs, changes)
    wider = []
    for records, pad, fit, run, change in zip(pads, data, fits, runs, changes, strict=True):
        root, error = np.linalg.inv(pad.whitener), max(record.load_error for record in records)
        more, less = (fit.reading_gradient(pad.load + shift, pad.branch)[0] for shift in (error, -error))
        zero = 0.5 * (more - less)
        covariance = root @ root.T + scatter**2 * np.outer(change, change) * (run[:, None] == run)
        whitener = np.linalg.inv(np.linalg.cholesky(covariance + np.outer(zero, zero)))
        wider.append(replace(pad, whitener=whitener) if scatter or error else pad)
    return wider, scatter


def _scatter(
    fits: Sequence[LawFit], data: Sequence[FitData], runs: Sequence[IntArray], changes: Sequence[FloatArray]
) -> float:
    """Scatter of the compliance from test to test of a pad; zero where it may be chance."""
    sizes, squares = [np.zeros(0)], [np.zeros(0)]
    for fit, pad, run, change in zip(fits, data, runs, changes, strict=True):
        columns = (run[:, None] == np.unique(run)) * change[:, None]
        # what all tests have in common is the curve's
        shift, remainder, score = _score_of(fit, pad, columns @ linalg.null_space(np.ones((1, columns.shape[1]))))
        information, basis = np.linalg.eigh(shift.T @ remainder)
        informative = information > _LEAST_SHARE * np.sum(shift**2)
        sizes.append(information[informative])
        squares.append((basis.T @ score)[informative] ** 2 / information[informative])
    size, square = np.concatenate(sizes), np.concatenate(squares)

    def deviance(logarithm: float) -> float:
        variance = 1.0 + math.exp(2.0 * logarithm) * size
        return np.sum(np.log(variance) + square / variance)

    best = optimize.minimize_scalar(deviance, bounds=(math.log(1e-4), 0.0), method="bounded").x
    return math.exp(best) if np.sum(square) - deviance(best) > _CLEAR_SCATTER else 0.0


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
    records, problems = _read(campaign, angles)
    records, contradicted, noise = refused_records(records, angles)
    problems += contradicted
    refused = {problem.run for problem in problems}
    used = [record for record in records if record.run.id not in refused]
    many = 2 * len(refused) >= len(campaign.of_kind("dry_pivot"))
    if problems and (on_refusal == "raise" or not used or (on_refusal == "few" and many)):
        raise RigDataError(problems)
    used, noise, creeps = without_creep(used, noise)
    used = [with_friction(record, noise) for record in used]
    pads = defaultdict(list)
    for record in sorted(used, key=lambda record: record.pad):
        pads[record.pad].append(replace(record, good=~bad_blocks(record, noise)))
    curves = _fit_pads(list(pads.values()), structure_behind(records))
    return tuple(
        replace(curve, status=(*curve.status, *creeps[curve.pad], *refused_runs(problems))) for curve in curves
    )


def _read(campaign: Campaign, angles: FloatArray) -> tuple[list[DryRecord], list[Problem]]:
    """Every dry run that can be read, and why the others cannot."""
    runs = campaign.of_kind("dry_pivot")
    if not runs:
        cure = "Record dry pivot tests, one per pad"
        raise refuse("campaign.toml", "runs", "has no runs of kind dry_pivot", cure)

    def read(run: Run) -> DryRecord:
        if run.pad is None or not 1 <= run.pad <= len(angles):
            what = f"names pad {run.pad}, the bearing has pads 1 to {len(angles)}"
            raise refusal(run, "pad", what, "Correct the manifest")
        return read_dry_run(run, float(angles[run.pad - 1]))

    return usable_runs(runs, read)


def _fit_pads(pads: Sequence[Sequence[DryRecord]], structure: str) -> list[PivotCurve]:
    """Learn the noise about the curves, fit every law to the records of each pad, weigh the laws over the pads."""
    noise = pooled_noise(list(itertools.chain(*pads)), about_curve=True)
    data = [fit_data(records, noise) for records in pads]
    data, scatter = with_shared_errors(pads, data)
    variants = list(itertools.product(LAWS.values(), (False, True)))
    fits = [[fit_law(law, contact, pad_data) for law, contact in variants] for pad_data in data]
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
        relative_calibration=relative_calibration(axial_channels(first.run).values(), first.angle),
        runs=tuple(record.run.id for record in records),
    )
    return replace(curve, status=_status(curve, records, structure))


def _misfits(fit: LawFit) -> bool:
    """Whether the points scatter about the law more than their noise allows."""
    return fit.freedom > 0 and bool(special.chdtrc(fit.freedom, fit.chi_square) < _MISFIT_PROBABILITY)


def _widened(fit: LawFit) -> LawFit:
    """The fit with its covariance scaled up where it misfits (Birge's ratio): an interval must not ignore it."""
    return replace(fit, covariance=fit.covariance * fit.chi_square / fit.freedom) if _misfits(fit) else fit


def _steps(records: Sequence[DryRecord], law: LawFit, noise: NoiseModel) -> PivotSteps:
    """Points of every run of the pad, counted from the reading at the lowest load of any run."""
    used = [record.used for record in records]
    lowest = min(used, key=lambda blocks: blocks.load.min())
    zero = lowest.deflection[np.argmin(lowest.load)]
    parts = []
    for record in records:
        blocks = record.blocks
        groups = blocks.hold if record.holds else np.arange(len(blocks))
        members = np.unique(groups[groups >= 0])[:, None] == groups
        duration = members @ blocks.duration
        share = members * blocks.duration / duration[:, None]
        branch = np.sign(share @ blocks.branch).astype(int)
        load = share @ blocks.load * (1.0 - law.theta[FRICTION] * branch)
        deflection = share @ blocks.deflection - zero - law.theta[OFFSET]
        error = np.sqrt([noise.mean_variance(length) for length in duration])
        aside = share @ blocks.across - blocks.across[0]
        weight = 1.0 - (members & ~record.good).any(axis=1)
        parts.append((load, deflection, error, share @ blocks.across_load, aside, branch, weight))
    return PivotSteps(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _loop(steps: PivotSteps, law: LawFit) -> Hysteresis | None:
    """Loop over the loads as applied that both branches cover: taking off the friction would close it."""
    used = steps.weight > 0
    applied = steps.load / (1.0 - law.theta[FRICTION] * steps.branch)
    up, down = (applied[used & (steps.branch == branch)] for branch in (1, -1))
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
    return holding(
        (bad > 0, "bad-steps", f"{bad} left out"),
        (abs(curve.load_direction.angle) > _ANGLE_WARNING, "load-off-pad", str(curve.load_direction)),
        (structure, "structure-gives", structure),
        (aside and not structure, "moves-aside", f"the shaft goes {curve.displacement_direction}"),
        (onset > 0.0, "contact-incomplete", f"the shaft is not fully in contact below {onset:.0f} N"),
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
