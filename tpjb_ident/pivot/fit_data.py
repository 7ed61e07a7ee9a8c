"""Steps that do not belong to the curve: a slip, a knock, a probe that jumped and came back.

Each hold is tested as a whole against the most flexible law, with the noise as it is correlated: would a
shift of this hold alone explain the record better, and by how many standard errors? The worst goes first,
then the rest are tested again without it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.pivot.blocks import PivotSettings
from tpjb_ident.pivot.dry_record import DryRecord
from tpjb_ident.pivot.law_fit import FitData, LawFit, fit_law
from tpjb_ident.pivot.laws import Law
from tpjb_ident.slow_records.noise import NoiseModel

MakeData = Callable[[Sequence[DryRecord], Sequence[BoolArray], NoiseModel, PivotSettings], FitData]

MOST_BAD = 0.3  # share of the groups that may be dropped
GROUPS_ON_RAMP = 15
STICKS_WITHIN = 0.08  # of the load at a reversal: twice the friction of a poor pivot


def bad_blocks(
    record: DryRecord, noise: NoiseModel, laws: Mapping[str, Law], make_data: MakeData, settings: PivotSettings
) -> BoolArray:
    """Blocks (m,) that belong to bad steps, or to a reversal."""
    groups = _groups(record)
    bad = sticking(record.projection.load, record.blocks.branch)
    for _ in range(int(MOST_BAD * len(np.unique(groups)))):
        data = make_data([record], [~bad], noise, settings)
        worst, size = _worst(fit_law(laws["spline"], True, data), data, groups[~bad])
        if size < settings.bad_hold_limit:
            break
        bad |= _with_ramps(groups, worst)
    return bad


def _with_ramps(groups: IntArray, group: int) -> BoolArray:
    """A group; a hold with the ramps on either side: whatever spoilt it need not have kept to its limits."""
    if group % 2 == 0:
        return np.asarray(groups == group)
    return np.asarray(np.abs(groups - group) <= 1)


def sticking(load: FloatArray, branch: IntArray) -> BoolArray:
    """Blocks (m,) just after a reversal of the load, where friction holds the pivot and no law applies."""
    stuck = np.zeros(len(load), dtype=bool)
    turned_at: float | None = None
    for k in range(1, len(load)):
        if branch[k] != branch[k - 1]:
            turned_at = float(load[k - 1])
        if turned_at is not None:
            if abs(load[k] - turned_at) < STICKS_WITHIN * abs(turned_at):
                stuck[k] = True
            else:
                turned_at = None
    return stuck


def _groups(record: DryRecord) -> IntArray:
    """Number of the stretch that each block belongs to: odd for holds, even for ramps, in order of time."""
    hold = record.blocks.hold
    m = len(hold)
    if not record.holds:
        return np.asarray(2 * (np.arange(m) * GROUPS_ON_RAMP // m))
    before = np.maximum.accumulate(hold)
    return np.asarray(np.where(hold >= 0, 2 * hold + 1, 2 * before + 2))


def _worst(fit: LawFit, data: FitData, groups: IntArray) -> tuple[int, float]:
    """The group whose shift is most significant, and its size in standard errors."""
    reading, jacobian = fit.reading_gradient(data.load, data.branch)
    residual = data.whitener @ (data.deflection - reading)
    # what the law could take up of a shift is not held against the hold
    scale = np.sqrt(np.diag(fit.covariance))
    inside = data.whitener @ (jacobian * scale)
    hat = fit.covariance / np.outer(scale, scale)
    best, size = -1, 0.0
    for group in np.unique(groups):
        shift = data.whitener @ (groups == group).astype(float)
        taken = inside.T @ shift
        room = float(shift @ shift - taken @ hat @ taken)
        if room > 1e-6 * float(shift @ shift):
            statistic = abs(float(shift @ residual - taken @ hat @ (inside.T @ residual))) / np.sqrt(room)
            if statistic > size:
                best, size = int(group), statistic
    return best, size
