"""The operating points of a campaign whose phasors are on a shelf: one point's windows in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.arrays import FloatArray
from tpjb_ident.dynamic.corrections.baseline import Baseline
from tpjb_ident.dynamic.instruments.clock_rates import ClockRates
from tpjb_ident.dynamic.runs.point_data import PointData, group, point_data
from tpjb_ident.dynamic.runs.run_shelf import RunDigest, RunShelf


@dataclass(frozen=True)
class PointSource:
    """An operating point, and where its windows are.

    Attributes
    ----------
    point : OperatingPoint
    members : tuple of (int, int)
        Place on the shelf, and line, of every run.
    digests : tuple of RunDigest
    shelf : RunShelf
    clocks : ClockRates
        By which the channels' clocks differ, once that is known.
    baseline : Baseline
        Of the rig without its bearing, where the campaign measured it.
    """

    point: OperatingPoint
    members: tuple[tuple[int, int], ...]
    digests: tuple[RunDigest, ...]
    shelf: RunShelf = field(repr=False)
    clocks: ClockRates = field(default_factory=ClockRates)
    baseline: Baseline = field(default_factory=Baseline)

    def load(self) -> PointData:
        """All windows of the point, as if one clock had recorded them, and without the rig's own stiffness."""
        recorded = point_data(self.point, [(self.shelf.take(k), i) for k, i in self.members])
        return self.baseline.taken_off(self.clocks.apply(recorded))

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, shape (n_runs, 2) [N]."""
        return np.array([digest.mean_load for digest in self.digests])

    def found(self, condition: str) -> bool:
        """Whether one of the runs carries a condition of this name."""
        return any(condition in digest.conditions for digest in self.digests)


def point_sources(shelf: RunShelf) -> list[PointSource]:
    """Operating points of all runs on a shelf."""
    digests, places = shelf.digests, shelf.places
    return [
        PointSource(point, tuple((places[k], i) for k, i in members), tuple(digests[k] for k, _ in members), shelf)
        for point, members in group([(digest.point, digest.excitations) for digest in digests])
    ]
