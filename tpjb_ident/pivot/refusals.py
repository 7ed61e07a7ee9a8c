"""Records that are not what they claim to be: wrong pad, swapped or reversed channels, wrong angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, Severity
from tpjb_ident.phasors.bad_samples import robust_deviation
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.phasors.slow_samples import REMEDY, contradictions
from tpjb_ident.pivot.blocks import PivotSettings, pad_axes
from tpjb_ident.pivot.dry_record import (
    DryRecord,
    PadDirection,
    PickupSignature,
    axial_channels,
    displacement_direction,
    noise_within_holds,
)

_ASIDE = 0.12  # of the clearance: a pad that tilts freely brings the shaft to its pivot's line within some micrometres
_ASIDE_SPREAD = 5.0  # robust standard deviations of the campaign's own runs, where they stand less orderly than that
_FAR_ASIDE = 0.35  # of the clearance, from where it is no wrong number of degrees any more
_FAR_OFF = math.radians(30.0)  # from where a pad leaves no doubt that it is another one's record
_ALONG = 0.5  # of the clearance: pads may differ, but not by this much
_CURE = "Check the run's pad number, the channels' axes, polarities and order, pad angles or static_load_direction"
#: Pads that must be there: two numbers are fitted.
_FEWEST = 4
#: Slack when the spring's own movement is compared with what was read, as a share of it.
_SLACK = 0.1
_MATCHES = 30.0  # chi-square below which two runs show one signature (6 degrees of freedom; by chance above: 4e-5)
_CLEARER = 25.0  # by which a mistake undone must lower it


@dataclass(frozen=True)
class Structure:
    """A compliance [m/N] in one direction [rad] that explains the directions of all dry tests."""

    compliance: float
    direction: float

    def across(self, angle: float) -> float:
        """What it moves a shaft across a pad at an angle [rad], per newton [m/N]."""
        return -0.5 * self.compliance * math.sin(2.0 * (angle - self.direction))

    def along(self, angle: float) -> float:
        """What it moves at least along the pad [m/N]."""
        return self.compliance * math.cos(angle - self.direction) ** 2

    def __str__(self) -> str:
        return (
            f"a structure that gives {1e9 * self.compliance:.2g} nm/N more along {math.degrees(self.direction):.0f} "
            "deg than across it explains the displacement directions of all dry tests"
        )


def refused_records(
    records: Sequence[DryRecord], settings: PivotSettings, pad_angles: FloatArray
) -> tuple[list[DryRecord], list[Problem], NoiseModel]:
    """Records with the directions of their displacements, why some are not what they claim to be, their noise."""
    noise = noise_within_holds(records, settings.drift_rate) if records else NoiseModel(1.0, 1.0, 1.0)
    moved = [displacement_direction(record.blocks, noise, record.quantisation) for record in records]
    records = [replace(record, displacement_direction=way) for record, way in zip(records, moved, strict=True)]
    problems = check_directions(records, settings, pad_angles) + check_pickup(records)
    return records, problems + check_placement(records) + check_spares(records, noise), noise


def check_directions(records: Sequence[DryRecord], settings: PivotSettings, pad_angles: FloatArray) -> list[Problem]:
    """Records whose load or displacement points elsewhere than at their pad; `pad_angles` (n_pads,) [rad] or NaN."""
    structure = structure_of(records, settings)
    problems = []
    for record in records:
        pointing = [("force", record.load_direction, settings.load_angle_limit)]
        if structure is None:
            pointing.append(("displacement", record.displacement_direction, settings.displacement_angle_limit))
        for quantity, direction, limit in pointing:
            if abs(direction.angle) > limit:
                degrees = math.degrees(direction.angle)
                reading = "opposite to" if abs(degrees) > 135.0 else "away from"
                what = (
                    f"run {record.run.id} says pad {record.pad} at {math.degrees(record.angle):g} deg, but its "
                    f"{quantity} grows {degrees:+.1f} deg {reading} that direction "
                    f"(limit {math.degrees(limit):g} deg): {_suspect(record, settings, pad_angles)}"
                )
                severity: Severity = "error" if abs(direction.angle) > _FAR_OFF else "warning"
                problems.append(replace(_problem(record, f"{quantity} channels", what), severity=severity))
                break
    return problems


def _problem(record: DryRecord, place: str, what: str, cure: str = _CURE) -> Problem:
    return Problem("error", record.run.file, place, what, cure, run=record.run.id)


def _suspect(record: DryRecord, settings: PivotSettings, pad_angles: FloatArray) -> str:
    """Which of wrong pad, wrong channel and wrong angle explains both directions."""
    load, moved = record.load_direction.angle, record.displacement_direction.angle
    load_elsewhere = abs(load) > settings.load_angle_limit
    moved_elsewhere = abs(moved) > settings.displacement_angle_limit
    together = abs(math.remainder(load - moved, 2 * math.pi)) < settings.displacement_angle_limit
    if load_elsewhere and together:
        distances = [abs(math.remainder(record.angle + load - angle, 2 * math.pi)) for angle in pad_angles]
        nearest = int(np.argmin(np.nan_to_num(distances, nan=np.inf)))
        if distances[nearest] < settings.load_angle_limit:
            return f"wrong pad: load and displacement both point at pad {nearest + 1}"
        return f"wrong angle: load and displacement turn together by {math.degrees(load):+.0f} deg"
    if load_elsewhere != moved_elsewhere:
        quantity = "force" if load_elsewhere else "displacement"
        return f"wrong channel: the other vector points at the pad, so {quantity} channels are exchanged or reversed"
    return "wrong pad, wrong channel or wrong angle: load and displacement point neither at a pad nor the same way"


def structure_of(records: Sequence[DryRecord], settings: PivotSettings) -> Structure | None:
    """One compliance that explains displacements beyond their limit; None where none is beyond or explains them."""
    limit = settings.displacement_angle_limit
    directions = [record.displacement_direction for record in records]
    if any(abs(record.load_direction.angle) > settings.load_angle_limit for record in records):
        return None
    if not any(abs(direction.angle) > limit for direction in directions):
        return None
    slopes = [float(np.polyfit(record.blocks.load, record.blocks.deflection, 1)[0]) for record in records]
    return structure_behind([record.angle for record in records], slopes, directions, limit)


def structure_behind(
    angles: Sequence[float], slopes: Sequence[float], directions: Sequence[PadDirection], limit: float
) -> Structure | None:
    """Look for one compliance behind displacements that point elsewhere than at their pads.

    Where a pad at phi with normal n is pushed with the load W, a structure with the symmetric compliance S moves the
    shaft by W S n beside what the pivot deflects, W c n. Across the pad that is

        t . S n = (S_yy - S_xx) / 2 sin 2 phi + S_xy cos 2 phi,

    two numbers for all pads. Exchanged channels make a similar pattern, but one that no spring can: a spring of this
    size along its own direction would move the shaft further along some pads than it moved.
    """
    phi, along = np.asarray(angles, float), np.asarray(slopes, float)
    if len(set(np.round(phi, 6))) < _FEWEST or np.any(along <= 0.0):
        return None
    if any(abs(direction.angle) >= 0.5 * math.pi for direction in directions):
        return None
    across = along * np.tan([direction.angle for direction in directions])
    design = np.column_stack([np.sin(2 * phi), np.cos(2 * phi)])
    p, q = np.linalg.lstsq(design, across, rcond=None)[0]
    # t . S n = -(D / 2) sin 2 (phi - psi) = -(D / 2) (sin 2 phi cos 2 psi - cos 2 phi sin 2 psi)
    structure = Structure(2.0 * math.hypot(p, q), 0.5 * math.atan2(q, -p))
    across_residual = across - np.array([structure.across(float(angle)) for angle in phi])
    pivot_alone = along - np.array([structure.along(float(angle)) for angle in phi])
    if np.any(pivot_alone < -_SLACK * along) or np.any(np.abs(across_residual) > math.tan(limit) * along):
        return None
    return structure


def check_placement(records: Sequence[DryRecord]) -> list[Problem]:
    """Where the shaft stood in each run: an absolute check that directions alone cannot make.

    Exchanging two probes mirrors the plane. Along the mirror axis a mirrored movement looks right, but the
    mirrored position does not: with the probes' zero constant within a campaign, the first readings of all
    runs must lie around one centre, each toward its own pad, and none further to the side than a pad's flat
    is wide. Readings set to zero before each run tell no place: they lie no further apart than the pads give.
    """
    problems = []
    for _, alike in groupby(sorted(records, key=_probes), key=_probes):
        problems += _misplaced(list(alike))
    return problems


def _probes(record: DryRecord) -> list[str]:
    """Names of a run's probes: others have another zero."""
    return sorted(name for name, c in axial_channels(record.run).items() if c.quantity == "displacement")


