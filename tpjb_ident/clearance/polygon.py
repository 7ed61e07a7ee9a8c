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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.vector import directions
from tpjb_ident.clearance.sweep import Touch
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.slow_records.noise import NoiseModel, NoiseSeries, estimate_noise, flicker_kernel

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


DRIFT_RATE = 1.0e-8  # [m/s], centre of the prior
TILT_SPREAD = 0.03  # [rad], prior of a side's turn: machining and pad files are never further off unnoticed
SCALE_SPREAD = 0.05  # prior of g about 1: the dry tests know the pivots better than a sweep of 200 N
SHAPE_SPREAD = 1.0  # prior of m: from a third power more to a third power less
CURVATURE_SPREAD = 5.0e-6  # [m], prior of what a third power adds to the give, where no curve says it
CLIP = 5.0  # robust standard deviations
SLIDING = 0.03  # of the give: while the shaft slides, its next pad may already carry a little


@dataclass(frozen=True)
class SideFit:
    """Sides of a polygon, from the probes' zero."""

    distance: FloatArray
    tilt: FloatArray
    tilt_se: FloatArray
    covariance: FloatArray
    give: FloatArray
    give_se: FloatArray
    scale: float
    scale_se: float
    noise: NoiseModel
    misfit: float


def _known_give(curves: Sequence[PivotCurve], pad: IntArray, load: FloatArray) -> FloatArray:
    """Deflection (m,) [m] of pads (m,) (index from 0) at loads (m,) [N]; zero for pads without a curve."""
    give = np.zeros(len(load))
    for curve in curves:
        mine = pad == curve.pad - 1
        give[mine] = curve.deflection(np.maximum(load[mine], 0.0))
    return give


@dataclass(frozen=True)
class _System:
    """The used averages, whitened together."""

    touch: Touch
    place: FloatArray
    whitener: FloatArray
    pads: IntArray
    count: int
    noise: NoiseModel


def fit_sides(touch: Touch, angles: FloatArray, reached: BoolArray, curves: Sequence[PivotCurve] | None) -> SideFit:
    """Fit all sides of a sweep."""
    place = _place_along_side(touch, angles, reached)
    usable = reached[touch.pad] & _consistent(touch, place)
    used, place = touch.take(usable), place[usable]
    noise = _noise(used, place)
    give = _known_give(curves or (), used.pad, used.load)
    whitener = _whitener(used, angles, noise, SLIDING * give * used.alone)
    system = _System(used, place, whitener, np.flatnonzero(reached), len(angles), noise)
    return _solve_unknown(system) if curves is None else _solve_known(system, curves)


def _place_along_side(touch: Touch, angles: FloatArray, reached: BoolArray) -> FloatArray:
    """Place (m,) on each side, from the foot of the polygon's centre."""
    pads = np.flatnonzero(reached)
    far = np.array([np.quantile(touch.along[touch.pad == k], 0.9) for k in pads])
    design = np.column_stack([directions(angles[pads]), np.ones(len(pads))])
    centre = np.linalg.lstsq(design, far, rcond=None)[0][:2]
    tangents = np.column_stack([-np.sin(angles), np.cos(angles)])
    return np.asarray(touch.across - (tangents @ centre)[touch.pad])


def _smooth_side(load: FloatArray, place: FloatArray) -> FloatArray:
    """Columns (m, 4) that span one side: its place, its turn, and any way in which its pivot gives."""
    return np.column_stack([np.ones_like(load), np.cbrt(load) ** 2, load, place / 1e-4])


def _consistent(touch: Touch, place: FloatArray) -> BoolArray:
    """False for averages that do not lie on their side: the shaft was on its way, or a glitch was left."""
    keep = np.ones(len(touch.time), dtype=bool)
    for k in np.unique(touch.pad):
        mine = np.flatnonzero(touch.pad == k)
        design = _smooth_side(np.maximum(touch.load[mine], 0.0) / touch.push, place[mine])
        good = np.ones(len(mine), dtype=bool)
        for _ in range(8):
            if good.sum() < 8:
                break
            beta = np.linalg.lstsq(design[good], touch.along[mine][good], rcond=None)[0]
            residual = touch.along[mine] - design @ beta
            centre = np.median(residual[good])
            spread = 1.4826 * np.median(np.abs(residual[good] - centre))
            # ten nanometres: what 16 bits resolve, so that a noise-free record keeps its averages
            new = np.abs(residual - centre) < CLIP * max(float(spread), 1e-8)
            if np.array_equal(new, good):
                break
            good = new
        keep[mine] = good
    return keep


def _noise(touch: Touch, place: FloatArray) -> NoiseModel:
    """Noise of the probes as the sweep itself shows it, about smooth sides."""
    series = []
    for k in np.unique(touch.pad):
        mine = touch.pad == k
        mean = _smooth_side(np.maximum(touch.load[mine], 0.0) / touch.push, place[mine])
        series.append(NoiseSeries(touch.time[mine], touch.duration[mine], touch.along[mine], mean))
    return estimate_noise(series, DRIFT_RATE)


