"""Errors of the dry shaker test that says what the rig carries beside the film: the same in all runs of a frequency."""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.arrowhead import NUMBERS, complex_matrix
from tpjb_ident.estimate.equation import Blocks, Rig, State
from tpjb_ident.estimate.term import FilmTerm, numbered


class Baseline(FilmTerm):
    """Eight numbers a frequency of the dry test, in its own standard deviations: a run with oil tells none of them."""

    name = "baseline"
    never_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self.group = np.zeros(len(blocks.points), dtype=np.intp)
        for omega in rig.bare.omega if rig.bare.known(blocks.omega).any() else ():
            self.parameters += numbered(f"{omega / (2 * np.pi):g} Hz", "1", [1.0] * NUMBERS)

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """One standard deviation of every number."""
        bare = self.rig.bare
        # of a computed record the covariance is nothing, and rounding makes that negative
        values, vectors = np.linalg.eigh(bare.covariance)
        changes = complex_matrix((vectors * np.sqrt(np.maximum(values, 0.0))[:, None]).transpose(0, 2, 1))
        return np.einsum("nf,fkij->nfkij", bare.weights(blocks.omega), changes).reshape(len(blocks), -1, 2, 2)
