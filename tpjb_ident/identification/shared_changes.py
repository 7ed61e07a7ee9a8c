"""What points share, sines and bands alike: what every source does to their entries, and the housing's springs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.terms.housing import Housing

#: Terms whose uncertainty scatters with the runs; that of all others is common to the campaign.
RUN_TERMS = ("load miss", "load direction")


@dataclass(frozen=True)
class SharedChanges:
    """Changes of the entries of P points, scaled so that the mean of the rows' products is their covariance."""

    changes: FloatArray = field(repr=False)  #: (q, 8 P), N/m: at least one row
    names: tuple[str, ...] = ()  #: of the sources, term and parameter
    cell_stiffness: tuple[float, float] | None = None  #: N/m: of what the housing stands on, along X and Y

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
        return SharedChanges(rows, names, self.cell_stiffness or other.cell_stiffness)


def shared_changes(solution: Solution, points: Sequence[int]) -> SharedChanges:
    """Changes of some points of a solve by all terms but points' own, and those that scatter from run to run."""
    shared = [(term, parameter) for term in solution.terms if not term.points for parameter in term.parameters]
    rows = [k for k, (term, _) in enumerate(shared) if term.name not in RUN_TERMS]
    names = tuple(f"{shared[k][0].name}: {shared[k][1].name}" for k in rows)
    housing = next((term for term in solution.terms if isinstance(term, Housing)), None)
    springs = None if housing is None else housing.springs(solution.fitted[housing.name])
    if not rows:
        return SharedChanges(np.zeros((1, 8 * len(points))), cell_stiffness=springs)
    factors = solution.factors[np.ix_(rows, points)].reshape(len(rows), -1)
    return SharedChanges(np.asarray(factors * np.sqrt(len(rows))), names, springs)
