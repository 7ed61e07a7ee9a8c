"""What all static loads miss together, size and turn, in every load direction: no record of a dynamic run tells it."""

from __future__ import annotations

import math

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, film_force_rows
from tpjb_ident.estimate.term import Additive, Parameter, of_groups
from tpjb_ident.terms.load_turn import LoadTurn

#: Least standard deviation of a run's load against its set point: actuators are no better (relative, and rad).
_LEAST = 1e-4


class Load(Additive):
    """The runs' scatter over the root of their number is how well their mean is known."""

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
            root = math.sqrt(max(len(misses), 1))
            for part, values in (("size", misses.real), ("turn", misses.imag)):
                deviation = max(float(np.sqrt(np.mean(values**2))), _LEAST) / root
                parameters.append(Parameter(f"{part} at {direction:g} deg", "1", deviation))
        self.parameters = tuple(parameters)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """DH / d ln W d, and dH / d alpha d, in the cells."""
        d = state.u[:, :2]
        force = np.einsum("nij,nj->ni", state.slope[blocks.point], d)
        size = film_force_rows(self.rig, blocks, state, force[:, :, None])[:, :, 0]
        numbers = state.parameters.get(self.turn.name)
        turn = self.turn.turned(blocks, state, numbers) if numbers is not None and len(numbers) else 0 * size
        rows = np.stack([size, turn], axis=2)
        return of_groups(rows, self._family[blocks.point], len(self.turn.families))
