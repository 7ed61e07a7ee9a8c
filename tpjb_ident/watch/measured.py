"""What the records that have landed give already: coefficients, pivots, clearance."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigError
from rigdata.run import Run
from tpjb_ident.clearance.measure import ClearancePolygon, measure_clearance
from tpjb_ident.dynamic.identify import identify
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.run_store import RunStore
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.errors import TpjbError
from tpjb_ident.pivot import PivotSettings, fit_pivots
from tpjb_ident.pivot.curve import PivotCurve

#: A whole identification that took longer [s] is made of the points with news alone.
PATIENCE = 30.0
#: What a record or a campaign that is not complete yet may raise.
REFUSALS = (RigError, TpjbError, np.linalg.LinAlgError)


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
    _seen: dict[str, frozenset[object]] = field(default_factory=dict)
    _last: Measured = field(default_factory=Measured)

    def update(self, campaign: Campaign, marks: dict[str, object]) -> Measured:
        """Results of a campaign of the runs that count."""
        refusals: list[str] = []
        last = self._last
        found = Measured(
            self._identified(campaign, marks, last.identification, refusals),
            self._pivots(campaign, marks, last.curves, refusals),
            self._clearance(campaign, marks, last.polygon, refusals),
        )
        self._last = replace(found, refusals=tuple(refusals))
        return self._last

    def _news(self, part: str, runs: Sequence[Run], marks: dict[str, object]) -> set[str]:
        """Ids of runs that came, changed or went since the last time."""
        now = frozenset((run.id, marks.get(run.id)) for run in runs)
        before = self._seen.get(part, frozenset())
        self._seen[part] = frozenset(now)
        return {str(pair[0]) for pair in now ^ before}  # type: ignore[index]

    def _identified(
        self, campaign: Campaign, marks: dict[str, object], last: Identification | None, refusals: list[str]
    ) -> Identification | None:
        runs = campaign.of_kind("dynamic")
        news = self._news("dynamic", runs, marks)
        if not runs or not news:
            return last if runs else None
        chosen = campaign
        if self._took > PATIENCE and last is not None:
            touched = {run.point for run in runs if run.id in news}
            chosen = replace(
                campaign, runs=tuple(r for r in campaign.runs if r.point in touched or r.kind != "dynamic")
            )
        began = time.monotonic()
        try:
            found = identify(chosen, self.settings, store=self.store)
        except REFUSALS as error:
            refusals.append(f"identification: {error}")
            return last
        if chosen is campaign:
            self._took = time.monotonic() - began
            return found
        return _joined(last, found, {run.point for run in runs})

    def _pivots(
        self, campaign: Campaign, marks: dict[str, object], last: tuple[PivotCurve, ...], refusals: list[str]
    ) -> tuple[PivotCurve, ...]:
        runs = campaign.of_kind("dry_pivot")
        news = self._news("dry_pivot", runs, marks)
        if not runs or not self.pad_angles or not news:
            return last if runs else ()
        try:
            return fit_pivots(campaign, self.pad_angles, PivotSettings(on_refusal="skip"))
        except REFUSALS as error:
            refusals.append(f"pivots: {error}")
            return ()

    def _clearance(
        self, campaign: Campaign, marks: dict[str, object], last: ClearancePolygon | None, refusals: list[str]
    ) -> ClearancePolygon | None:
        runs = campaign.of_kind("clearance")
        news = self._news("clearance", runs, marks)
        if not runs or not self.pad_angles or not news:
            return last if runs else None
        try:
            return measure_clearance(campaign, self.pad_angles)
        except REFUSALS as error:
            refusals.append(f"clearance: {error}")
            return None


def _joined(last: Identification | None, found: Identification, wanted: set[OperatingPoint]) -> Identification:
    """The new points in the place of the old ones of the same set point."""
    if last is None:
        return found
    points = {p.point: p for p in (*last.points, *found.points) if p.point in wanted}
    return replace(found, points=tuple(points[k] for k in sorted(points)))
