"""What every source does to the entries of points: what scatters with the runs, and what points share."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.estimate.solve import Solution

#: Terms whose uncertainty scatters with the runs; that of all others is common to the campaign.
RUN_TERMS = ("load miss", "load direction")


def sources_of(solution: Solution, point: int) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Covariances (8, 8) of a point of a solve by source: what scatters with the runs, and what they share."""
    shares = {name: share[point] for name, share in solution.shares.items() if np.any(share[point])}
    random = {"random": solution.records[point]}
    return random | {name: shares.pop(name) for name in RUN_TERMS if name in shares}, shares


def total(covariances: Iterable[FloatArray]) -> FloatArray:
    """Sum of covariances (8, 8)."""
    return np.sum([np.zeros((8, 8)), *covariances], axis=0)


def shared_changes(
    solution: Solution, points: Sequence[int], more: Mapping[str, FloatArray] | None = None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Changes (q, 8 P) of some points by all terms but points' own, and those that scatter from run to run.

    They are scaled so that the mean of the rows' products is their covariance [N/m]; with the names of the sources.
    `more`: one deviation (P, 8) of further sources by name.
    """
    shared = [(term, parameter) for term in solution.terms if not term.points for parameter in term.parameters]
    rows = [k for k, (term, _) in enumerate(shared) if term.name not in RUN_TERMS]
    further = more or {}
    names = (*(f"{shared[k][0].name}: {shared[k][1].name}" for k in rows), *further)
    if not names:
        return np.zeros((1, 8 * len(points))), names
    factors = np.concatenate([solution.factors[np.ix_(rows, points)], *(f[None] for f in further.values())])
    return np.asarray(factors.reshape(len(names), -1) * np.sqrt(len(names))), names
