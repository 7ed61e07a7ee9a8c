"""What the size of the motion does to the film: G in F = (H + G a^2) d, to second order in the motion.

a^2 = |d|^2 of the run over its mean at the point. The film's harmonics say beforehand how large G can be. Where a point
was run at several amplitudes, the runs tell G, and H is that of no motion; where all have one, G cannot be told from H:
it is considered, and what the harmonics let expect goes into the interval.
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.arrowhead import NUMBERS, real_numbers
from tpjb_ident.estimate.equation import Blocks, Rig, State, entry_changes, entry_sizes, totals
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION, FilmTerm, Fitted, numbered

#: Name of the condition where the runs tell G.
ZERO_AMPLITUDE = "zero amplitude"
#: Runs of one direction must differ in amplitude by this factor to tell G: directions differ by more than their size.
_SEVERAL = 1.3
#: Cosine between the motions of two runs from which they have one direction.
_ALIKE = 0.98


class Amplitude(FilmTerm):
    """Real and imaginary parts of G at every point whose film shows harmonics, each over its own entry of H."""

    name = "amplitude"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        motion = blocks.z[:, rig.pick("displacement")]
        number = len(blocks.points)
        runs = np.maximum(totals(blocks.point, np.ones(len(blocks)), number), 1.0)
        self._mean = totals(blocks.point, np.sum(np.abs(motion) ** 2, axis=1), number) / runs
        shown = (blocks.bent > 0) & (blocks.band < 0)
        self.points = tuple(np.flatnonzero(shown).tolist())
        self._several = np.zeros(number, dtype=bool)
        self._several[list(self.points)] = [_several(motion[blocks.point == p]) for p in self.points]
        self.group = np.where(shown, np.cumsum(shown) - 1, -1)
        for p in self.points:
            place = f"{blocks.points[p].static_load:g} N, {blocks.points[p].excitation_hz:g} Hz"
            self.parameters += numbered(place, "1", [CHANGE_AS_DEVIATION * float(blocks.bent[p])] * NUMBERS)

    def point_conditions(self, point: int, fitted: Fitted, h: ComplexArray) -> Conditions:
        """What to say where the runs of a point tell G; `h` (2, 2) [N/m]."""
        if point not in self.points:
            return ()
        first = NUMBERS * self.points.index(point)
        part = slice(first, first + NUMBERS)
        if not fitted.estimated[part].any():
            return ()
        entries = real_numbers(h)
        share = np.linalg.norm(fitted.value[part] * entries) / np.linalg.norm(entries)
        text = f"h at the runs' mean amplitude differs by {100 * share:.1f} % from that at none"
        return (Condition(ZERO_AMPLITUDE, f"{text}; K and C are those at none, by the runs' several amplitudes"),)

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """a^2 G; a^2 is one where a point has one amplitude, nothing where its film shows no harmonics."""
        square = np.sum(np.abs(state.u[:, :2]) ** 2, axis=1) / self._mean[blocks.point]
        square = np.where(self.group[blocks.point] >= 0, np.where(self._several[blocks.point], square, 1.0), 0.0)
        return entry_changes(square[:, None] * entry_sizes(state.h[blocks.point]))


def _several(z: ComplexArray) -> bool:
    """Whether runs of one direction differ in amplitude; motions (g, probes)."""
    overlap = np.abs(z @ z.conj().T)
    size = np.sqrt(np.diag(overlap))
    alike = overlap > _ALIKE * np.outer(size, size)
    return bool(np.any(alike & (size[:, None] > _SEVERAL * size)))
