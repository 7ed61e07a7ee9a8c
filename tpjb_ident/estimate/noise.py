"""Covariance of a block's readings: the records' noise, and what differs from run to run beyond it.

A random effect is one pattern c of the readings with a random size of variance s^2, it adds c c^H s^2: the error of a
run's own mean load, a miss of the load where its effect is not known, and the scatter of the force from run to run.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Literal

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.vector import directions
from tpjb_ident.estimate.equation import HOUSING_ROWS, Blocks, Rig, State, adjoint, film_force_rows

#: |d ln h / d ln W| that is taken as plausible where the campaign has one load only.
UNKNOWN_EXPONENT = 0.6
#: Deviation of what a run's miss is: a load that was not met, or as likely cells that read otherwise in that run.
GAIN_OR_LOAD = 0.5
#: |d h / d alpha| over |h| of a load's direction, for the error of a run's own mean load.
_UNKNOWN_TURN = 1.5
#: Noise of the housing's equations over |a|: cells are no perfect springs, a floating stator has stingers.
HOUSING_NOISE = {"cells": 0.03, "floating": 0.05, "unknown": 1e-3}
#: What the usual noise of the housing counts as, in blocks, beside what the campaign's own show.
_HOUSING_BLOCKS = 0.1
#: Noise that readings have at least, of their own size: keeps the algebra alive on computed records.
_LEAST = 1e-7


def unbiased_noise(noise: ComplexArray, freedom: float) -> ComplexArray:
    """A covariance (m, m) of few degrees of freedom, whose inverse would be too large on average, made larger."""
    return noise * max(freedom / max(freedom - len(noise), 1.0), 1.0)


def covariance(rig: Rig, blocks: Blocks, state: State, scatter: FloatArray, housing: float) -> ComplexArray:
    """N of every block, (n, m + 2, m + 2).

    `scatter` (n,): relative variance of the force from run to run; `housing`: noise of its equations over |a|.
    """
    n, m = blocks.z.shape
    N = np.zeros((n, m + HOUSING_ROWS, m + HOUSING_ROWS), complex)
    N[:, :m, :m] = blocks.noise
    acceleration = np.linalg.norm(state.u[:, 2:], axis=1)
    scale = (blocks.omega**2) * np.linalg.norm(state.u[:, :2], axis=1)
    size, accelerometers, diagonal = np.abs(blocks.z), rig.pick("acceleration"), np.arange(m)
    size[:, accelerometers] = np.maximum(size[:, accelerometers], scale[:, None])  # some show rounding alone
    N[:, diagonal, diagonal] += (_LEAST * size) ** 2 + np.where(blocks.present, 0.0, 1.0)
    size = acceleration if rig.mount != "unknown" else scale
    variance = (housing * size) ** 2 + (_LEAST * scale) ** 2 + 1e-30
    N[:, m, m], N[:, m + 1, m + 1] = variance, variance
    patterns = film_force_rows(rig, blocks, state, _force_effects(blocks, state, scatter))
    return N + patterns @ adjoint(patterns)


def housing_noise(rig: Rig, blocks: Blocks, motion: ComplexArray, misfit: ComplexArray) -> float:
    """Noise of the housing's equations over |a|, by what they leave: the usual one counts as a few blocks.

    `motion` (n, 4), `misfit` (n, 2) [m/s^2].
    """
    usual = HOUSING_NOISE[rig.mount]
    size = np.linalg.norm(motion[:, 2:], axis=1)
    if rig.mount == "unknown" or not np.any(size > 0) or not rig.has_acceleration:
        return usual
    rows = rig.pick("acceleration")
    moving = size > 0
    share = np.sum(np.abs(misfit) ** 2, axis=1) / 2
    records = blocks.noise_power(rows) / len(rows)
    beyond = np.maximum(share - records, 0.0)[moving] / size[moving] ** 2
    excess = np.median(beyond) / np.log(2)
    n = len(beyond)
    return float(np.sqrt((_HOUSING_BLOCKS * usual**2 + n * excess) / (_HOUSING_BLOCKS + n)))


def _force_effects(blocks: Blocks, state: State, scatter: FloatArray) -> ComplexArray:
    """Forces (n, 2, k) of one standard deviation of every random effect [N]."""
    h, d = state.h[blocks.point], state.u[:, :2]
    known = state.slope_known[blocks.point]
    slope = np.einsum("nij,nj->ni", state.slope[blocks.point], d)
    largest = np.abs(h).max(axis=(1, 2))[:, None] * d
    effects = [blocks.miss_error[:, None] * slope, (blocks.miss_error * _UNKNOWN_TURN)[:, None] * largest]
    own = np.einsum("nij,nj->ni", h, d)
    unknown = UNKNOWN_EXPONENT * np.where(known, 0.0, np.abs(blocks.miss.real))
    effects.append(unknown[:, None] * own)
    along = directions([point.static_load_direction for point in blocks.points])[blocks.point]
    read = np.sum(along * own, axis=1)[:, None] * along - np.where(known[:, None], slope, 0.0)
    effects.append((GAIN_OR_LOAD * np.abs(blocks.miss.real))[:, None] * read)
    effects += list(scatter_patterns(blocks, state, np.sqrt(scatter)))
    return np.stack(effects, axis=2)


def scatter_patterns(blocks: Blocks, state: State, size: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Forces (n, 2) along X and along Y, `size` (n,) of the film's force each, or (n, 2) [N]."""
    force = np.einsum("nij,nj->ni", state.at_run(blocks), state.u[:, :2])
    length = (size if size.ndim > 1 else size[:, None]) * np.linalg.norm(force, axis=1)[:, None]
    return length * np.array([1.0 + 0j, 0.0]), length * np.array([0.0 + 0j, 1.0])


