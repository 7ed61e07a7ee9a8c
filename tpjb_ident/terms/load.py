"""What all static loads miss together, size and turn, in every load direction: no record of a dynamic run tells it."""

from __future__ import annotations

import math

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, entry_forces, film_force_rows
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.estimate.term import Additive, Parameter, of_groups
from tpjb_ident.terms.load_turn import PLAUSIBLE, LoadTurn

#: Entries of k and of omega c.
_ENTRIES = 8
#: Scatter of a run's load against its set point before the runs tell it (relative, and rad), as of usual actuators, and
#: the degrees of freedom that it counts as.
_USUAL, _FREEDOM = 3e-3, 4.0


class Load(Additive):
    """The runs' scatter over the root of their number is how well their mean is known.

    What a common turn does to H is what is plausible: the runs' own misses tell it or not.
    """

    name = "load miss"
    never_estimated = True

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        self.turn = LoadTurn(rig, blocks)
        families = self.turn.families
        self._family = np.array([families.index(p.static_key[1:]) for p in blocks.points])
        if not np.any(np.abs(blocks.miss) > 0):
            return
        parameters = []
        for k, (direction, *_) in enumerate(families):
            mine = self._family[blocks.point] == k
            _, first = np.unique(blocks.run[mine], return_index=True)
            misses = blocks.miss[mine][first]
            size, turn = _mean_error(misses.real), PLAUSIBLE[0] * _mean_error(misses.imag)
            parameters.append(Parameter(f"size at {direction:g} deg", "1", size))
            parameters += [Parameter(f"turn at {direction:g} deg, {i}", "1", turn) for i in range(_ENTRIES)]
        self.parameters = tuple(parameters)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """DH / d ln W d, and the entries of k and omega c by their own size, in the cells."""
        d = state.u[:, :2]
        force = np.einsum("nij,nj->ni", state.slope[blocks.point], d)
        entries = entry_forces(self.turn.entry_sizes(blocks, state), d)
        rows = film_force_rows(self.rig, blocks, state, np.concatenate([force[:, :, None], entries], axis=2))
        return of_groups(rows, self._family[blocks.point], len(self.turn.families))


def _mean_error(misses: FloatArray) -> float:
    """Deviation of what some runs miss together, by how their misses (n,) differ, of few runs by Student's t."""
    n = max(len(misses), 1)
    spare = _FREEDOM + n - 1
    variance = (_FREEDOM * _USUAL**2 + float(np.sum((misses - misses.mean()) ** 2))) / spare
    return math.sqrt(variance / n) * student_widening(spare)
