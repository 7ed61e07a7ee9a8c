"""Two clearance polygons of one bearing compared: two push loads, or cold and hot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigdata.vector import directions
from tpjb_ident.arrays import FloatArray
from tpjb_ident.clearance.measure import SAME_WARMTH, ClearancePolygon
from tpjb_ident.errors import ArgumentError
from tpjb_ident.schema import TANGENT

if TYPE_CHECKING:
    import pandas as pd


RISE = 0.2  # of the lighter push load: less tells nothing of the stiffness


@dataclass(frozen=True)
class RadialStiffness:
    """Pivot stiffness from two sweeps with different push loads."""

    load: float
    stiffness: FloatArray
    stiffness_se: FloatArray


def radial_stiffness(light: ClearancePolygon, heavy: ClearancePolygon) -> RadialStiffness:
    """Secant between two push loads of the same bearing in the same condition."""
    rise = heavy.push_load - light.push_load
    if rise <= RISE * light.push_load:
        loads = f"{light.push_load:.0f} and {heavy.push_load:.0f} N"
        raise ArgumentError(f"push loads must differ by a fifth at least, heavy after light; got {loads}")
    # each about its own centre: a zero that wandered between the runs is no give
    give = heavy.clearance_pushed - light.clearance_pushed
    se = np.hypot(heavy.clearance_pushed_se, light.clearance_pushed_se)
    stiffness = rise / give
    load = 0.5 * (heavy.push_load + light.push_load)
    return RadialStiffness(load, np.asarray(stiffness), np.asarray(np.abs(stiffness / give) * se))


@dataclass(frozen=True)
class ClearanceChange:
    """Growth of the clearance from one condition to another."""

    per_pad: FloatArray
    per_pad_se: FloatArray
    mean: float
    mean_se: float
    centre_shift: FloatArray


def clearance_change(before: ClearancePolygon, after: ClearancePolygon) -> ClearanceChange:
    """How much the clearance at zero load changed, as from cold to hot."""
    if before.angles.shape != after.angles.shape or not np.allclose(before.angles, after.angles, atol=1e-6):
        raise ArgumentError("both polygons must be of one bearing: their pad directions differ")
    shift = after.centre - before.centre
    per_pad = after.clearance - before.clearance
    se = np.hypot(before.clearance_se, after.clearance_se)
    known = np.isfinite(per_pad)
    # pads that do not surround the shaft evenly: a shift of the centre must not pass for growth
    design = np.column_stack([np.ones(known.sum()), directions(before.angles[known])])
    mean = np.linalg.lstsq(design, per_pad[known], rcond=None)[0][0]
    mean_se = float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * np.mean(se[known] ** 2)))
    return ClearanceChange(per_pad, se, float(mean), mean_se, shift)


def pairs_frame(base: ClearancePolygon, others: Sequence[ClearancePolygon]) -> pd.DataFrame:
    """Every other polygon against one: `clearance_pairs.csv`, one row per pad."""
    import pandas as pd

    rows = []
    for other in others:
        change = clearance_change(base, other)
        light, heavy = sorted((base, other), key=lambda p: p.push_load)
        same = _same_condition(base, other)
        spring = radial_stiffness(light, heavy) if same and _rises(light, heavy) else None
        for k in range(len(base.angles)):
            row = {
                "run": other.run,
                "against": base.run,
                "compared": "push load" if same else "condition",
                "pad": k + 1,
                "change_m": change.per_pad[k],
                "change_m_se": change.per_pad_se[k],
            }
            if spring is not None:
                row |= {
                    "load_N": spring.load,
                    TANGENT: spring.stiffness[k],
                    f"{TANGENT}_se": spring.stiffness_se[k],
                }
            rows.append(row)
    return pd.DataFrame(rows)


def _same_condition(one: ClearancePolygon, other: ClearancePolygon) -> bool:
    """Whether two sweeps were made at one speed and one temperature (or nobody knows better)."""
    apart = abs(one.temperature - other.temperature)
    return one.point.shaft_speed == other.point.shaft_speed and not apart > SAME_WARMTH


def _rises(light: ClearancePolygon, heavy: ClearancePolygon) -> bool:
    return heavy.push_load - light.push_load > RISE * light.push_load