def slopes_over_load(points: Sequence[OperatingPoint], h: ComplexArray) -> tuple[ComplexArray, BoolArray]:
    """DH / d ln W at every point (P, 2, 2), and whether the campaign tells it (P,); `h` (P, 2, 2), NaN where unknown.

    Entries that keep their sign are power laws between loads. A point whose excitation was run at one load only takes
    the slope of the nearest excitation at its load, stiffness and damping each its own.
    """
    slope = UNKNOWN_EXPONENT * np.nan_to_num(h)
    known = np.zeros(len(points), dtype=bool)
    families = defaultdict(list)
    for i, p in enumerate(points):
        if p.static_load > 0 and np.isfinite(h[i]).all():
            families[p.key[1:]].append(i)
    for members in families.values():
        members.sort(key=lambda i: points[i].static_load)
        log_load = np.log([points[i].static_load for i in members])
        if len(members) > 1 and np.ptp(log_load) > 0:
            values = h[members]
            slope[members] = _log_gradient(values.real, log_load) + 1j * _log_gradient(values.imag, log_load)
            known[members] = True
    donors = np.flatnonzero(known).tolist()
    for i in np.flatnonzero(~known).tolist():
        like = [j for j in donors if points[j].static_key == points[i].static_key]
        if like:
            j = min(like, key=lambda j: abs(points[j].excitation - points[i].excitation))
            slope[i] = slope[j].real + 1j * slope[j].imag * points[i].excitation / points[j].excitation
            known[i] = True
    return slope, known


def _log_gradient(values: FloatArray, log_load: FloatArray) -> FloatArray:
    """Slope over ln W, (k, 2, 2)."""
    order: Literal[1, 2] = 2 if len(log_load) > 2 else 1
    plain = np.gradient(values, log_load, axis=0, edge_order=order)
    one_sign = np.abs(np.sign(values).sum(axis=0)) == len(values)
    logarithm = np.log(np.where(one_sign, np.abs(values), 1.0))
    power = values * np.gradient(logarithm, log_load, axis=0, edge_order=order)
    return np.where(one_sign, power, plain)
