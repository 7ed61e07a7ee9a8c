"""Gain of the cells in every run and axis: what all lines of a run share, however many there are.

The film is a little warmer in one run than in another. At a single line that is scatter from run to run; over a band
the lines of a run have it in common, and only its size among the runs tells how far H may be off.
"""

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Fitted, Parameter

#: Degrees of freedom below which the runs tell nothing of their scatter.
_LEAST = 0.5


class RunGain(Factor):
    """Logarithm of the gain of every cell in every run whose gain scatters."""

    name = "run gain"
    always_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        runs, first = np.unique(blocks.run, return_index=True)
        self._first = dict(zip(runs.tolist(), first.tolist()))
        self._places, parameters = [], []
        for r, size in zip(runs.tolist(), blocks.gain_scatter[first].tolist()):
            for j in rig.pick("force") if size > 0 else ():
                self._places.append((r, int(j)))
                parameters.append(Parameter(f"{rig.channels[j].name} in {blocks.runs[r]}", "1", size))
        self.parameters = tuple(parameters)

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """One in the cell's own row, in the blocks of that run."""
        exponent = np.zeros((*blocks.z.shape, len(self._places)), complex)
        for q, (r, j) in enumerate(self._places):
            exponent[:, j, q] = blocks.run == r
        return exponent

    def scatter(self, fitted: Fitted, by_load: FloatArray, usual: tuple[float, float]) -> tuple[float, float]:
        """Standard deviation of the runs' gains by what the records tell of them, and its degrees of freedom.

        `by_load` (n,): deviation that a block's run has for a reason of its own; `usual`: that of a good rig, and the
        degrees of freedom that it counts as.
        """
        prior = np.array([p.deviation for p in self.parameters])
        share = np.clip(1 - (fitted.deviation / prior) ** 2, 0.0, 1.0)
        expected = np.array([by_load[self._first[r]] for r, _ in self._places])
        freedom = share.sum() / len(self.rig.pick("force"))  # a warmer film moves all cells of a run alike
        size, counted = usual
        usual_variance = counted / (counted + freedom) * size**2
        if freedom < _LEAST:
            return size, np.inf
        shown = max(np.sum(fitted.value**2 - share * expected**2) / share.sum(), 0.0)
        return float(np.sqrt(shown + usual_variance)), freedom * (
            (shown + usual_variance) / max(shown, 1e-3 * usual_variance)
        ) ** 2
