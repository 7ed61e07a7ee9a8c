"""Readings of all tests of a pad together, with their noise and the errors that they share: what laws are fitted to."""

import math
import operator
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import linalg, optimize

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.blocks import slid
from tpjb_ident.pivot.dry_record import FRICTION_SE, FRICTION_SHARE, DryRecord
from tpjb_ident.pivot.law_fit import FRICTION, OFFSET, FitData, LawFit, fit_law
from tpjb_ident.pivot.laws import LAWS

REFERENCE_SHARE = 0.4  # reference load of the laws, as a share of the largest load
MODEL_ERROR = 3e-4  # of the deflection: what averaging over a curved law leaves; matters in computed records only
_CREPT = 0.9  # of the creep that was taken off, one standard deviation: that it goes on is likelier than that it ends
UNKNOWN_ZERO = 2.0e-5  # [m], spread of the reading at zero load from run to run of one pad
LAG = 0.002  # [s], by which displacement may lag behind load
_LIGHT = 1e-3  # of the largest load: a lighter one is none
_TIMES = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # the usual share of friction, where the load comes back
#: Share of a difference that a curve must leave for the tests to tell it.
_LEAST_SHARE = 1e-3
#: Fall of the deviance from which tests of one pad differ: one in twenty sets of equal tests shows it.
_CLEAR_SCATTER = 2.7


def fit_data(records: Sequence[DryRecord], noise: NoiseModel) -> FitData:
    """Join the good blocks of one pad's runs; each run has its own drift and its own zero."""
    parts = [record.used for record in records]
    load = np.concatenate([part.load for part in parts])
    deflection = np.concatenate([part.deflection for part in parts])
    branch = np.concatenate([part.branch for part in parts])
    compliance = np.ptp(deflection) / max(np.ptp(load), 1e-300)
    covariances = []
    for record, part in zip(records, parts, strict=True):
        # a ramp's average over a law that bends as W^(2/3) does, most at light loads
        light = np.cbrt(np.maximum(part.load / np.max(load), _LIGHT))
        bend = (part.rate * part.duration) ** 2 / (72.0 * np.max(load) * light**4)
        error = compliance * np.hypot(np.hypot(part.load_spread, LAG * part.rate), bend)
        own = np.diag(error**2 + (MODEL_ERROR * np.ptp(deflection)) ** 2)
        one_level = (part.hold[:, None] == part.hold) & (part.hold >= 0) | np.eye(len(part), dtype=bool)
        zero = UNKNOWN_ZERO**2 if len(records) > 1 else 0.0
        covariances.append(part.covariance(noise) + record.quantisation**2 * one_level + own + zero)
    deflection = deflection - deflection[np.argmin(load)]
    return FitData(
        load=load,
        deflection=deflection,
        branch=branch,
        whitener=np.linalg.inv(np.linalg.cholesky(linalg.block_diag(*covariances))),
        reference_load=REFERENCE_SHARE * np.max(load),
        friction=max((record.friction for record in records), key=operator.itemgetter(1)),
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


def score_of(fit: LawFit, data: FitData, columns: FloatArray | BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes (m, k) of the readings, whitened; what the law cannot take up of them; the residual along that (k,)."""
    reading, jacobian = fit.reading_gradient(data.load, data.branch)
    design, residual = data.whitener @ jacobian, data.whitener @ (data.deflection - reading)
    shift = data.whitener @ columns
    remainder = shift - design @ (fit.covariance @ (design.T @ shift))
    return shift, remainder, residual @ remainder


def with_shared_errors(pads: Sequence[Sequence[DryRecord]], data: Sequence[FitData]) -> tuple[list[FitData], float]:
    """Data of pads with what is off alike in all readings of a test or of a pad.

    Compliance is another one in every test of a pad, by a scatter that all pads' tests tell together; creep that was
    taken off may end with the next step; and the load has a zero that is known so well.
    """
    fits = [fit_law(LAWS["spline"], True, pad) for pad in data]
    runs = []
    for records in pads:
        names = [record.run.id for record in records]  # a slip makes two parts of one
        runs.append(np.repeat([names.index(name) for name in names], [len(record.used) for record in records]))
    # of the curve, not of the readings: these would favour the softer test
    changes = [fit.reading_gradient(pad.load, pad.branch)[0] - fit.theta[OFFSET] for fit, pad in zip(fits, data)]
    scatter = _scatter(fits, data, runs, changes)
    wider = []
    for records, pad, fit, run, change in zip(pads, data, fits, runs, changes, strict=True):
        root, error = np.linalg.inv(pad.whitener), max(record.load_error for record in records)
        more, less = (fit.reading_gradient(pad.load + shift, pad.branch)[0] for shift in (error, -error))
        zero, creep = 0.5 * (more - less), _CREPT * max(record.creep for record in records)
        stiffness = scatter**2 * (run[:, None] == run) + creep**2
        covariance = root @ root.T + stiffness * np.outer(change, change) + np.outer(zero, zero)
        whitener = np.linalg.inv(np.linalg.cholesky(covariance))
        wider.append(replace(pad, whitener=whitener))
    return wider, scatter


def _scatter(
    fits: Sequence[LawFit], data: Sequence[FitData], runs: Sequence[IntArray], changes: Sequence[FloatArray]
) -> float:
    """Scatter of the compliance from test to test of a pad; zero where it may be chance."""
    sizes, squares = [np.zeros(0)], [np.zeros(0)]
    for fit, pad, run, change in zip(fits, data, runs, changes, strict=True):
        columns = (run[:, None] == np.unique(run)) * change[:, None]
        # what all tests have in common is the curve's
        shift, remainder, score = score_of(fit, pad, columns @ linalg.null_space(np.ones((1, columns.shape[1]))))
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
