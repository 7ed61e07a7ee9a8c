"""The operating points of a campaign whose phasors are kept: one point's windows in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.dynamic.runs.baseline import Baseline
from tpjb_ident.dynamic.runs.finished_runs import FinishedRuns, RunDigest
from tpjb_ident.dynamic.runs.point_data import PointData, group, point_data


@dataclass(frozen=True)
class PointSource:
    """An operating point, and where its windows are."""

    point: OperatingPoint
    members: tuple[tuple[int, int], ...]
    digests: tuple[RunDigest, ...]
    finished: FinishedRuns = field(repr=False)
    baseline: Baseline = field(default_factory=Baseline)
    _loaded: list[PointData] = field(init=False, default_factory=list, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """For a worker elsewhere: the windows themselves, not where they are."""
        return {**self.__dict__, "finished": None, "_loaded": [self.load()]}

    def load(self) -> PointData:
        """All windows of the point, without the rig's own part.

        They are kept where the runs themselves are in memory.
        """
        if self._loaded:
            return self._loaded[0]
        recorded = point_data(self.point, [(self.finished.take(k), i) for k, i in self.members])
        data = self.baseline.taken_off(recorded)
        if self.finished.all_in_memory:
            self._loaded.append(data)
        return data

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, shape (n_runs, 2) [N]."""
        return np.array([digest.mean_load for digest in self.digests])

    def found(self, condition: str) -> bool:
        """Whether one of the runs carries a condition of this name."""
        return any(condition in digest.conditions for digest in self.digests)


def point_sources(finished: FinishedRuns) -> list[PointSource]:
    """Operating points of all runs kept."""
    digests, places = finished.digests, finished.places
    return [
        PointSource(point, tuple((places[k], i) for k, i in members), tuple(digests[k] for k, _ in members), finished)
        for point, members in group([(digest.point, digest.excitations) for digest in digests])
    ]
