"""What the size of the motion does to the film: G in F = (H + G a^2) d, to second order in the motion.

a^2 = |d|^2 of the run over its mean at the point. The film's harmonics say beforehand how large G can be. Where a point
was run at several amplitudes, the runs tell G, and H is that of no motion; where all have one, G cannot be told from H:
it is considered, and what the harmonics let expect goes into the interval.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.blocks import Blocks, Rig, totals
from tpjb_ident.estimate.equation import State, entry_forces, entry_sizes, film_force_rows
from tpjb_ident.estimate.shape import real_numbers
from tpjb_ident.estimate.term import Additive, Fitted, Parameter

#: Name of the condition where the runs tell G.
ZERO_AMPLITUDE = "zero amplitude"
#: A change is no larger than what the harmonics let expect; as a standard deviation it is this part of it.
_AS_DEVIATION = 1 / 1.6
#: Runs of one direction must differ in amplitude by this factor to tell G: directions differ by more than their size.
_SEVERAL = 1.3
#: Cosine between the motions of two runs from which they have one direction.
_ALIKE = 0.98
#: Numbers of G at a point.
_NUMBERS = 8


class Amplitude(Additive):
    """Real and imaginary parts of G at every point whose film shows harmonics, each over its own entry of H."""

    name = "amplitude"

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        motion = blocks.z[:, rig.of("displacement")]
        number = len(blocks.points)
        runs = np.maximum(totals(blocks.point, np.ones(len(blocks)), number), 1.0)
        self._mean = totals(blocks.point, np.sum(np.abs(motion) ** 2, axis=1), number) / runs
        self.points = tuple(np.flatnonzero(blocks.bent > 0).tolist())
        self._several = np.zeros(number, dtype=bool)
        self._several[list(self.points)] = [_several(motion[blocks.point == p]) for p in self.points]
        parameters = []
        for p in self.points:
            place = f"{blocks.points[p].static_load:g} N, {blocks.points[p].excitation_hz:g} Hz"
            deviation = _AS_DEVIATION * float(blocks.bent[p])
            parameters += [Parameter(f"{place}, {i}", "1", deviation) for i in range(_NUMBERS)]
        self.parameters = tuple(parameters)

    def point_conditions(self, point: int, fitted: Fitted, h: ComplexArray) -> tuple[Condition, ...]:
        """What to say where the runs of a point tell G; `h` (2, 2) [N/m]."""
        if point not in self.points:
            return ()
        first = _NUMBERS * self.points.index(point)
        part = slice(first, first + _NUMBERS)
        if not fitted.estimated[part].any():
            return ()
        entries = real_numbers(h)
        share = float(np.linalg.norm(fitted.value[part] * entries) / np.linalg.norm(entries))
        text = f"h at the runs' mean amplitude differs by {100 * share:.1f} % from that at none"
        return (Condition(ZERO_AMPLITUDE, f"{text}; K and C are those at none, by the runs' several amplitudes"),)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """a^2 G d in the cells."""
        d = state.u[:, :2]
        size = self._square(blocks, d)[:, None] * entry_sizes(state.h[blocks.point])
        return film_force_rows(self.rig, blocks, state, entry_forces(size, d))

    def film_change(self, blocks: Blocks, state: State, value: FloatArray) -> ComplexArray:
        """a^2 G of every run."""
        size = self._square(blocks, state.u[:, :2])[:, None] * entry_sizes(state.h[blocks.point])
        change = (self.of_blocks(blocks, value) * size).reshape(-1, 2, 2, 2)
        return np.asarray(change.sum(axis=1))

    def _square(self, blocks: Blocks, d: ComplexArray) -> FloatArray:
        """a^2 of every run (n,); one where a point has one amplitude, nothing where its film shows no harmonics."""
        square = np.sum(np.abs(d) ** 2, axis=1) / self._mean[blocks.point]
        return np.where(blocks.bent[blocks.point] > 0, np.where(self._several[blocks.point], square, 1.0), 0.0)


def _several(z: ComplexArray) -> bool:
    """Whether runs of one direction differ in amplitude; motions (g, probes)."""
    overlap = np.abs(z @ z.conj().T)
    size = np.sqrt(np.diag(overlap))
    alike = overlap > _ALIKE * np.outer(size, size)
    return bool(np.any(alike & (size[:, None] > _SEVERAL * size)))
