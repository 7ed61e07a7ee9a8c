"""How the coefficients turn with the static load's direction, learnt from the runs' own misses.

The load's direction misses its set point by some tenths of a degree, differently in every run, and the cells tell by
how much. The cross-coupled coefficients follow it: kxy changes by about the direct stiffness per radian where the load
is between pads, which is 0.5 % of it for 0.3 degrees, in a few runs that all lean to one side far more than their
scatter shows. One point's runs cannot tell dH/d(direction); those of a campaign together can, since relative to the
direct coefficients it depends on load alone, and weakly::

    dH/d(direction) = k (Sk + ln(W / W0) Sk') + i omega c (Sc + ln(W / W0) Sc')

with k, omega c the mean direct coefficients of the point and four real 2x2 matrices, found by a robust ridge
regression; the ridge is what is plausible of a bearing, so that a short campaign corrects little.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.corrections.static_load import MAX_SIDEWAYS, LoadMiss
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.phasors.line_means import complex_median

#: Plausible relative slope [1/rad] and its change per unit of ln W, one standard deviation.
PLAUSIBLE = (1.5, 0.75)
#: Equations beyond the parameters that a fit needs, for its residuals to say how far it holds.
_SPARE = 4
#: Huber's constant, in standard deviations.
HUBER = 1.345
#: Mean square of normal residuals of unit variance, clipped there.
CLIPPED_SQUARE = 0.7102
_ROUNDS = 20
#: Relative residual below which nothing is told apart: keeps the algebra alive on exact data.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class RunRatios:
    """Force per displacement of a point's runs, one robust mean over each run's windows."""

    shape: ComplexArray  #: (n_runs, 2) complex: displacement of unit length
    force: ComplexArray  #: (n_runs, 2) complex, N/m: oil force that goes with it
    sideways: FloatArray  #: (n_runs,), rad: how far the static load's direction was off
    load: float
    direct: tuple[float, float]
    trusted: bool = True


@dataclass(frozen=True)
class DirectionSensitivity:
    """dH/d(direction) at one point."""

    slope: ComplexArray  #: (2, 2) complex, N/m per rad
    left: FloatArray = field(repr=False)  #: (8, 8), (N/m)^2: covariance that its own uncertainty leaves on H
    #: (8, 8), (N/m per rad)^2: covariance of the slope itself
    doubt: FloatArray = field(repr=False, default_factory=lambda: np.zeros((8, 8)))


def run_ratios(data: PointData, miss: LoadMiss, first: DynamicStiffness, trusted: bool = True) -> RunRatios | None:
    """What a point's runs say; None where they cannot say anything of the direction."""
    if len(data.runs) < 3 or data.point.static_load <= 0 or not np.isfinite(first.direct).all():
        return None
    if np.abs(miss.sideways).max() > MAX_SIDEWAYS:
        return None
    rows = [_ratio(data.D[data.run_index == r], data.F[data.run_index == r]) for r in range(len(data.runs))]
    good = [r for r, row in enumerate(rows) if row is not None]
    if len(good) < 3:
        return None
    shape, force = (np.array([rows[r][part] for r in good]) for part in (0, 1))  # type: ignore[index]
    return RunRatios(shape, force, miss.sideways[good], data.point.static_load, first.direct, trusted)


def _ratio(displacement: ComplexArray, force: ComplexArray) -> tuple[ComplexArray, ComplexArray] | None:
    """One run's shape of motion and the force for it: medians, so that struck windows do not count."""
    good = np.isfinite(displacement).all(axis=1) & np.isfinite(force).all(axis=1)
    d, f = displacement[good], force[good]
    if not len(d):
        return None
    large = int(np.argmax(np.median(np.abs(d), axis=0)))
    if not np.all(np.abs(d[:, large]) > 0):
        return None
    shape = np.ones(2, dtype=complex)
    shape[1 - large] = complex_median(d[:, [1 - large]] / d[:, [large]])[0]
    length = float(np.linalg.norm(shape))
    return np.asarray(shape / length, complex), np.asarray(complex_median(f / d[:, [large]]) / length, complex)


def direction_slopes(
    families: Iterable[tuple[float, ...]], ratios: Sequence[RunRatios | None]
) -> list[DirectionSensitivity | None]:
    """dH/d(direction) at every point of a campaign."""
    members: dict[tuple[float, ...], list[int]] = {}
    for i, (family, ratio) in enumerate(zip(families, ratios, strict=True)):
        if ratio is not None:
            members.setdefault(family, []).append(i)
    out: list[DirectionSensitivity | None] = [None] * len(ratios)
    for places in members.values():
        known = [r for i in places if (r := ratios[i]) is not None]
        for i, turn in zip(places, _family(known), strict=True):
            out[i] = turn
    return out


