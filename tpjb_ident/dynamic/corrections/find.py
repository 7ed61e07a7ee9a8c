"""What is put right between phasors and estimate, point by point, and what that leaves uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.corrections.load_direction import (
    DirectionSensitivity,
    common_turn,
    direction_slopes,
    run_ratios,
    turned_back,
)
from tpjb_ident.dynamic.corrections.mains import (
    MAINS_CORRECTED,
    MAINS_ON_LINE,
    MainsFit,
    corrected_condition,
    fit_mains,
    force_pickup,
    mains_pickup,
    relative_scatter,
    with_mains_uncertainty,
    without_mains,
)
from tpjb_ident.dynamic.corrections.static_load import (
    LoadMiss,
    campaign_zero,
    load_conditions,
    load_misses,
    load_slopes,
    to_set_point,
    widened,
)
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.dynamic.runs.point_source import PointSource


@dataclass(frozen=True)
class Correction:
    """Corrections of one operating point."""

    miss: LoadMiss
    slope: ComplexArray | None  #: (2, 2) complex: dH/d(ln W), where the campaign tells it
    turn: DirectionSensitivity | None
    mains: MainsFit | None
    conditions: tuple[Condition, ...]

    def apply(self, data: PointData) -> PointData:
        """The point's windows as they would be at the set point and without mains."""
        cleaned = data if self.mains is None else without_mains(data, self.mains)
        return _at_set_point(cleaned, self.miss, self.slope, self.turn)

    def widened(self, est: DynamicStiffness) -> DynamicStiffness:
        """The estimate with what the corrections leave uncertain."""
        wide = self._load_known(est)
        return wide if self.mains is None else with_mains_uncertainty(wide, self.mains)

    def _load_known(self, est: DynamicStiffness) -> DynamicStiffness:
        wide = widened(est, self.miss, self.slope)
        more = common_turn(est.h, self.turn, self.miss.turn_uncertainty)
        return replace(wide, covariance=wide.covariance + more + (0.0 if self.turn is None else self.turn.left))

    def budget(self, est: DynamicStiffness) -> dict[str, FloatArray]:
        """Random covariance (8, 8) of `widened` by source, from the estimate before it [N^2/m^2]."""
        loaded = self._load_known(est).covariance
        parts = {"random": est.covariance, "load miss": loaded - est.covariance}
        if self.mains is not None:
            parts["mains"] = self.widened(est).covariance - loaded
        return parts

    def measured_only(self) -> Correction:
        """The same findings, nothing corrected."""
        conditions = tuple(c for c in self.conditions if c != MAINS_CORRECTED)
        return replace(self, slope=None, turn=None, mains=None, conditions=conditions)


def find_corrections(
    points: list[PointSource],
    mains_lines: Sequence[ComplexArray | None],
    probe_axes: FloatArray,
    first: list[DynamicStiffness],
    zero_uncertainty: float = 0.0,
    mains_forces: Sequence[ComplexArray | None] = (),
) -> list[Correction]:
    """Work out the corrections of all points of a campaign; `probe_axes` (m,) [rad]."""
    zero = campaign_zero(points, zero_uncertainty)
    misses, common = load_misses(points, zero.force)
    slopes = load_slopes(points, first)
    turns = _turns(points, first, misses, slopes)
    in_cells = force_pickup(mains_forces)
    coincident = [source.found(MAINS_ON_LINE) for source in points]
    pickup = mains_pickup(mains_lines, probe_axes) if any(coincident) else None
    at_set_point = (
        _at_set_point(p.load(), miss, slope, turn)
        for p, miss, slope, turn in zip(points, misses, slopes, turns, strict=True)
    )
    scatter = relative_scatter(at_set_point, first) if pickup is not None else np.nan
    result = []
    for source, miss, slope, turn, hit in zip(points, misses, slopes, turns, coincident, strict=True):
        mains = None
        if hit and pickup is not None:
            data = _at_set_point(source.load(), miss, slope, turn)
            mains = fit_mains(data, pickup, _with_force_pickup(scatter, data, in_cells))
        conditions = load_conditions(miss, common) + zero.conditions()
        if pickup is not None and mains is not None:
            conditions += (corrected_condition(pickup, mains),)
        result.append(Correction(miss, slope, turn, mains, conditions))
    return result


def _with_force_pickup(scatter: float, data: PointData, force: FloatArray) -> float:
    """The runs' relative scatter, with mains in the cells where those are more than that."""
    usual = float(np.nanmedian(np.linalg.norm(data.F, axis=1)))
    share = float(np.linalg.norm(force)) / usual / np.sqrt(2) if usual > 0 else 0.0
    return float(np.hypot(scatter, share)) if share > scatter else scatter


def _turns(
    points: list[PointSource], first: list[DynamicStiffness], misses: list[LoadMiss], slopes: list[ComplexArray | None]
) -> list[DirectionSensitivity | None]:
    """How H turns with the load, from windows whose load's size is put right; what mains struck tells nothing."""
    ratios = [
        run_ratios(to_set_point(source.load(), miss, slope), miss, est, not source.found(MAINS_ON_LINE))
        for source, miss, slope, est in zip(points, misses, slopes, first, strict=True)
    ]
    families = [(p.point.static_load_direction_deg, p.point.shaft_speed_hz) for p in points]
    return direction_slopes(families, ratios)


def _at_set_point(
    data: PointData, miss: LoadMiss, slope: ComplexArray | None, turn: DirectionSensitivity | None
) -> PointData:
    """The point's windows with forces as under the set load in its set direction."""
    return to_set_point(replace(data, F=data.F - turned_back(data, miss, turn)), miss, slope)
