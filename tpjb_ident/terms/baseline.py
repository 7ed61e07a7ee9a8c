"""Errors of the dry shaker test that says what the rig carries beside the film: the same in all runs of a frequency."""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, film_force_rows
from tpjb_ident.estimate.shape import complex_matrix
from tpjb_ident.estimate.term import Additive, Parameter


class Baseline(Additive):
    """Eight numbers a frequency of the dry test, in its own standard deviations: a run with oil tells none of them."""

    name = "baseline"
    never_estimated = True

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        if rig.bare.known(blocks.omega).any():
            hertz = rig.bare.omega / (2 * np.pi)
            self.parameters = tuple(Parameter(f"{f:g} Hz, {i}", "1", 1.0) for f in hertz for i in range(NUMBERS))

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """Force of one standard deviation of every number, as cells and housing feel it."""
        bare = self.rig.bare
        # of a computed record the covariance is nothing, and rounding makes that negative
        values, vectors = np.linalg.eigh(bare.covariance)
        changes = complex_matrix((vectors * np.sqrt(np.maximum(values, 0.0))[:, None]).transpose(0, 2, 1))
        force = np.einsum("nf,fkij,nj->nifk", bare.weights(blocks.omega), changes, state.u[:, :2], optimize=True)
        return film_force_rows(self.rig, blocks, state, force.reshape(len(blocks), 2, -1))
