r"""The clearance polygon: its sides fitted to a sweep, where its centre lies, and where its corners are.

*Sides.* One average while pad k is touched says

    along = d_k - a_k s + g delta_k(W) + m delta_k(P) [(W/P)^(2/3) - W/P] + n_k . e(t)

with s the place along the side, a_k the angle by which the side is turned, delta_k(W) the pivot's deflection under
the load that the pad carries by its dry curve, and e(t) the noise and drift of the probes, which all pads share.
The push P lies below the loads of the dry tests, so the curve is extrapolated there: g (near 1) and m (free) let
the sweep correct its size and its shape, the same for all pads. Generalised least squares over all averages.

*Centre.* The sweep gives one distance per pad from the probes' zero. Five distances hold five clearances and two
coordinates of the centre: two too many. A shift of the centre by c changes the clearances by -n_k . c, and
nothing in the polygon tells such a change from real differences between the pads. So the centre is a
convention: that of the pads which are alike, by least squares, once the few that most probably stand off are left out.
A single pad that stands off is then found exactly, and all of its offset shows on that pad, which is what `physics.md`
means by ``pad_offset``. (By least squares over all a single pad off by D would show as 0.6 D on that pad, 0.32 D on the
two opposite and -0.12 D on the two beside it, of five.)

Of four pads any one may be the one that stands off, and nothing tells which: the centre is that of least squares, and
its error reaches to every such explanation. Three pads fit any centre: their differences are lost. Of more, all may
stand off by some per cent, as they are made, and of five four lie on one polygon by chance now and then: the doubt of
the centre reaches to that, as far as it is probable next to few pads that stand off.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.vector import directions
from tpjb_ident.clearance.sweep import LARGEST_DEFLECTION, ContactIntervals
from tpjb_ident.errors import ArgumentError
from tpjb_ident.phasors.line_fit import robust_deviation
from tpjb_ident.phasors.slow_noise import NoiseModel, NoiseSeries, estimate_noise
from tpjb_ident.pivot.curve import PivotCurve

#: Deviations of the clearance, as shares: of the few pads that stand off, and of all as they are made, of unknown care.
_FEW, _OFF, _MADE = 3, 0.1, (0.0125, 0.025, 0.05)
#: Error of a side [m], difference of consequence [m], and probability that no 95 % interval has to hold.
_LEAST_ERROR, _NOTABLE, _UNLIKELY = 1e-7, 5e-7, 0.05
TILT_SPREAD = 0.03  # [rad], prior of a side's turn: machining and pad files are never further off unnoticed
_SCALE_SPREAD = 0.05  # prior of g about 1: the dry tests know the pivots better than a sweep of 200 N
_SHAPE_SPREAD = 1.0  # prior of m: from a third power more to a third power less
_CURVATURE_SPREAD = 5.0e-6  # [m], prior of what a third power adds to the deflection, where no curve says it
_AS_DEVIATION = 1 / 1.4  # of an explanation's distance: a standard deviation that holds it in any arrangement
_LAG_ERRORS = 0.03 * np.linspace(-2.5, 2.5, 11)  # [rad] by which the lag may be another than when corners are left
_CLIP = 5.0  # robust standard deviations
_SLIDING = 0.03  # of the deflection: while the shaft slides, its next pad may already carry a little


@dataclass(frozen=True)
class Centre:
    """Centre of a polygon of sides n_k . p = d_k."""

    position: FloatArray  #: (2,) [m]
    clearance: float  #: common to all sides [m]
    gain: FloatArray  #: (3, n) of position and clearance with respect to the distances
    covariance: FloatArray  #: (2, 2) of the position, by explanations that nothing tells apart [m^2]
    suspects: FloatArray  #: (n,) by how much each pad stands off if it alone does; zero where the pads tell [m]
    doubt: FloatArray  #: (2, 2) of the position, where pads differ and none alone explains it [m^2]


def find_centre(angles: FloatArray, distances: FloatArray, covariance: FloatArray, gains: FloatArray) -> Centre:
    """Centre of a clearance polygon: angles (n,) [rad], distances (n,) [m] with covariance (n, n).

    `gains` (n, p): errors of the distances by those of p probes' gains [m].
    """
    design = np.column_stack([directions(angles), np.ones(len(angles))])
    if len(angles) < 3 or np.linalg.cond(design) > 1e3:
        raise ArgumentError(f"a centre needs three pads or more, all around the shaft; got {len(angles)}")
    number, suspects, doubt = len(angles), np.zeros(len(angles)), np.zeros((2, 2))
    gain = even = _gain(design, np.ones(number))
    free = np.eye(number) - design @ even
    apart = free @ distances
    if number == 4:  # any one may be what stands off: each explains all that no centre does
        suspects = apart / np.diag(free)
    elif number > 4:
        off, share = _pads_off(design, distances, even[2] @ distances, covariance + gains @ gains.T)
        gain = _gain(design, np.where(np.isin(np.arange(number), off), 0.0, 1.0))
        moved = (gain - even)[:2] @ distances
        if share > _UNLIKELY and np.linalg.norm(distances - design @ gain @ distances) > _NOTABLE:
            square = (apart @ apart + (np.mean(_MADE) * np.mean(distances)) ** 2) / (number - 3)
            doubt = share * (square * even[:2] @ even[:2].T + np.outer(moved, moved))
    # of pads at right angles two of the four lie along each axis
    shifts = _AS_DEVIATION * gain[:2] * suspects
    position, clearance = np.split(gain @ distances, [2])
    return Centre(position, float(clearance[0]), gain, 0.5 * shifts @ shifts.T, suspects, doubt)


def _pads_off(
    design: FloatArray, distances: FloatArray, clearance: float, covariance: FloatArray
) -> tuple[tuple[int, ...], float]:
    """The few pads that most probably stand off, or none, and how probable it is that all do, as they are made.

    By the part of the distances (n,) that no centre explains, with a covariance (n, n) of measurement.
    """
    number = len(distances)
    free = np.linalg.svd(design)[0][:, 3:]

    def evidence(share: float, pads: Sequence[int]) -> float:
        spread = np.bincount(pads, minlength=number) * (share * clearance) ** 2 + _LEAST_ERROR**2
        normal = stats.multivariate_normal(cov=free.T @ (covariance + np.diag(spread)) @ free)
        return float(normal.logpdf(free.T @ distances))

    few = dict[tuple[int, ...], float]()
    most = min(number - 4, _FEW)
    for count in range(most + 1):
        prior = -np.log(special.comb(number, count) * (most + 1))
        for pads in itertools.combinations(range(number), count):
            few[pads] = prior + evidence(_OFF, pads)
    every = []
    for share in _MADE:
        every.append(evidence(share, range(number)))
    odds = special.logsumexp(every) - np.log(len(every)) - special.logsumexp(list(few.values()))
    return max(few, key=few.__getitem__), float(special.expit(odds))


def _gain(design: FloatArray, weights: FloatArray) -> FloatArray:
    """Solution (3,) of weighted least squares per distance, (3, n)."""
    return np.asarray(np.linalg.solve(design.T @ (design * weights[:, None]), design.T * weights))


def corners(angles: FloatArray, clearances: FloatArray) -> FloatArray:
    """Corners (n, 2) [m] between neighbouring sides: angles (n,) [rad], clearances (n,) [m]."""
    sides = np.column_stack([directions(angles), clearances])
    pairs = np.stack([sides, np.roll(sides, -1, axis=0)], axis=1)
    return np.linalg.solve(pairs[..., :2], pairs[..., 2:])[..., 0]


@dataclass(frozen=True)
class SideFit:
    """The r sides of the pads that a sweep reached, from the probes' zero."""

    pads: IntArray  #: (r,) from 0
    distance: FloatArray  #: (r,) [m]
    covariance: FloatArray  #: (r, r) of the distances [m^2]
    tilt: FloatArray  #: (r,) [rad]
    tilt_se: FloatArray  #: (r,) [rad]
    deflection: FloatArray  #: (r,) of the pivots under the push [m]
    deflection_se: FloatArray  #: (r,) [m]
    scale: float  #: g; NaN without curves
    scale_se: float
    noise: NoiseModel
    misfit: float


