"""The last step of a pivot fit: points, onset, loop, status, one `PivotCurve`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from tpjb_ident.arrays import BoolArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.pivot.curve import PivotCurve, PivotSteps
from tpjb_ident.pivot.hysteresis import Hysteresis, measure_loop
from tpjb_ident.pivot.laws.law_fit import FRICTION, OFFSET, LawFit
from tpjb_ident.pivot.records.dry_record import DryRecord
from tpjb_ident.pivot.records.projection import PadDirection
from tpjb_ident.pivot.records.settings import PivotSettings
from tpjb_ident.slow_records.noise import NoiseModel

if TYPE_CHECKING:
    from rigdata.calibration import Channel

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
