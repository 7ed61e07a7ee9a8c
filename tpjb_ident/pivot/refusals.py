"""Records that are not what they claim to be: wrong pad, swapped or reversed channels, wrong angle."""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.campaign import Run
from rigdata.problem import Problem, RigDataError, Severity
from rigdata.vector import wrapped
from tpjb_ident.phasors.line_fit import robust_deviation
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import REMEDY, contradictions
from tpjb_ident.pivot.dry_record import (
    LOAD_LIMIT,
    DryRecord,
    displacement_direction,
    pad_axes,
    pooled_noise,
    probes_of,
    with_load_zero,
)
from tpjb_ident.pivot.sweep_witness import common_start

T = TypeVar("T")
DISPLACEMENT_LIMIT = math.radians(30.0)  # off the pad
_FAR_OFF = math.radians(30.0)  # from where a pad leaves no doubt that it is another one's record
_ASIDE = 0.12  # of the clearance: a pad that tilts freely brings the shaft to its pivot's line within some micrometres
_ASIDE_SPREAD = 5.0  # robust standard deviations of the campaign's own runs, where they stand less orderly than that
_FAR_ASIDE = 0.35  # of the clearance, from where it is no wrong number of degrees any more
_ALONG = 0.5  # of the clearance: pads may differ, but not by this much
_CURE = "Check the run's pad number, the channels' axes, polarities and order, pad angles or static_load_direction"
#: Pads that must be there for a structure: two numbers are fitted.
_FEWEST = 4
#: Slack when the spring's own movement is compared with what was read, as a share of it.
_SLACK = 0.1


def usable_runs(
    runs: Sequence[Run], read: Callable[[Run], T], most: int | None = None
) -> tuple[list[T], list[Problem]]:
    """What is read of each run, of the first few where `most` is given, and why others cannot be used."""
    records: list[T] = []
    problems = []
    for run in runs:
        if len(records) == most:
            break
        try:  # units in the file other than the manifest's are errors
            contradicted = [problem for problem in run.reader.problems() if problem.severity == "error"]
            problems += contradicted
            if not contradicted:
                records.append(read(run))
        except RigDataError as error:
            problems += error.problems
    return records, problems


def refused_records(
    records: Sequence[DryRecord], pad_angles: FloatArray
) -> tuple[list[DryRecord], list[Problem], NoiseModel]:
    """Records from their cells' zero, with displacement directions; why some are not what they claim; their noise."""
    if not records:
        return [], [], NoiseModel(1.0, 1.0, 1.0)
    records, noise = with_load_zero(records), pooled_noise(records)
    directed = []
    for record in records:
        direction = displacement_direction(record.blocks, noise, record.quantisation)
        directed.append(replace(record, displacement_direction=direction))
    problems = check_directions(directed, pad_angles)
    return directed, problems + check_placement(directed) + check_spares(directed, noise), noise


def check_directions(records: Sequence[DryRecord], pad_angles: FloatArray) -> list[Problem]:
    """Records whose load or displacement points elsewhere than at their pad; `pad_angles` (n_pads,) [rad] or NaN."""
    problems = []
    limits = {"force": LOAD_LIMIT, "displacement": math.inf if structure_behind(records) else DISPLACEMENT_LIMIT}
    for record in records:
        pointing = {"force": record.load_direction.angle, "displacement": record.displacement_direction.angle}
        beyond = [quantity for quantity, angle in pointing.items() if abs(angle) > limits[quantity]]
        for quantity in beyond[:1]:
            angle, limit = pointing[quantity], limits[quantity]
            reading = "opposite to" if abs(angle) > math.radians(135.0) else "away from"
            what = (
                f"run {record.run.id} says pad {record.pad} at {math.degrees(record.angle):g} deg, but its "
                f"{quantity} grows {math.degrees(angle):+.1f} deg {reading} that direction "
                f"(limit {math.degrees(limit):g} deg): {_suspect(record, pad_angles)}"
            )
            problems.append(_problem(record, f"{quantity} channels", what, abs(angle) > _FAR_OFF))
    return problems


def _problem(record: DryRecord, place: str, what: str, is_certain: bool = True, cure: str = _CURE) -> Problem:
    severity: Severity = "error" if is_certain else "warning"
    return Problem(severity, record.run.file, place, what, cure, run=record.run.id)


def _suspect(record: DryRecord, pad_angles: FloatArray) -> str:
    """Which of wrong pad, wrong channel and wrong angle explains both directions."""
    load, moved = record.load_direction.angle, record.displacement_direction.angle
    load_elsewhere, moved_elsewhere = abs(load) > LOAD_LIMIT, abs(moved) > DISPLACEMENT_LIMIT
    if load_elsewhere and abs(math.remainder(load - moved, 2 * math.pi)) < DISPLACEMENT_LIMIT:
        distances = np.abs(wrapped(record.angle + load - pad_angles))
        if np.nanmin(distances, initial=np.inf) < LOAD_LIMIT:
            return f"wrong pad: load and displacement both point at pad {np.nanargmin(distances) + 1}"
        return f"wrong angle: load and displacement turn together by {math.degrees(load):+.0f} deg"
    if load_elsewhere != moved_elsewhere:
        quantity = "force" if load_elsewhere else "displacement"
        return f"wrong channel: the other vector points at the pad, so {quantity} channels are exchanged or reversed"
    return "wrong pad, wrong channel or wrong angle: load and displacement point neither at a pad nor the same way"


