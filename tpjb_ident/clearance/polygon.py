"""Geometry of the clearance polygon: where its centre lies, and where its corners are.

The sweep gives one distance per pad from the probes' zero. Five distances hold five clearances and two
coordinates of the centre: two too many. A shift of the centre by c changes the clearances by -n_k . c, and
nothing in the polygon tells such a change from real differences between the pads. So the centre is a
convention:

``least-absolute`` (default): the centre that makes the clearances as equal as possible in the sense of the
sum of absolute differences from their common value. A single pad that stands off is then found exactly, and
all of its offset shows on that pad: which is what `physics.md` means by ``pad_offset``. Differences within
the measurement error are averaged.

``least-squares``: the centre of the best-fitting regular polygon. A single pad off by D shows as 0.6 D on
that pad, 0.32 D on the two opposite and -0.12 D on the two beside it (five pads).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigdata.vector import directions
from tpjb_ident.arrays import FloatArray
from tpjb_ident.errors import ArgumentError

CentreRule = Literal["least-absolute", "least-squares"]
EQUAL_WITHIN = 2.0  # standard errors within which clearances count as equal for the least-absolute centre


@dataclass(frozen=True)
class GainRatio:
    """How much more the first probe reads than the second, as the sides of a polygon tell."""

    value: float
    se: float
    turn: float


@dataclass(frozen=True)
class Centre:
    """Centre of a polygon of sides n_k . p = d_k."""

    position: FloatArray
    clearance: float
    gain: FloatArray


def find_centre(
    angles: FloatArray, distances: FloatArray, covariance: FloatArray, rule: CentreRule = "least-absolute"
) -> Centre:
    """Centre of a clearance polygon."""
    design = np.column_stack([directions(angles), np.ones(len(angles))])
    if len(angles) < 3 or np.linalg.cond(design) > 1e3:
        raise ArgumentError(f"a centre needs three pads or more, all around the shaft; got {len(angles)}")
    error = EQUAL_WITHIN * np.sqrt(np.maximum(np.diag(covariance), 1e-20))
    weights = np.ones(len(angles))
    solution: FloatArray = np.zeros(3)
    gain = np.zeros((3, len(angles)), dtype=float)
    for _ in range(1 if rule == "least-squares" else 400):
        gain = np.linalg.solve(design.T @ (design * weights[:, None]), design.T * weights)
        new: FloatArray = np.asarray(gain @ distances, dtype=float)
        moved = float(np.max(np.abs(new - solution)))
        solution = new
        if moved < 1e-12:
            break
        # Huber's weights with the bend at the measurement error: absolute beyond it, square within
        weights = 1.0 / np.maximum(np.abs(distances - design @ solution) / error, 1.0)
    return Centre(solution[:2], float(solution[2]), gain)


def corners(angles: FloatArray, clearances: FloatArray) -> FloatArray:
    """Corners between neighbouring sides."""
    n = directions(angles)
    following = np.roll(n, -1, axis=0)
    systems = np.stack([n, following], axis=1)
    sides = np.stack([clearances, np.roll(clearances, -1)], axis=1)
    return np.asarray(np.linalg.solve(systems, sides[..., None])[..., 0])


def gain_ratio(angles: FloatArray, tilt: FloatArray, tilt_se: FloatArray, axes: tuple[float, float]) -> GainRatio:
    """Fit a common turn and unequal gains to the turns of the sides.

    A probe that reads (1 + g) times the truth stretches the measured plane along its axis. What it does to sizes cannot
    be told from another clearance or another stiffness; what it does to directions can, since the pads' directions are
    known: with b and c the dual pair of that probe (position = .. + b (c . position)), the normal n_k of side k turns
    by

        -g (b . n_k) (n_k x c)

    which no common turn of the frame imitates. A gain that both probes share leaves all directions as they are.
    """
    known = np.isfinite(tilt) & np.isfinite(tilt_se) & (tilt_se > 0)
    rows = np.array([[np.cos(a), np.sin(a)] for a in axes])
    if known.sum() < 4 or abs(np.linalg.det(rows)) < 0.05:
        return GainRatio(np.nan, np.nan, np.nan)
    n = directions(angles)[known]
    own, dual = rows[0], np.linalg.inv(rows)[:, 0]
    shear = -(n @ dual) * (n[:, 0] * own[1] - n[:, 1] * own[0])
    design = np.column_stack([np.ones(len(n)), shear]) / tilt_se[known, None]
    target = tilt[known] / tilt_se[known]
    covariance = np.linalg.inv(design.T @ design)
    turn, value = covariance @ design.T @ target
    chi_square = float(np.sum((target - design @ np.array([turn, value])) ** 2)) / (len(target) - 2)
    return GainRatio(float(value), float(np.sqrt(covariance[1, 1] * max(chi_square, 1.0))), float(turn))
