"""How the coefficients turn with the static load's direction, learnt from the runs' own misses.

The load's direction misses its set point by some tenths of a degree, differently in every run, and the cells tell by
how much. The cross-coupled coefficients follow it by about the direct stiffness per radian. One point's runs cannot
tell dH / d alpha; those of a campaign together can, since relative to the direct coefficients it depends on load alone,
and weakly::

    dH / d alpha = k (Sk + ln(W / W0) Sk') + i omega c (Sc + ln(W / W0) Sc')

with k, omega c the mean direct coefficients of the point and four real 2 x 2 matrices a load direction and speed.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.equation import Blocks, Rig, State, entry_changes
from tpjb_ident.estimate.term import FilmTerm, numbered

#: Plausible of a bearing: relative slope [1/rad], and its change per unit of ln W, one standard deviation.
PLAUSIBLE = (1.5, 0.75)


class LoadTurn(FilmTerm):
    """Sk, Sc, Sk', Sc' of every load direction and speed."""

    name = "load direction"
    always_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        keys = [p.static_key[1:] for p in blocks.points]
        self.families = list(dict.fromkeys(keys))
        self.group = np.array([self.families.index(key) for key in keys])
        log_load = np.log(np.maximum([p.static_load for p in blocks.points], 1e-9))
        middle = np.array([log_load[self.group == k].mean() for k in range(len(self.families))])
        self._aside = log_load - middle[self.group]
        aside = [self._aside[self.group == k] for k in range(len(self.families))]
        self.reach = np.array([np.sqrt(np.mean(logarithms**2)) for logarithms in aside])  # of ln W, in every family
        for direction, *_ in self.families if rig.to_set_point and np.any(blocks.miss.imag) else ():
            self.parameters += numbered(f"{direction:g} deg", "1/rad", np.repeat(PLAUSIBLE, NUMBERS).tolist())

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """DH / d alpha, and its change over ln W beside the middle of the family, times the run's own miss."""
        size = blocks.miss.imag[:, None] * self.entry_sizes(blocks, state)
        return entry_changes(np.concatenate([size, self._aside[blocks.point][:, None] * size], axis=1))

    def entry_sizes(self, blocks: Blocks, state: State) -> ComplexArray:
        """Mean direct k and i omega c of every block's point, once for each of their entries, (n, 8)."""
        diagonal = state.h[blocks.point][:, [0, 1], [0, 1]]
        direct = np.stack([np.abs(diagonal.real).mean(axis=1), 1j * np.abs(diagonal.imag).mean(axis=1)], axis=1)
        return np.repeat(direct, 4, axis=1)
