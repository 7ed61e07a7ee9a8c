"""Lines that a point's spectra give, and the bins of each: none belongs to two, so lines err apart from each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra
from tpjb_ident.errors import BadInputError

#: Lines over a band where a record resolves more, and bins that a line takes at least.
_LINES, _BINS = 60, 18
#: Bins that one response is fitted to, about: over so few it is a straight line, and enough are left for the noise.
_GROUP = 12
#: Bins of a line that must be left when those of shaft and mains are gone.
_LEAST_BINS = 12
#: Lines that a band must give.
_LEAST_LINES = 3


@dataclass(frozen=True)
class LinePlan:
    """Groups of bins that belong to each line: one bin of a period, or some neighbouring bins of a whole record."""

    groups: tuple[tuple[IntArray, ...], ...]
    frequencies: FloatArray  #: (n_lines,), Hz
    resolution: float  #: Hz: width of a line

    def bins(self, k: int) -> IntArray:
        """All bins of a line."""
        return np.concatenate(self.groups[k])


def line_plan(spectra: Sequence[RunSpectra]) -> LinePlan:
    """Lines of runs that have the same bins."""
    frequencies = spectra[0].frequencies
    free = ~np.any([s.taken for s in spectra], axis=0)
    period = spectra[0].period
    if period is not None:
        chosen = np.flatnonzero(free)
        return LinePlan(tuple((np.array([k]),) for k in chosen), frequencies[chosen], 1 / period)
    n = len(frequencies)
    width = max(_BINS, math.ceil(n / _LINES))
    count = n // width
    if count < _LEAST_LINES:
        have = 1 / (frequencies[1] - frequencies[0]) if n > 1 else 0.0
        need = have * _LEAST_LINES * _BINS / max(n, 1)
        raise BadInputError(
            f"run {spectra[0].phasors.run}: {have:.3g} s resolve {n} bins of its band, {_LEAST_LINES * _BINS} are "
            f"needed; record {need:.3g} s or excite a wider band"
        )
    lines = [part[free[part]] for part in np.array_split(np.arange(n), count)]
    lines = [part for part in lines if len(part) >= _LEAST_BINS]
    groups = tuple(tuple(np.array_split(part, max(round(len(part) / _GROUP), 1))) for part in lines)
    middles = np.array([0.5 * (frequencies[part[0]] + frequencies[part[-1]]) for part in lines])
    return LinePlan(groups, middles, width * float(frequencies[1] - frequencies[0]))
