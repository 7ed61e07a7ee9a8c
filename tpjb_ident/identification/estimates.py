"""From a solve to H of single points with its uncertainty by source, and what all sources do to points together."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimators.stiffness import DynamicStiffness

#: Terms whose uncertainty scatters with the runs: of points that each have runs of their own.
RUN_TERMS = ("load miss", "load direction")


def estimate_of(
    solution: Solution, point: int, h: ComplexArray, omega: float, method: str, by_run: Sequence[str] = ()
) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
    """H (2, 2) of a point of a solve, and its covariances (8, 8) by source; what scatters `by_run` is random."""
    shared = {name: share[point] for name, share in solution.shares.items() if np.any(share[point])}
    random = {"random": solution.records[point]}
    random |= {name: shared.pop(name) for name in by_run if name in shared}
    covariance, freedom = total(random.values()), solution.freedom(point)
    estimate = DynamicStiffness(
        h, omega, covariance, freedom, method, np.ones((1, 2)), systematic=total(shared.values())
    )
    return estimate, random | shared


def total(covariances: Iterable[FloatArray]) -> FloatArray:
    """Sum of covariances (8, 8)."""
    return np.sum([np.zeros((8, 8)), *covariances], axis=0)


def shared_changes(
    solution: Solution, points: Sequence[int], by_run: Sequence[str] = (), more: Mapping[str, FloatArray] | None = None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Changes (q, 8 P) of some points by all terms but points' own, and those that differ from point to point `by_run`.

    They are scaled so that the mean of the rows' products is their covariance [N/m]; with the names of the sources.
    `more`: one deviation (P, 8) of further sources by name.
    """
    shared = [(term, parameter) for term in solution.terms if not term.points for parameter in term.parameters]
    rows = [k for k, (term, _) in enumerate(shared) if term.name not in by_run]
    further = more or {}
    names = (*(f"{shared[k][0].name}: {shared[k][1].name}" for k in rows), *further)
    if not names:
        return np.zeros((1, 8 * len(points))), names
    factors = np.concatenate([solution.factors[np.ix_(rows, points)], *(f[None] for f in further.values())])
    return factors.reshape(len(names), -1) * np.sqrt(len(names)), names