def _misplaced(records: Sequence[DryRecord]) -> list[Problem]:
    if len({record.pad for record in records}) < 3:
        return []
    axes = np.array([pad_axes(record.angle) for record in records])
    outward, tangent = axes[:, 0], axes[:, 1]
    lowest = [int(np.argmin(record.blocks.load)) for record in records]
    places = [(record.blocks.deflection[k], record.blocks.across[k]) for record, k in zip(records, lowest, strict=True)]
    starts = np.einsum("ri,rij->rj", np.array(places), axes)
    centre, distance = _centre(starts, outward)
    if distance <= np.median([np.ptp(record.blocks.deflection) for record in records]):
        return []
    asides = np.sum((starts - centre) * tangent, axis=1)
    limit = max(_ASIDE * distance, _ASIDE_SPREAD * robust_deviation(asides))
    problems = []
    for record, start, normal, aside in zip(records, starts, outward, asides, strict=True):
        along = float((start - centre) @ normal)
        if abs(aside) > limit or abs(along - distance) > _ALONG * distance:
            what = (
                f"run {record.run.id}: the shaft stands {1e6 * along:.0f} um toward pad {record.pad} and "
                f"{1e6 * aside:+.0f} um beside it, while the other dry runs of this campaign say "
                f"{1e6 * distance:.0f} um toward it: channels exchanged or wrong pad"
            )
            problem = _problem(record, "displacement channels", what)
            near = abs(along - distance) < _ALONG * distance and abs(aside) < _FAR_ASIDE * distance
            problems.append(replace(problem, severity="warning" if near else "error"))
    return problems