def _whitener(touch: Touch, angles: FloatArray, noise: NoiseModel, unsure: FloatArray) -> FloatArray:
    """Inverse Cholesky factor of the covariance of the averages; all pads share the two probes.

    `unsure` (m,) is a standard deviation of each average by itself [m].
    """
    n = directions(angles)[touch.pad]
    centred = touch.time - touch.time.mean()
    same = touch.time[:, None] == touch.time[None, :]
    covariance = (n @ n.T) * (
        noise.white * same / touch.duration
        + noise.flicker * flicker_kernel(touch.time)
        + noise.drift**2 * np.outer(centred, centred)
    )
    covariance[np.diag_indices_from(covariance)] *= 1.0 + 1e-9
    covariance += np.diag(unsure**2)
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _design(system: _System) -> FloatArray:
    """Columns (m, 2 r): distance and turn of every reached side."""
    of_pad = (system.touch.pad[:, None] == system.pads[None, :]).astype(float)
    return np.hstack([of_pad, -of_pad * system.place[:, None]])


def _solve_known(system: _System, curves: Sequence[PivotCurve]) -> SideFit:
    """Sides with the pivots' give from their curves, times one common factor near one."""
    every = np.arange(system.count)
    full = _known_give(curves, every, np.full(system.count, system.touch.push))
    give = _known_give(curves, system.touch.pad, system.touch.load)
    w = np.maximum(system.touch.load, 0.0) / system.touch.push
    shape = full[system.touch.pad] * (np.cbrt(w) ** 2 - w)
    design = np.column_stack([_design(system), shape, give])
    prior, mean = np.zeros(design.shape[1]), np.zeros(design.shape[1])
    prior[-2:] = SHAPE_SPREAD**-2, SCALE_SPREAD**-2
    mean[-1] = 1.0
    beta, covariance, misfit = _least_squares(system, design, prior, mean)
    own = np.zeros(system.count)
    for curve in curves:
        lo, hi = curve.secant_band(system.touch.push, 0.6826895)
        own[curve.pad - 1] = full[curve.pad - 1] * 0.5 * float(np.log(hi / lo))
    part = _part(system, beta, covariance, misfit)
    # an error of a curve shifts its side by the share of the give that the sweep's averages carry on the mean
    carried = np.array([np.mean(give[system.touch.pad == k]) if k in system.pads else 0.0 for k in every])
    share = np.divide(carried, full, out=np.zeros_like(full), where=full > 0)
    return replace(
        part,
        covariance=part.covariance + np.diag((share * own) ** 2),
        give=beta[-1] * full,
        give_se=own,
        scale=float(beta[-1]),
        scale_se=float(np.sqrt(covariance[-1, -1])),
    )


def _solve_unknown(system: _System) -> SideFit:
    """Sides with every pivot's give fitted in proportion to its load, and one curvature for all pads."""
    of_pad = (system.touch.pad[:, None] == system.pads[None, :]).astype(float)
    w = np.maximum(system.touch.load, 0.0) / system.touch.push
    design = np.column_stack([_design(system), of_pad * w[:, None], np.cbrt(w) ** 2 - w])
    prior = np.zeros(design.shape[1])
    prior[-1] = CURVATURE_SPREAD**-2
    beta, covariance, misfit = _least_squares(system, design, prior, np.zeros(design.shape[1]))
    part = _part(system, beta, covariance, misfit)
    r = len(system.pads)
    give, se = np.full(system.count, np.nan), np.full(system.count, np.nan)
    give[system.pads] = beta[2 * r : 3 * r]
    se[system.pads] = np.sqrt(np.diag(covariance)[2 * r : 3 * r])
    return replace(part, give=give, give_se=se)


def _least_squares(
    system: _System, design: FloatArray, prior: FloatArray, mean: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Generalised least squares with a Gaussian prior: values, covariance, whitened misfit."""
    r = len(system.pads)
    prior = prior.copy()
    prior[r : 2 * r] = TILT_SPREAD**-2
    unit = np.max(np.abs(design), axis=0)
    x = system.whitener @ (design / unit)
    y = system.whitener @ system.touch.along
    scaled = np.diag(prior / unit**2)
    covariance = np.linalg.inv(x.T @ x + scaled)
    beta = covariance @ (x.T @ y + scaled @ (mean * unit))
    misfit = float(np.sum((y - x @ beta) ** 2)) / max(len(y) - design.shape[1], 1)
    # what the noise model does not explain widens the intervals; a lucky sweep does not narrow them
    covariance = covariance * max(misfit, 1.0)
    return beta / unit, covariance / np.outer(unit, unit), misfit


def _part(system: _System, beta: FloatArray, covariance: FloatArray, misfit: float) -> SideFit:
    """Distances and turns of all pads, NaN where not reached; without what the pivots give."""
    r, pads = len(system.pads), system.pads
    empty = np.full(system.count, np.nan)
    distance, tilt, tilt_se = empty.copy(), empty.copy(), empty.copy()
    distance[pads] = beta[:r]
    tilt[pads] = beta[r : 2 * r]
    tilt_se[pads] = np.sqrt(np.diag(covariance)[r : 2 * r])
    full = np.full((system.count, system.count), np.nan)
    full[np.ix_(pads, pads)] = covariance[:r, :r]
    return SideFit(distance, tilt, tilt_se, full, empty, empty, np.nan, np.nan, system.noise, misfit)