def _pivot_deflection(curves: Sequence[PivotCurve], pad: IntArray, load: FloatArray) -> FloatArray:
    """Deflection (m,) [m] of pads (m,) (index from 0) at loads (m,) [N]; of pads without a curve, the mean of all."""
    deflection, load = np.zeros(len(load)), np.maximum(load, 0.0)
    for curve in curves:
        members = pad == curve.pad - 1
        deflection[members] = curve.deflection(load[members])
    others = untested(curves, pad)
    if curves and others.any():
        deflection[others] = np.mean([curve.deflection(load[others]) for curve in curves], axis=0)
    return deflection


def untested(curves: Sequence[PivotCurve], pad: IntArray) -> BoolArray:
    """Which pads (m,) (index from 0) no curve is of, (m,)."""
    return ~np.isin(pad, [curve.pad - 1 for curve in curves])


def fit_sides(contact: ContactIntervals, angles: FloatArray, pads: IntArray, curves: Sequence[PivotCurve]) -> SideFit:
    """Fit the sides of the pads (r,) that a sweep reached: angles (n,) [rad] of all pads."""
    far = np.array([np.quantile(contact.along[contact.pad == k], 0.9) for k in pads])
    frame = np.column_stack([directions(angles[pads]), np.ones(len(pads))])
    foot = np.linalg.lstsq(frame, far, rcond=None)[0][:2]
    place = contact.across - (directions(angles + 0.5 * np.pi) @ foot)[contact.pad]
    usable = np.isin(contact.pad, pads) & _consistent(contact, place)
    used, place = contact.take(usable), place[usable]
    # the noise of the probes as the sweep itself shows it, about smooth sides
    columns, series = (used.time, used.duration, used.along, _smooth_side(used, place)), []
    for pad in np.unique(used.pad):
        series.append(NoiseSeries(*(column[used.pad == pad] for column in columns)))
    noise = estimate_noise(series)
    r, of_pad = len(pads), (used.pad[:, None] == pads).astype(float)
    full = _pivot_deflection(curves, pads, np.full(r, used.push))
    unknown = untested(curves, pads)
    carried = _pivot_deflection(curves, used.pad, used.load)
    alone = used.touched.sum(axis=1) == 1
    # all pads share the two probes; by itself each average is as unsure as a sliding shaft and a converter's step
    normal, same = directions(angles)[used.pad], used.time[:, None] == used.time
    covariance = (normal @ normal.T) * (noise.white * same / used.duration + noise.slow_covariance(used.time))
    unsure = (_SLIDING * carried * alone) ** 2 + used.level_error**2
    covariance += np.diag(1e-9 * np.diag(covariance) + unsure)
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    fits, lag = [], used.lag(angles)
    for error in _LAG_ERRORS:
        late = used.lagging(angles, lag + error)
        late_carried = _pivot_deflection(curves, late.pad, late.load)
        terms, precision, mean = _pivot_terms(late, of_pad, late_carried, full, unknown)
        design = np.hstack([of_pad, -of_pad * place[:, None], terms])
        prior = np.r_[np.zeros(r), np.full(r, TILT_SPREAD**-2), precision]
        fits.append(_least_squares(whitener, used.along, design, prior, np.r_[np.zeros(2 * r), mean]))
    beta, covariance, misfit = _mixed(fits)
    distance, tilt, pivots = np.split(beta, [r, 2 * r])
    _, tilt_se, errors = np.split(np.sqrt(np.diag(covariance)), [r, 2 * r])
    # a shaft that lies in a corner reads one step for long
    distances = covariance[:r, :r] + used.level_error**2 * np.eye(r)
    scale, scale_se = (np.nan, np.nan) if unknown.all() else (float(pivots[-1]), float(errors[-1]))
    deflection, deflection_se = np.nan_to_num(scale) * full, np.zeros(r)
    for curve in curves:  # of the secant at the push
        of_curve = pads == curve.pad - 1
        deflection_se[of_curve] = full[of_curve] * curve.relative_stiffness_se(used.push, secant=True)
    # an error of a curve shifts its side by the share of the deflection that the averages carry on the mean
    mean_carried = of_pad.T @ carried / of_pad.sum(axis=0)
    share = np.divide(mean_carried, full, out=np.zeros(r), where=full > 0)
    distances = distances + np.diag((share * deflection_se) ** 2)
    count = np.count_nonzero(unknown)
    deflection[unknown], deflection_se[unknown] = pivots[:count], errors[:count]
    return SideFit(
        pads, distance, distances, tilt, tilt_se, deflection, deflection_se, scale, scale_se, noise, misfit
    )  # fmt: skip


