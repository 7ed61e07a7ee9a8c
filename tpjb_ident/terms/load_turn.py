"""How the coefficients turn with the static load's direction, learnt from the runs' own misses.

The load's direction misses its set point by some tenths of a degree, differently in every run, and the cells tell by
how much. The cross-coupled coefficients follow it by about the direct stiffness per radian. One point's runs cannot
tell dH / d alpha; those of a campaign together can, since relative to the direct coefficients it depends on load alone,
and weakly::

    dH / d alpha = k (Sk + ln(W / W0) Sk') + i omega c (Sc + ln(W / W0) Sc')

with k, omega c the mean direct coefficients of the point and four real 2 x 2 matrices a load direction and speed.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, entry_forces, film_force_rows
from tpjb_ident.estimate.term import Additive, Parameter, of_groups

#: Plausible of a bearing: relative slope [1/rad], and its change per unit of ln W, one standard deviation.
PLAUSIBLE = (1.5, 0.75)
#: Numbers of a load direction: Sk and Sc, and their change over load.
_SLOPES, _NUMBERS = 8, 16


class LoadTurn(Additive):
    """Sk, Sc, Sk', Sc' of every load direction and speed."""

    name = "load direction"
    always_estimated = True

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        keys = [p.static_key[1:] for p in blocks.points]
        self.families = list(dict.fromkeys(keys))
        self._family = np.array([self.families.index(key) for key in keys])
        self._log_load = np.log(np.maximum([p.static_load for p in blocks.points], 1e-9))
        self._middle = np.array([self._log_load[self._family == k].mean() for k in range(len(self.families))])
        if not np.any(blocks.miss.imag):
            return
        parameters = []
        for direction, *_ in self.families:
            deviations = [PLAUSIBLE[0]] * _SLOPES + [PLAUSIBLE[1]] * (_NUMBERS - _SLOPES)
            parameters += [Parameter(f"{direction:g} deg, {i}", "1/rad", dev) for i, dev in enumerate(deviations)]
        self.parameters = tuple(parameters)

    def per_radian(self, blocks: Blocks, state: State) -> ComplexArray:
        """Readings of a load turned by one radian, (n, m + 2, q)."""
        size, log_load = self.entry_sizes(blocks, state), self._aside(blocks)[:, None]
        force = entry_forces(np.concatenate([size, log_load * size], axis=1), state.u[:, :2])
        rows = film_force_rows(self.rig, blocks, state, force)
        return of_groups(rows, self._family[blocks.point], len(self.families))

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """Readings per unit of every number, each run turned by its own miss."""
        return self.per_radian(blocks, state) * blocks.miss.imag[:, None, None]

    def film_change(self, blocks: Blocks, state: State, value: FloatArray) -> ComplexArray:
        """DH / d alpha times the run's own miss."""
        numbers = value.reshape(len(self.families), 4, 2, 2)[self._family[blocks.point]]
        change = numbers[:, :2] + self._aside(blocks)[:, None, None, None] * numbers[:, 2:]
        stiffness, damping = np.moveaxis(self._direct(blocks, state)[:, :, None, None] * change, 1, 0)
        return np.asarray(blocks.miss.imag[:, None, None] * (stiffness + 1j * damping))

    def entry_sizes(self, blocks: Blocks, state: State) -> ComplexArray:
        """What the entries of k and of omega c are measured by: i for those of damping, (n, 8)."""
        return np.repeat(self._direct(blocks, state) * [1.0, 1j], 4, axis=1)

    def _direct(self, blocks: Blocks, state: State) -> FloatArray:
        """Mean direct coefficients k and omega c of every block's point, (n, 2)."""
        diagonal = state.h[blocks.point][:, [0, 1], [0, 1]]
        return np.stack([np.abs(diagonal.real).mean(axis=1), np.abs(diagonal.imag).mean(axis=1)], axis=1)

    def _aside(self, blocks: Blocks) -> FloatArray:
        """Ln W of every block beside the middle of its family, (n,)."""
        return (self._log_load - self._middle[self._family])[blocks.point]
