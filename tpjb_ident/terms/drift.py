"""Gains of probes that drift from run to run, as of electronics that warm and nobody measures: linear in their order.

Cells that drift alike show as all probes would. So does oil that warms: it moves H, which is then that at the middle of
the runs. A gain that drifts was right when it was calibrated, before or after them: H may be that of either end.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Parameter

#: Drift over half the runs that nobody doubts; that does no harm, of all probes, as by a film that warms, and of one.
_SURE, _TOGETHER, _ALONE = 2e-4, 0.01, 2e-3
#: Deviation of a gain that was right at the first or at the last run, over its drift from the middle to there.
_EITHER_END = 0.75
#: Runs that tell a drift from their scatter, at least.
_LEAST = 6


class Drift(Factor):
    """Logarithm of the probes' gains at the last run against the middle; what drifts is so uncertain throughout."""

    name = "drift"
    contradiction = "probes-drift"
    sentence = "{p.name} read {value:+.2f} % more in the last run than in the middle (standard error {error:.2f} %)"
    scale = 100.0

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        places = {run: k for k, run in enumerate(rig.runs)}
        order = np.array([places.get(run, np.nan) for run in blocks.runs])
        probes = rig.pick("displacement")
        self.sensors = np.zeros((len(rig), 0))
        if len(np.unique(order)) < _LEAST or not np.isfinite(order).all() or not probes:
            return
        self._order = (order - np.ptp(order) / 2 - order.min()) / (np.ptp(order) / 2)
        alone = np.eye(len(rig))[:, probes]
        self.sensors = np.column_stack([alone.sum(axis=1), alone])
        names = ["all probes", *(rig.channels[j].name for j in probes)]
        drifts = [rig.widened.get((self.name, name), 0.0) for name in names]
        self._drifted = np.flatnonzero(drifts)
        harmless = [_TOGETHER] + [_ALONE] * len(probes)
        self.parameters = tuple(Parameter(name, "1", _SURE, harmless=size) for name, size in zip(names, harmless))
        for k in self._drifted:
            self.parameters += (Parameter(f"{names[k]} throughout", "1", _EITHER_END * drifts[k]),)

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """From minus one at the first run to one at the last; one of what is uncertain throughout."""
        order = self._order[blocks.run][:, None, None]
        throughout = np.ones_like(order) * self.sensors[:, self._drifted]
        return np.asarray(np.concatenate([order * self.sensors, throughout], axis=2), complex)
