"""Records that are not what they claim to be: wrong pad, swapped or reversed channels, wrong angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.dry_record import (
    DryRecord,
    PadDirection,
    axial_channels,
    displacement_direction,
    load_direction,
    mistakes,
    refusal,
)
from tpjb_ident.slow_records.noise import NoiseModel

ASIDE = 0.12  # of the clearance: a pad that tilts freely brings the shaft to its pivot's line within some micrometres
ASIDE_SPREAD = 5.0  # robust standard deviations of the campaign's own runs, where they stand less orderly than that
ALONG = 0.5  # of the clearance: pads may differ, but not by this much
CURE = "Check the run's pad number, the channels' axes, polarities and order, and the pad angles of the bearing file"
#: Pads that must be there: two numbers are fitted.
FEWEST = 4
#: Slack when the spring's own movement is compared with what was read, as a share of it.
SLACK = 0.1


@dataclass(frozen=True)
class Structure:
    """A compliance that explains the directions of all dry tests."""

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


def check_directions(
    record: DryRecord,
    noise: NoiseModel,
    settings: PivotSettings,
    pad_angles: FloatArray,
    structure: Structure | None = None,
) -> tuple[PadDirection, PadDirection]:
    """Directions of load and displacement, or a refusal."""
    load = load_direction(record.projection, record.blocks)
    displacement = displacement_direction(record.projection, record.blocks, noise)
    for quantity, found, limit in (
        ("force", load, settings.load_angle_limit),
        ("displacement", displacement, settings.displacement_angle_limit),
    ):
        if quantity == "displacement" and structure is not None:
            continue
        if abs(found.angle) > limit:
            guess = _suspect(record, load, displacement, settings, pad_angles)
            raise _elsewhere(record, quantity, found, limit, guess)
    return load, displacement


def structure_of(records: Sequence[DryRecord], noise: NoiseModel, settings: PivotSettings) -> Structure | None:
    """One compliance that explains displacements beyond their limit.

    None where none is beyond, or none explains them.
    """
    moved = [displacement_direction(r.projection, r.blocks, noise) for r in records]
    loads = [load_direction(r.projection, r.blocks) for r in records]
    if any(abs(d.angle) > settings.load_angle_limit for d in loads):
        return None
    if not any(abs(d.angle) > settings.displacement_angle_limit for d in moved):
        return None
    slopes = [float(np.polyfit(r.projection.load, r.projection.deflection, 1)[0]) for r in records]
    return structure_behind([r.angle for r in records], slopes, moved, settings.displacement_angle_limit)


def _elsewhere(record: DryRecord, quantity: str, direction: PadDirection, limit: float, guess: str) -> RigDataError:
    degrees = math.degrees(direction.angle)
    reading = "opposite to" if abs(degrees) > 135.0 else "away from"
    what = (
        f"says pad {record.pad} at {math.degrees(record.angle):g} deg, but its {quantity} grows {degrees:+.1f} deg "
        f"{reading} that direction (limit {math.degrees(limit):g} deg): {guess}"
    )
    return refusal(record.run, f"{quantity} channels", what, CURE)


def _suspect(
    record: DryRecord, load: PadDirection, displacement: PadDirection, settings: PivotSettings, pad_angles: FloatArray
) -> str:
    """Which of wrong pad, wrong channel and wrong angle explains both directions."""
    off_load = abs(load.angle) > settings.load_angle_limit
    off_move = abs(displacement.angle) > settings.displacement_angle_limit
    together = abs(math.remainder(load.angle - displacement.angle, 2 * math.pi)) < settings.displacement_angle_limit
    if off_load and together:
        turned = [abs(math.remainder(record.angle + load.angle - a, 2 * math.pi)) for a in pad_angles]
        nearest = int(np.argmin(turned))
        if turned[nearest] < settings.load_angle_limit:
            return f"wrong pad: load and displacement both point at pad {nearest + 1}"
        return f"wrong angle: load and displacement turn together by {math.degrees(load.angle):+.0f} deg"
    if off_load != off_move:
        which = "force" if off_load else "displacement"
        return f"wrong channel: the other vector points at the pad, so {which} channels are exchanged or reversed"
    return "wrong pad, wrong channel or wrong angle: load and displacement point neither at a pad nor the same way"


def check_placement(records: Sequence[DryRecord]) -> list[Problem]:
    """Where the shaft stood in each run: an absolute check that directions alone cannot make.

    Exchanging two probes mirrors the plane. Along the mirror axis a mirrored movement looks right, but the
    mirrored position does not: with the probes' zero constant within a campaign, the first readings of all
    runs must lie around one centre, each toward its own pad, and none further to the side than a pad's flat
    is wide.
    """
    if len({record.pad for record in records}) < 3:
        return []
    starts = np.array([record.blocks.displacement[int(np.argmin(record.projection.load))] for record in records])
    outward = np.array([[math.cos(r.angle), math.sin(r.angle)] for r in records])
    centre, reach = _centre(starts, outward)
    tangent = np.column_stack([-outward[:, 1], outward[:, 0]])
    asides = np.sum((starts - centre) * tangent, axis=1)
    limit = max(ASIDE * reach, ASIDE_SPREAD * 1.4826 * float(np.median(np.abs(asides))))
    problems = []
    for record, start, normal, aside in zip(records, starts, outward, asides, strict=True):
        along = float((start - centre) @ normal)
        if abs(aside) > limit or abs(along - reach) > ALONG * reach:
            what = (
                f"run {record.run.id}: the shaft stands {1e6 * along:.0f} um toward pad {record.pad} and "
                f"{1e6 * aside:+.0f} um beside it, while the other dry runs of this campaign say "
                f"{1e6 * reach:.0f} um toward it: channels exchanged or wrong pad"
            )
            problems.append(Problem("error", record.run.file, "displacement channels", what, CURE, run=record.run.id))
    return problems


def check_pickup(records: Sequence[DryRecord]) -> list[Problem]:
    """Runs whose mains pick-up is that of exchanged or reversed channels.

    While the other runs agree with each other.
    """
    pairs: dict[str, list[str]] = {}
    for name, channel in (axial_channels(records[0].run) if records else {}).items():
        pairs.setdefault(str(channel.quantity), []).append(name)
    found = mistakes([r.pickup for r in records], [(p[0], p[1]) for p in pairs.values() if len(p) == 2])
    problems = []
    for record, mistake in zip(records, found, strict=True):
        if mistake is not None:
            what = (
                f"run {record.run.id}: {mistake.what}: then its mains pick-up is that of {mistake.agree} other dry "
                "runs, and as it stands it is not: wrong channel"
            )
            problems.append(Problem("error", record.run.file, "channels", what, CURE, run=record.run.id))
    return problems


def _centre(starts: np.ndarray, outward: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (2,) and distance that most starts agree on: start = centre + distance * outward, robustly."""
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