def _centre(starts: FloatArray, outward: FloatArray) -> tuple[FloatArray, float]:
    """Centre (2,) and distance that most starts (m, 2) agree on: start = centre + distance * outward, robustly."""
    m = len(starts)
    design = np.zeros((2 * m, 3))
    design[0::2, 0] = design[1::2, 1] = 1.0
    design[:, 2] = outward.ravel()
    target = starts.ravel()
    weights = np.ones(m)
    solution = np.zeros(3)
    for _ in range(50):
        root = np.repeat(np.sqrt(weights), 2)
        solution = np.linalg.lstsq(design * root[:, None], target * root, rcond=None)[0]
        miss = np.linalg.norm((target - design @ solution).reshape(m, 2), axis=1)
        # least absolute distance: one run in a wrong place does not move the centre
        weights = 1.0 / np.maximum(miss, 0.02 * max(float(np.median(miss)), 1e-9))
    return solution[:2], abs(float(solution[2]))


def check_spares(records: Sequence[DryRecord], noise: NoiseModel) -> list[Problem]:
    """Whether channels of one plane that are more than two agree, over all runs.

    The noise of the cells' slopes is that across the pads, the probes' what their noise and drift make of a slope.
    """
    errors = {
        "force": [record.load_direction.se for record in records],
        "displacement": [_slope_error(record, noise) for record in records],
    }
    problems = []
    for what in contradictions(records[0].run.channels if records else {}, [r.slopes for r in records], errors):
        problems += [_problem(record, "channels", what, REMEDY) for record in records]
    return problems


