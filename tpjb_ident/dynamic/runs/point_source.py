"""The operating points of a campaign, each with its runs and all their windows."""

from __future__ import annotations

from dataclasses import dataclass, field

from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.runs.finished_runs import FinishedRuns, RunDigest
from tpjb_ident.dynamic.runs.point_data import PointData, group, point_data


@dataclass(frozen=True)
class PointSource:
    """An operating point with its runs."""

    data: PointData = field(repr=False)
    digests: tuple[RunDigest, ...]

    @property
    def point(self) -> OperatingPoint:
        """Set point."""
        return self.data.point

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, shape (n_runs, 2) [N]."""
        return self.data.mean_loads

    def found(self, condition: str) -> bool:
        """Whether one of the runs carries a condition of this name."""
        return any(condition in digest.conditions for digest in self.digests)


def point_sources(finished: FinishedRuns) -> list[PointSource]:
    """Operating points of all runs kept."""
    digests = finished.digests
    sources = []
    for point, members in group([(digest.point, digest.excitations) for digest in digests]):
        data = point_data(point, [(digests[k].phasors, i) for k, i in members])
        sources.append(PointSource(data, tuple(digests[k] for k, _ in members)))
    return sources
