"""What every source that points share does to their entries: those of sines and of bands beside each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.estimate.solve import Solution

#: Terms whose uncertainty scatters with the runs; that of all others is common to the campaign.
RUN_TERMS = ("load miss", "load direction")


@dataclass(frozen=True)
class SharedChanges:
    """Changes of the entries of P points, scaled so that the mean of the rows' products is their covariance."""

    changes: FloatArray = field(repr=False)  #: (q, 8 P), N/m: at least one row
    names: tuple[str, ...] = ()  #: of the sources, term and parameter

    def beside(self, other: SharedChanges) -> SharedChanges:
        """Those of two groups of points; sources of one name are one source."""
        names = tuple(dict.fromkeys((*self.names, *other.names)))
        count = max(len(names), 1)
        rows = np.zeros((count, self.changes.shape[1] + other.changes.shape[1]))
        begin = 0
        for group in (self, other):
            end = begin + group.changes.shape[1]
            for name, row in zip(group.names, group.changes):
                rows[names.index(name), begin:end] = row * np.sqrt(count / len(group.names))
            begin = end
        return SharedChanges(rows, names)


def sources_of(solution: Solution, point: int) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Covariances (8, 8) of a point of a solve by source: what scatters with the runs, and what they share."""
    shares = {name: share[point] for name, share in solution.shares.items() if np.any(share[point])}
    random = {"random": solution.records[point]}
    return random | {name: shares.pop(name) for name in RUN_TERMS if name in shares}, shares


def total(covariances: Iterable[FloatArray]) -> FloatArray:
    """Sum of covariances (8, 8)."""
    return np.sum([np.zeros((8, 8)), *covariances], axis=0)


def shared_changes(solution: Solution, points: Sequence[int]) -> SharedChanges:
    """Changes of some points of a solve by all terms but points' own, and those that scatter from run to run."""
    shared = [(term, parameter) for term in solution.terms if not term.points for parameter in term.parameters]
    rows = [k for k, (term, _) in enumerate(shared) if term.name not in RUN_TERMS]
    names = tuple(f"{shared[k][0].name}: {shared[k][1].name}" for k in rows)
    if not rows:
        return SharedChanges(np.zeros((1, 8 * len(points))))
    factors = solution.factors[np.ix_(rows, points)].reshape(len(rows), -1)
    return SharedChanges(np.asarray(factors * np.sqrt(len(rows))), names)