def structure_behind(
    angles: Sequence[float], slopes: Sequence[float], moved: Sequence[PadDirection], limit: float
) -> Structure | None:
    """Look for one compliance behind displacements that point elsewhere than at their pads.

    Where a pad at phi with normal n is pushed with the load W, a structure with the symmetric compliance S moves the
    shaft by W S n beside what the pivot gives, W c n. Across the pad that is

        t . S n = (S_yy - S_xx) / 2 sin 2 phi + S_xy cos 2 phi,

    two numbers for all pads. Exchanged channels make a similar pattern, but one that no spring can: a spring of this
    size along its own direction would move the shaft further along some pads than it moved.
    """
    phi, along = np.asarray(angles, float), np.asarray(slopes, float)
    if len(set(np.round(phi, 6))) < FEWEST or np.any(along <= 0.0):
        return None
    if any(abs(d.angle) >= 0.5 * math.pi for d in moved):
        return None
    across = along * np.tan([d.angle for d in moved])
    design = np.column_stack([np.sin(2 * phi), np.cos(2 * phi)])
    p, q = np.linalg.lstsq(design, across, rcond=None)[0]
    # t . S n = -(D / 2) sin 2 (phi - psi) = -(D / 2) (sin 2 phi cos 2 psi - cos 2 phi sin 2 psi)
    found = Structure(2.0 * math.hypot(p, q), 0.5 * math.atan2(q, -p))
    left = np.array([a - found.across(float(f)) for f, a in zip(phi, across, strict=True)])
    own = np.array([a - found.along(float(f)) for f, a in zip(phi, along, strict=True)])
    if np.any(own < -SLACK * along) or np.any(np.abs(left) > math.tan(limit) * along):
        return None
    return found
