"""Priors held against the records: a parameter that is considered stays where the manifest has it, however wrong.

At the solution the scores of a term's parameters say what the records alone, all other parameters as uncertain as they
are stated, would make of them. Their directions that the records tell apart are tested each by itself: two coefficients
that are wrong alike show in their sum, and neither in its own. Where that is further from the means than its error and
what is stated allow, the next solve takes the parameters as uncertain as they are off.

What a wrong parameter does to the runs passes for their scatter, and hides in it. So what is only likely is supposed,
and the solve with it, whose scatter is without it, tells whether it is so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, stdtrit

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.estimate.arrowhead import Step
from tpjb_ident.estimate.equation import Blocks
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.term import Term

#: Errors of what the records say from which it is likely; beyond which it is no chance, of a normal distribution.
LIKELY, _CLEAR = 2.0, 4.5
#: Stated deviations beyond which what is stated is wrong.
_BEYOND = 3.5
#: Information of the records over that of the priors below which it is rounding.
_LEAST = 1e-9
#: What records make of a parameter, at most: units are such that readings change by no more than its size.
_FARTHEST = 0.5

#: How far off parameters are, by term and name.
Distances = dict[tuple[str, str], float]


def clear_limit(scatter: Scatter, blocks: Blocks, spent: int) -> float:
    """Errors beyond which it is no chance, by Student's t of what the runs' scatter is told by.

    `spent`: parameters that were left free beside it. A parameter acts on two components of four. Where no force is
    spare other equations tell, by their noise.
    """
    freedom = float(scatter.spare.sum()) / 2 or 2 * float(np.median(blocks.dof))
    return float(stdtrit(max(freedom - spent, 1.0), ndtr(_CLEAR)))


class Score(NamedTuple):
    """What records say of a term's k parameters in directions of theirs, in deviations as stated."""

    names: list[tuple[str, str]]  #: of the term and the parameters
    stated: FloatArray  #: (k,): their deviations
    directions: FloatArray  #: (k, k), columns
    distance: FloatArray  #: (k,): from the means
    error: FloatArray  #: (k,)

    @staticmethod
    def of(term: Term, chosen: BoolArray, last: Step) -> Score:
        """By the last step, whose shared parameters `chosen` (q,) are the term's."""
        deviation = np.array([parameter.deviation for parameter in term.stated])
        places, stated = np.flatnonzero(chosen)[deviation < np.inf], deviation[deviation < np.inf]
        precision = np.linalg.inv(last.joint_covariance[np.ix_(places, places)]) * np.outer(stated, stated)
        told, directions = np.linalg.eigh(precision - np.diag(last.precision[places] * stated**2))
        told = np.maximum(told, _LEAST)
        distance = directions.T @ precision @ (last.joint[places] / stated) / told
        names = [(term.name, parameter.name) for parameter in term.stated if parameter.deviation < np.inf]
        return Score(names, stated, directions, distance, told**-0.5)

    def off(self, limit: float) -> Distances:
        """How far off the parameters are that contradict what is stated by so many errors."""
        apart = np.abs(self.distance) > np.hypot(limit * self.error, _BEYOND)
        sizes = np.linalg.norm(self.directions * (apart * self.distance), axis=1)
        off = np.minimum(sizes * self.stated, _FARTHEST) * (sizes > 1)
        return {name: size for name, size in zip(self.names, off.tolist()) if size}

    @property
    def clearest(self) -> float:
        """Largest distance over its error."""
        return float(np.abs(self.distance / self.error).max(initial=0.0))