def _pivot_terms(
    contact: ContactIntervals, of_pad: FloatArray, carried: FloatArray, full: FloatArray, unknown: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the pivots add to the design (m, k), with the precisions and the means (k,) of their prior.

    Without curves every pivot's deflection in proportion to its load, and one curvature for all pads; with them (and
    what they say under the `full` push (r,) [m]) the curves' shape and size, each times one common factor, and the
    deflection of every pad without one (`unknown` (r,)) in the mean shape of the others.
    """
    w = np.maximum(contact.load, 0.0) / contact.push
    bend = np.cbrt(w) ** 2 - w
    spread, mean = np.full(np.count_nonzero(unknown), LARGEST_DEFLECTION), np.zeros(np.count_nonzero(unknown))
    if unknown.all():
        columns = np.column_stack([of_pad * w[:, None], bend])
        return columns, np.r_[spread, _CURVATURE_SPREAD] ** -2, np.r_[mean, 0.0]
    free = of_pad[:, unknown] * carried[:, None] / full[unknown]
    columns = np.column_stack([free, of_pad @ full * bend, of_pad @ ~unknown * carried])
    return columns, np.r_[spread, _SHAPE_SPREAD, _SCALE_SPREAD] ** -2, np.r_[mean, 0.0, 1.0]


def _smooth_side(contact: ContactIntervals, place: FloatArray) -> FloatArray:
    """Columns (m, 4) that span one side: its place, its turn, and any way in which its pivot deflects."""
    load = np.maximum(contact.load, 0.0) / contact.push
    return np.column_stack([np.ones_like(load), np.cbrt(load) ** 2, load, place / 1e-4])


def _consistent(contact: ContactIntervals, place: FloatArray) -> BoolArray:
    """False for averages that do not lie on their side: the shaft was on its way, or a glitch was left."""
    consistent, smooth = np.ones(len(contact.time), dtype=bool), _smooth_side(contact, place)
    for k in np.unique(contact.pad):
        members = contact.pad == k
        design, along = smooth[members], contact.along[members]
        good = np.ones(len(along), dtype=bool)
        for _ in range(8):
            if good.sum() < 8:
                break
            residual = along - design @ np.linalg.lstsq(design[good], along[good], rcond=None)[0]
            residual -= np.median(residual[good])
            # ten nanometres: what 16 bits resolve, so that a noise-free record keeps its averages
            previous, good = good, np.abs(residual) < _CLIP * max(robust_deviation(residual[good]), 1e-8)
            if np.array_equal(previous, good):
                break
        consistent[members] = good
    return consistent


def _least_squares(
    whitener: FloatArray, along: FloatArray, design: FloatArray, prior: FloatArray, mean: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Generalised least squares with a Gaussian prior: values, covariance, sum of squares with the prior's, misfit."""
    unit = np.max(np.abs(design), axis=0)
    x, y = whitener @ (design / unit), whitener @ along
    scaled = prior / unit**2
    covariance = np.linalg.inv(x.T @ x + np.diag(scaled))
    beta = covariance @ (x.T @ y + scaled * mean * unit)
    square = np.sum((y - x @ beta) ** 2)
    total = square + np.sum(scaled * (beta - mean * unit) ** 2)
    return beta / unit, covariance / np.outer(unit, unit), total, square / max(len(y) - design.shape[1], 1)


def _mixed(fits: Sequence[tuple[FloatArray, FloatArray, float, float]]) -> tuple[FloatArray, FloatArray, float]:
    """Values, covariance and misfit of the fits of all lags together, each with its posterior share."""
    betas, covariances, totals, misfits = (np.array(column) for column in zip(*fits, strict=True))
    misfit = np.min(misfits)
    # what the noise model does not explain widens the intervals; a lucky sweep does not narrow them
    wider = max(misfit, 1.0)
    shares = special.softmax(-0.5 * (totals / wider + (_LAG_ERRORS / _LAG_ERRORS[-1] * 2.5) ** 2))
    beta = shares @ betas
    apart = betas - beta
    return beta, wider * np.tensordot(shares, covariances, 1) + (apart.T * shares) @ apart, misfit