def _family(ratios: list[RunRatios]) -> Sequence[DirectionSensitivity | None]:
    """Fit one family; the two rows of H are two regressions with one design."""
    middle = float(np.mean([np.log(r.load) for r in ratios]))
    blocks = [_basis(r, np.log(r.load) - middle) for r in ratios]
    parts = [_projected(r, b) for r, b in zip(ratios, blocks, strict=True) if r.trusted]
    if not parts:
        return [None for _ in ratios]
    design, answer = (np.concatenate(part) for part in zip(*parts, strict=True))
    parameters = int(np.count_nonzero(np.abs(design).max(axis=0) > 1e-9 * np.abs(design).max(initial=0.0)))
    if len(answer) < parameters + _SPARE:  # with one load and few directions the runs do not tell
        return [None for _ in ratios]
    fits = [_ridge(design, answer[:, row]) for row in range(2)]
    return [_turn(r, b, fits) for r, b in zip(ratios, blocks, strict=True)]


def _basis(ratio: RunRatios, log_load: float) -> ComplexArray:
    """What a unit of every parameter does to a row of dH/d(direction), (2, 8)."""
    k, c = ratio.direct
    parts = np.array([k, 1j * c, k * log_load, 1j * c * log_load])
    return np.kron(parts[None, :], np.eye(2))


def _projected(ratio: RunRatios, basis: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Design (m, 8) and answers (m, 2) with H itself projected off, relative to the direct coefficients, real."""
    null_space = np.linalg.svd(ratio.shape, full_matrices=True)[0][:, 2:].conj().T
    size = float(np.hypot(*ratio.direct))
    design = null_space @ (ratio.sideways[:, None] * (ratio.shape @ basis)) / size
    answer = null_space @ ratio.force / size
    return np.concatenate([design.real, design.imag]), np.concatenate([answer.real, answer.imag])


def _ridge(design: FloatArray, answer: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Robust ridge regression: parameters (8,) and their covariance (8, 8)."""
    prior = np.diag(1.0 / np.repeat(PLAUSIBLE, 4) ** 2)
    coefficients, covariance = np.zeros(design.shape[1]), np.linalg.inv(prior)
    scale, spent = 1.4826 * float(np.median(np.abs(answer))) + _ROUNDING, 0.0
    for _ in range(_ROUNDS):
        residual = np.abs(answer - design @ coefficients)
        clipped = float(np.sum(np.minimum(residual, HUBER * scale) ** 2))
        # Huber's proposal 2; what the parameters have taken out of the residuals is put back
        scale = math.sqrt(clipped / CLIPPED_SQUARE / max(len(answer) - spent, 1.0)) + _ROUNDING
        weight = np.minimum(1.0, HUBER * scale / np.maximum(residual, 1e-300)) / scale**2
        information = design.T @ (weight[:, None] * design)
        covariance = np.linalg.inv(information + prior)
        coefficients = covariance @ (design.T @ (weight * answer))
        spent = float(np.trace(information @ covariance))
    return coefficients, np.asarray(covariance, dtype=float)


def _turn(ratio: RunRatios, basis: ComplexArray, fits: list[tuple[FloatArray, FloatArray]]) -> DirectionSensitivity:
    # a slope that is off by dS moves H by dS M^T: the misses of the runs, as the fit of H averages them
    mixing = np.linalg.pinv(ratio.shape) @ (ratio.sideways[:, None] * ratio.shape)
    moved = mixing @ basis
    remaining, doubt = np.zeros((8, 8)), np.zeros((8, 8))
    for row, (_, covariance) in enumerate(fits):
        at = [2 * row, 2 * row + 1, 4 + 2 * row, 5 + 2 * row]
        for total, part in ((remaining, moved), (doubt, basis)):
            stacked = np.concatenate([part.real, part.imag])
            total[np.ix_(at, at)] = stacked @ covariance @ stacked.T
    return DirectionSensitivity(np.array([basis @ coefficients for coefficients, _ in fits]), remaining, doubt)


def common_turn(h: ComplexArray, turn: DirectionSensitivity | None, angle: float) -> FloatArray:
    """Covariance (8, 8) of H when the direction of all loads is known to `angle` [rad] only [N^2/m^2].

    Where the runs do not tell how H turns with the load, it is taken to turn with it as a whole: J H - H J.

    `h` (2, 2) [N/m].
    """
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    slope = quarter @ h - h @ quarter if turn is None else turn.slope
    shift = np.concatenate([slope.real.ravel(), slope.imag.ravel()])
    return np.asarray(angle**2 * (np.outer(shift, shift) + (0.0 if turn is None else turn.doubt)))


def turned_back(data: PointData, miss: LoadMiss, turn: DirectionSensitivity | None) -> ComplexArray:
    """Force (n, 2) that a point's windows have because their loads point aside [N]."""
    if turn is None:
        return np.zeros_like(data.F)
    return np.asarray(miss.sideways[data.run_index][:, None] * (data.D @ turn.slope.T))
