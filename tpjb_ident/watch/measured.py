"""What the records that have landed give already: coefficients, pivots, clearance."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigError
from tpjb_ident.clearance.measure import ClearancePolygon, measure_clearance
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.run_store import RunStore
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.errors import TpjbError
from tpjb_ident.identification.identify import identify
from tpjb_ident.pivot import PivotSettings, fit_pivots
from tpjb_ident.pivot.curve import PivotCurve

#: A whole identification that took longer [s] is made of the points with news alone.
_PATIENCE = 30.0
#: What a record or a campaign that is not complete yet may raise.
_REFUSALS = (RigError, TpjbError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Measured:
    """Results so far."""

    identification: Identification | None = None
    curves: tuple[PivotCurve, ...] = ()
    polygon: ClearancePolygon | None = None
    refusals: tuple[str, ...] = ()

    @property
    def points(self) -> tuple[PointResult, ...]:
        """Operating points with an estimate."""
        return () if self.identification is None else self.identification.points


@dataclass
class Measuring:
    """Makes results of the runs so far, and only what has news."""

    settings: IdentifySettings
    pad_angles: tuple[float, ...] = ()
    store: RunStore | None = None
    _took: float = 0.0
    _observed: dict[str, frozenset[tuple[str, object]]] = field(default_factory=dict)
    _last: Measured = field(default_factory=Measured)

    def update(self, campaign: Campaign, marks: dict[str, object]) -> Measured:
        """Results of a campaign of the runs that count; `marks` by run change with its record."""
        refusals: list[str] = []
        last = self._last
        identification, curves, polygon = self._identify(campaign, marks, refusals), last.curves, last.polygon
        if self.pad_angles and self._news(campaign, "dry_pivot", marks):
            curves = ()
            if campaign.of_kind("dry_pivot"):
                try:
                    curves = fit_pivots(campaign, self.pad_angles, PivotSettings(on_refusal="skip"))
                except _REFUSALS as error:
                    refusals.append(f"pivots: {error}")
        if self.pad_angles and self._news(campaign, "clearance", marks):
            polygon = None
            if campaign.of_kind("clearance"):
                try:
                    polygon = measure_clearance(campaign, self.pad_angles)
                except _REFUSALS as error:
                    refusals.append(f"clearance: {error}")
        self._last = Measured(identification, curves, polygon, tuple(refusals))
        return self._last

    def _news(self, campaign: Campaign, kind: str, marks: dict[str, object]) -> set[str]:
        """Ids of runs of a kind that came, changed or went since the last time."""
        current = frozenset((run.id, marks.get(run.id)) for run in campaign.of_kind(kind))
        before = self._observed.get(kind, frozenset())
        self._observed[kind] = current
        return {run_id for run_id, _ in current ^ before}

    def _identify(self, campaign: Campaign, marks: dict[str, object], refusals: list[str]) -> Identification | None:
        """Coefficients of all points, or of those with news where all would take too long."""
        news, last = self._news(campaign, "dynamic", marks), self._last.identification
        points = {run.point for run in campaign.of_kind("dynamic")}
        if not points or not news:
            return last if points else None
        selected = campaign
        if self._took > _PATIENCE and last is not None:
            changed = {run.point for run in campaign.of_kind("dynamic") if run.id in news}
            runs = [run for run in campaign.runs if run.point in changed or run.kind != "dynamic"]
            selected = replace(campaign, runs=tuple(runs))
        began = time.monotonic()
        try:
            identification = identify(selected, self.settings, store=self.store)
        except _REFUSALS as error:
            refusals.append(f"identification: {error}")
            return last
        if selected is campaign or last is None:
            self._took = time.monotonic() - began
            return identification
        # the new points in the place of the old ones of the same set point
        joined = {p.point: p for p in (*last.points, *identification.points) if p.point in points}
        return replace(identification, points=tuple(joined[point] for point in sorted(joined)))