def _slope_error(record: DryRecord, noise: NoiseModel) -> float:
    """Standard error of the slope of a single probe over the deflection, by least squares without any weight."""
    moved = record.blocks.deflection - record.blocks.deflection.mean()
    variance = moved @ noise.covariance(record.blocks.time, record.blocks.duration) @ moved
    # a component of more than two probes has less noise than each
    return math.sqrt(variance * max(len(_probes(record)) / 2.0, 1.0)) / max(float(moved @ moved), 1e-300)


def check_pickup(records: Sequence[DryRecord]) -> list[Problem]:
    """Runs whose mains pick-up is that of exchanged or reversed channels, while most other runs agree."""
    pairs: dict[str, list[str]] = {}
    for name, channel in (axial_channels(records[0].run) if records else {}).items():
        pairs.setdefault(str(channel.quantity), []).append(name)
    named = mistakes([record.pickup for record in records], [(p[0], p[1]) for p in pairs.values() if len(p) == 2])
    problems = []
    for record, mistake in zip(records, named, strict=True):
        if mistake is not None:
            text, agree = mistake
            what = (
                f"run {record.run.id}: {text}: then its mains pick-up is that of {agree} other dry "
                "runs, and as it stands it is not: wrong channel"
            )
            problems.append(_problem(record, "channels", what))
    return problems


def mistakes(
    pickups: Sequence[PickupSignature | None], pairs: Sequence[tuple[str, str]]
) -> list[tuple[str, int] | None]:
    """What the signatures say of every run: nothing, or a mistake and how many other runs, most of them, confirm it."""
    return [_mistake(number, pickups, pairs) for number in range(len(pickups))]


def _mistake(
    number: int, pickups: Sequence[PickupSignature | None], pairs: Sequence[tuple[str, str]]
) -> tuple[str, int] | None:
    """The mistake that, undone, makes a run's signature that of most runs it now differs from."""
    signature = pickups[number]
    if signature is None:
        return None
    others = (*pickups[:number], *pickups[number + 1 :])
    comparable = [pickup for pickup in others if pickup is not None and pickup.channels == signature.channels]
    sizes = [(pickup, _mismatch(signature, pickup)) for pickup in comparable]
    different = [(pickup, size) for pickup, size in sizes if size > _MATCHES]
    needed = max(2, math.ceil(len(comparable) / 2))
    if len(different) < needed:
        return None
    likeliest: tuple[str, int] | None = None
    for what, undone in _undone(signature, pairs):
        agree = sum(_mismatch(undone, pickup) < min(_MATCHES, size - _CLEARER) for pickup, size in different)
        if agree >= needed and (likeliest is None or agree > likeliest[1]):
            likeliest = (what, agree)
    return likeliest


def _undone(signature: PickupSignature, pairs: Sequence[tuple[str, str]]) -> list[tuple[str, PickupSignature]]:
    """A run's signature with every simple mistake undone."""
    names, size, noise = signature.channels, signature.size, signature.noise
    variants = []
    for first, second in pairs:
        order = np.arange(len(names))
        order[[names.index(first), names.index(second)]] = names.index(second), names.index(first)
        variants.append((f"{first} and {second} are exchanged", PickupSignature(names, size[order], noise[order])))
    for i, name in enumerate(names):
        turned = np.ones(len(names))
        turned[i] = -1.0
        variants.append((f"{name} is reversed", PickupSignature(names, size * turned, noise)))
    return variants


def _mismatch(a: PickupSignature, b: PickupSignature) -> float:
    """Chi-square of one signature being the other's, times one complex factor."""
    variance = b.noise**2
    for _ in range(3):
        factor = complex(np.vdot(b.size / variance, a.size) / np.vdot(b.size / variance, b.size))
        variance = a.noise**2 + abs(factor) ** 2 * b.noise**2
    return 2.0 * float(np.sum(np.abs(a.size - factor * b.size) ** 2 / variance))
