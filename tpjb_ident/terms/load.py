"""What all static loads miss together, size and turn, in every load direction: no record of a dynamic run tells it."""

import math
from collections.abc import Mapping

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.equation import Blocks, Rig, State, entry_changes
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.estimate.term import FilmTerm, Fitted, Parameter, numbered
from tpjb_ident.terms.load_turn import PLAUSIBLE, LoadTurn

#: Scatter of a run's load against its set point before the runs tell it (relative, and rad), as of usual actuators, and
#: the degrees of freedom that it counts as.
_USUAL, _FREEDOM = 3e-3, 4.0


class Load(FilmTerm):
    """The runs' scatter over the root of their number is how well their mean is known.

    What a common turn does to H is what is plausible of it, or what the runs' own misses have told of that.
    """

    name = "load miss"
    never_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self.turn = LoadTurn(rig, blocks)
        self.group = self.turn.group
        if not np.any(blocks.miss):
            return
        for k, (direction, *_) in enumerate(self.turn.families):
            mine = self.group[blocks.point] == k
            _, first = np.unique(blocks.run[mine], return_index=True)
            misses = blocks.miss[mine][first]
            size, turn = _mean_error(misses.real), PLAUSIBLE[0] * _mean_error(misses.imag)
            self.parameters += (Parameter(f"size at {direction:g} deg", "1", size),)
            self.parameters += numbered(f"turn at {direction:g} deg", "1", [turn] * NUMBERS)

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """DH / d ln W, and the entries of k and omega c by their own size."""
        entries = entry_changes(self.turn.entry_sizes(blocks, state))
        return np.concatenate([state.slope[blocks.point][:, None], entries], axis=1)

    def learnt_share(self, fitted: Mapping[str, Fitted]) -> FloatArray:
        """How much H turns with the load's direction, over what is plausible: (q,), of the sizes one."""
        known = fitted.get(self.turn.name)
        if known is None:
            return super().learnt_share(fitted)
        mean_square = (known.value**2 + known.deviation**2).reshape(-1, 2, NUMBERS)
        turn = np.sqrt(mean_square[:, 0] + self.turn.reach[:, None] ** 2 * mean_square[:, 1]) / PLAUSIBLE[0]
        return np.concatenate([np.ones((len(turn), 1)), turn], axis=1).ravel()


def _mean_error(misses: FloatArray) -> float:
    """Deviation of what some runs miss together, by how their misses (n,) differ, of few runs by Student's t."""
    n = max(len(misses), 1)
    spare = _FREEDOM + n - 1
    variance = (_FREEDOM * _USUAL**2 + np.sum((misses - misses.mean()) ** 2)) / spare
    return math.sqrt(variance / n) * student_widening(spare)