def structure_behind(records: Sequence[DryRecord]) -> str:
    """One compliance that explains displacements beyond their limit; empty where none is beyond or explains them.

    Where a pad at phi with normal n is pushed with the load W, a structure with the symmetric compliance S moves the
    shaft by W S n beside what the pivot deflects, W c n. Across the pad that is

        t . S n = (S_yy - S_xx) / 2 sin 2 phi + S_xy cos 2 phi = -(D / 2) sin 2 (phi - psi),

    two numbers for all pads. Exchanged channels make a similar pattern, but one that no spring can: a spring of this
    size along its own direction would move the shaft further along some pads than it moved.
    """
    off = np.array([record.displacement_direction.angle for record in records])
    elsewhere = any(abs(record.load_direction.angle) > LOAD_LIMIT for record in records)
    if elsewhere or not np.any(np.abs(off) > DISPLACEMENT_LIMIT):
        return ""
    phi = np.array([record.angle for record in records])
    along = np.array([np.polyfit(record.blocks.load, record.blocks.deflection, 1)[0] for record in records])
    if len(set(np.round(phi, 6))) < _FEWEST:
        return ""
    across = along * np.tan(off)
    design = np.column_stack([np.sin(2 * phi), np.cos(2 * phi)])
    p, q = solution = np.linalg.lstsq(design, across, rcond=None)[0]
    compliance, direction = 2.0 * math.hypot(p, q), 0.5 * math.atan2(q, -p)
    pivots = along - compliance * np.cos(phi - direction) ** 2
    left = np.abs(across - design @ solution)
    if np.any(pivots < -_SLACK * along) or np.any(left > math.tan(DISPLACEMENT_LIMIT) * along):
        return ""
    return (
        f"a structure that gives {1e9 * compliance:.2g} nm/N more along {math.degrees(direction):.0f} "
        "deg than across it explains the displacement directions of all dry tests"
    )


def check_placement(records: Sequence[DryRecord]) -> list[Problem]:
    """Where the shaft stood in each run: an absolute check that directions alone cannot make.

    Exchanging two probes mirrors the plane. Along the mirror axis a mirrored movement looks right, but the
    mirrored position does not: with the probes' zero constant within a campaign, the first readings of all
    runs must lie around one centre, each toward its own pad, and none further to the side than a pad's flat
    is wide. Readings set to zero before each run tell no place: they lie no further apart than the pads give.
    """
    alike = defaultdict(list)
    for record in records:  # other probes have another zero
        alike[probes_of(record.run)].append(record)
    problems = []
    for group in alike.values():
        if len({record.pad for record in group}) >= 3:
            problems += _misplaced(group)
    return problems


def _misplaced(records: Sequence[DryRecord]) -> list[Problem]:
    """Runs of one zero, of three pads or more, whose shaft does not start where the others place their pad."""
    starts = []
    for record in records:
        lowest = np.argmin(record.blocks.load)
        starts += [record.blocks.deflection[lowest], record.blocks.across[lowest]]
    axes = np.vstack([pad_axes(record.angle) for record in records])
    outward = np.tile([1.0, 0.0], len(records))
    (_, _, distance), off = common_start(np.column_stack([axes, outward]), np.array(starts))
    toward, beside = (off + distance * outward).reshape(-1, 2).T
    distance = abs(distance)
    if distance <= np.median([np.ptp(record.blocks.deflection) for record in records]):
        return []
    limit = max(_ASIDE * distance, _ASIDE_SPREAD * robust_deviation(beside))
    problems = []
    for record, ahead, aside in zip(records, toward, beside, strict=True):
        near = abs(ahead - distance) <= _ALONG * distance
        if abs(aside) > limit or not near:
            what = (
                f"run {record.run.id}: the shaft stands {1e6 * ahead:.0f} um toward pad {record.pad} and "
                f"{1e6 * aside:+.0f} um beside it, while the other dry runs of this campaign say "
                f"{1e6 * distance:.0f} um toward it: channels exchanged, wrong pad, or probes set anew in between"
            )
            is_certain = not near or abs(aside) >= _FAR_ASIDE * distance
            problems.append(_problem(record, "displacement channels", what, is_certain))
    return problems


def check_spares(records: Sequence[DryRecord], noise: NoiseModel) -> list[Problem]:
    """Whether channels of one plane that are more than two agree, over all runs.

    The noise of the cells' slopes is that across the pads, the probes' what their noise and drift make of a slope.
    """
    errors = {
        "force": [record.load_direction.se for record in records],
        "displacement": [_slope_error(record, noise) for record in records],
    }
    problems = []
    for what in contradictions(records[0].run.channels, [record.slopes for record in records], errors):
        problems += [_problem(record, "channels", what, cure=REMEDY) for record in records]
    return problems


def _slope_error(record: DryRecord, noise: NoiseModel) -> float:
    """Standard error of the slope of a single probe over the deflection, by least squares without any weight."""
    moved = record.blocks.deflection - record.blocks.deflection.mean()
    variance = moved @ record.blocks.covariance(noise) @ moved
    # a component of more than two probes has less noise than each
    probes = len(probes_of(record.run))
    return math.sqrt(variance * max(probes / 2.0, 1.0)) / max(moved @ moved, 1e-300)
