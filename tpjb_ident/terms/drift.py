"""Gains of probes that drift from run to run, as of electronics that warm and nobody measures: linear in their order.

Cells that drift alike show as all probes would. So does oil that warms: it moves H, which is then that at the middle of
the runs. A gain that drifts was right when it was calibrated, before or after them: H may be that of either end.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import Factor, Parameter

#: Drift over half the runs that nobody doubts; that does no harm, of all probes, as by a film that warms, and of one.
_SURE, _TOGETHER, _ALONE = 1e-5, 0.02, 2e-3
#: Deviation of a gain that was right at the first or at the last run, over its drift from the middle to there.
_EITHER_END = 0.9
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
        self.sensors = np.zeros((len(rig), 0))
        if len(set(blocks.runs)) < _LEAST or not set(blocks.runs) <= set(rig.runs):
            return
        order = np.array([rig.runs.index(run) for run in blocks.runs])
        self._order = np.interp(order, [order.min(), order.max()], [-1.0, 1.0])
        alone = np.eye(len(rig))[:, rig.pick("displacement")]
        self.sensors = np.column_stack([alone.sum(axis=1), alone])
        harmless = {"all probes": _TOGETHER} | {rig.channels[j].name: _ALONE for j in rig.pick("displacement")}
        self.parameters = tuple(Parameter(name, "1", _SURE, harmless=size) for name, size in harmless.items())
        drifts = [rig.widened.get((self.name, name), 0.0) for name in harmless]
        self._drifted = np.flatnonzero(drifts)
        for k in self._drifted:
            name = f"{self.parameters[k].name} throughout"
            self.parameters += (Parameter(name, "1", _EITHER_END * drifts[k]),)

    def exponent(self, blocks: Blocks) -> ComplexArray:
        """From minus one at the first run to one at the last; one of what is uncertain throughout."""
        order = self._order[blocks.run][:, None, None]
        throughout = np.ones_like(order) * self.sensors[:, self._drifted]
        return np.asarray(np.concatenate([order * self.sensors, throughout], axis=2), complex)
