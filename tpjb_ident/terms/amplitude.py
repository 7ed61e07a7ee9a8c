"""What the size of the motion does to the film: G in F = (H + G a^2) d, to second order in the motion.

a^2 = |d|^2 of the run over its mean at the point. The film's harmonics say beforehand how large G can be. Where a point
was run at several amplitudes, the runs tell G, and H is that of no motion; where all have one, G cannot be told from H:
it is considered, and what the harmonics let expect goes into the interval.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.equation import State, film_force_rows
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
        square = np.sum(np.abs(blocks.z[:, rig.of("displacement")]) ** 2, axis=1)
        points = range(len(blocks.points))
        self._mean = np.array(
            [np.mean(square[blocks.point == p]) if np.any(blocks.point == p) else 1.0 for p in points]
        )
        self._several = np.array([_several(blocks.z[blocks.point == p][:, rig.of("displacement")]) for p in points])
        self._points = [p for p in points if blocks.bent[p] > 0]
        parameters = []
        for p in self._points:
            place = f"{blocks.points[p].static_load:g} N, {blocks.points[p].excitation_hz:g} Hz"
            deviation = _AS_DEVIATION * float(blocks.bent[p])
            parameters += [Parameter(f"{place}, {i}", "1", deviation) for i in range(_NUMBERS)]
        self.parameters = tuple(parameters)

    def point_conditions(self, point: int, fitted: Fitted, h: ComplexArray) -> tuple[Condition, ...]:
        """What to say where the runs of a point tell G; `h` (2, 2) [N/m]."""
        if point not in self._points:
            return ()
        first = _NUMBERS * self._points.index(point)
        part = slice(first, first + _NUMBERS)
        if not fitted.estimated[part].any():
            return ()
        entries = np.concatenate([h.real.ravel(), h.imag.ravel()])
        share = float(np.linalg.norm(fitted.value[part] * entries) / np.linalg.norm(entries))
        text = f"h at the runs' mean amplitude differs by {100 * share:.1f} % from that at none"
        return (Condition(ZERO_AMPLITUDE, f"{text}; K and C are those at none, by the runs' several amplitudes"),)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """a^2 G d in the cells."""
        columns = self.no_columns(blocks)
        d = state.u[:, :2]
        square = self._square(blocks, d)
        for i, p in enumerate(self._points):
            mine = np.flatnonzero(blocks.point == p)
            if not len(mine):
                continue
            entries = np.concatenate([np.abs(state.h[p].real).ravel(), 1j * np.abs(state.h[p].imag).ravel()])
            force = np.zeros((len(blocks), 2, _NUMBERS), complex)
            for k in range(_NUMBERS):
                force[mine, k % 4 // 2, k] = entries[k] * square[mine] * d[mine, k % 2]
            columns[:, :, _NUMBERS * i : _NUMBERS * (i + 1)] = film_force_rows(self.rig, blocks, state, force)
        return columns

    def film_change(self, blocks: Blocks, state: State, value: FloatArray) -> ComplexArray:
        """a^2 G of every run."""
        change = np.zeros((len(blocks), 2, 2), complex)
        square = self._square(blocks, state.u[:, :2])
        for i, p in enumerate(self._points):
            mine = blocks.point == p
            numbers = value[_NUMBERS * i : _NUMBERS * (i + 1)]
            stiffness = (numbers[:4] * np.abs(state.h[p].real).ravel()).reshape(2, 2)
            damping = (numbers[4:] * np.abs(state.h[p].imag).ravel()).reshape(2, 2)
            change[mine] = square[mine, None, None] * (stiffness + 1j * damping)
        return change

    def _square(self, blocks: Blocks, d: ComplexArray) -> FloatArray:
        """a^2 of every run (n,); one where a point has one amplitude."""
        square = np.sum(np.abs(d) ** 2, axis=1) / self._mean[blocks.point]
        return np.where(self._several[blocks.point], square, 1.0)


def _several(z: ComplexArray) -> bool:
    """Whether runs of one direction differ in amplitude; motions (g, probes)."""
    overlap = np.abs(z @ z.conj().T)
    size = np.sqrt(np.diag(overlap))
    alike = overlap > _ALIKE * np.outer(size, size)
    return bool(np.any(alike & (size[:, None] > _SEVERAL * size)))
