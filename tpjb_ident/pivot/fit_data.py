"""What a law is fitted to: the blocks of one pad's runs with their covariance, without steps that do not belong.

A slip, a knock, a probe that jumped and came back: each hold is tested as a whole against the most flexible law, with
the noise as it is correlated. Would a shift of this hold alone explain the record better, and by how many standard
errors? The worst goes first, then the remainder is tested again without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.dry_record import DryRecord
from tpjb_ident.pivot.law_fit import FitData, LawFit, fit_law
from tpjb_ident.pivot.laws import LAWS

REFERENCE_SHARE = 0.4  # reference load of the laws, as a share of the largest load
MODEL_ERROR = 3e-4  # of the deflection: what averaging over a curved law leaves; matters in computed records only
UNKNOWN_ZERO = 2.0e-5  # [m], spread of the reading at zero load from run to run of one pad
_MOST_BAD = 0.3  # share of the groups that may be dropped
GROUPS_ON_RAMP = 15
_STICKS_WITHIN = 0.08  # of the load at a reversal: twice the friction of a poor pivot


def fit_data(records: Sequence[DryRecord], noise: NoiseModel, settings: PivotSettings) -> FitData:
    """Join the good blocks of one pad's runs; each run has its own drift and its own zero."""
    parts = [record.blocks.take(record.good) for record in records]
    load = np.concatenate([blocks.load for blocks in parts])
    deflection = np.concatenate([blocks.deflection for blocks in parts])
    branch = np.concatenate([blocks.branch for blocks in parts]).astype(float)
    compliance = float(np.ptp(deflection)) / max(float(np.ptp(load)), 1e-300)
    covariance = np.zeros((len(load), len(load)))
    start = 0
    for record, blocks in zip(records, parts, strict=True):
        part = slice(start, start + len(blocks))
        start += len(blocks)
        covariance[part, part] = noise.covariance(blocks.time, blocks.duration) + np.diag(
            (compliance * blocks.load_spread) ** 2
            + (settings.lag_allowance * compliance * blocks.rate) ** 2
            + (MODEL_ERROR * float(np.ptp(deflection))) ** 2
        )
        one_hold = (blocks.hold[:, None] == blocks.hold[None, :]) & (blocks.hold >= 0)
        covariance[part, part] += record.quantisation**2 * (one_hold | np.eye(len(blocks), dtype=bool))
        if len(records) > 1:
            covariance[part, part] += UNKNOWN_ZERO**2
    both = len(np.unique(branch)) > 1
    return FitData(
        load=load,
        deflection=deflection - deflection[int(np.argmin(load))],
        branch=branch,
        whitener=np.linalg.inv(np.linalg.cholesky(covariance)),
        reference_load=REFERENCE_SHARE * float(np.max(load)),
        friction=(0.0, 0.05) if both else (settings.friction_share, settings.friction_share_se),
    )


def bad_blocks(record: DryRecord, noise: NoiseModel, settings: PivotSettings) -> BoolArray:
    """Blocks (m,) that belong to bad steps, or to a reversal."""
    groups = _groups(record)
    bad = sticking(record.blocks.load, record.blocks.branch)
    for _ in range(int(_MOST_BAD * len(np.unique(groups)))):
        data = fit_data([replace(record, good=~bad)], noise, settings)
        worst, size = _worst(fit_law(LAWS["spline"], True, data), data, groups[~bad])
        if size < settings.bad_hold_limit:
            break
        # a hold goes with the ramps on either side: whatever spoilt it need not have kept to its limits
        bad |= np.abs(groups - worst) <= worst % 2
    return bad


def sticking(load: FloatArray, branch: IntArray) -> BoolArray:
    """Blocks (m,) just after a reversal of the load, where friction holds the pivot and no law applies."""
    stuck = np.zeros(len(load), dtype=bool)
    reversal: float | None = None
    for k in range(1, len(load)):
        if branch[k] != branch[k - 1]:
            reversal = float(load[k - 1])
        if reversal is None:
            continue
        if abs(load[k] - reversal) < _STICKS_WITHIN * abs(reversal):
            stuck[k] = True
        else:
            reversal = None
    return stuck


def _groups(record: DryRecord) -> IntArray:
    """Number (m,) of the stretch that each block belongs to: odd for holds, even for ramps, in order of time."""
    hold = record.blocks.hold
    m = len(hold)
    if not record.holds:
        return np.asarray(2 * (np.arange(m) * GROUPS_ON_RAMP // m))
    before = np.maximum.accumulate(hold)
    return np.asarray(np.where(hold >= 0, 2 * hold + 1, 2 * before + 2))


def _worst(fit: LawFit, data: FitData, groups: IntArray) -> tuple[int, float]:
    """The group (of m) whose shift is most significant, and its size in standard errors."""
    reading, jacobian = fit.reading_gradient(data.load, data.branch)
    residual = data.whitener @ (data.deflection - reading)
    # what the law could take up of a shift is not held against the hold
    scale = np.sqrt(np.diag(fit.covariance))
    design = data.whitener @ (jacobian * scale)
    hat = fit.covariance / np.outer(scale, scale)
    worst, size = -1, 0.0
    for group in np.unique(groups):
        shift = data.whitener @ (groups == group).astype(float)
        absorbed = design.T @ shift
        information = float(shift @ shift - absorbed @ hat @ absorbed)
        if information > 1e-6 * float(shift @ shift):
            statistic = abs(float(shift @ residual - absorbed @ hat @ (design.T @ residual))) / np.sqrt(information)
            if statistic > size:
                worst, size = int(group), statistic
    return worst, size
