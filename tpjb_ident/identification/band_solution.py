"""The solve of all bands of a campaign: h of every line, then h of the parts of each band.

Both are one equation and one set of blocks; only what the points share differs. Scatter, weights and what the sensors
share are found with the lines, whose h is free, and stay. A part's lines share one departure from the curve of K-C-M
that is nearest to the band's lines: it need not hold over the band, only bend h within the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.classic import ClassicLine
from tpjb_ident.estimate.blocks import Rig, film_force, vector
from tpjb_ident.estimate.load_slope import slopes_over_load
from tpjb_ident.estimate.noise import GAIN_OR_LOAD, UNKNOWN_EXPONENT
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.shape import MODELS, Shape, complex_matrix, least_squares, power_columns, real_numbers
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.identification.band_blocks import BandBlocks, line_products
from tpjb_ident.terms.registry import solve, solved_as_learnt
from tpjb_ident.terms.run_gain import RunGain

#: Parts of a band whose h becomes a point.
_PARTS = 8
#: Scatter of the runs' gains before the runs tell it; that of a good rig, and the freedom that it counts as.
_FIRST, _USUAL = 0.01, (5e-4, 4.0)
#: Rounds in which the runs tell their scatter.
_ROUNDS = 3
#: A line whose h goes this far from least squares, of its size, is not told from noise.
_RUN_AWAY = 3.0
#: Condition number of a line's motions from which its runs move the shaft along one line.
ONE_LINE = 1e6


@dataclass(frozen=True, repr=False)
class BandSolution:
    """All bands of a campaign; L lines."""

    data: BandBlocks
    solution: Solution  #: of the lines
    usable: BoolArray  #: (L,): lines that the excitation tells
    parts: tuple[IntArray, ...]  #: lines of every part: h is that at the middle one
    part: Solution
    condition: FloatArray  #: (L,): condition number of the motions
    run_scatter: float  #: of the runs' gains

    @cached_property
    def classic(self) -> list[ClassicLine]:
        """All lines by the methods of analysers."""
        return [line for point in self.data.points for line in point.classic]

    def usable_of(self, b: int) -> IntArray:
        """Lines of a band with an answer."""
        return np.flatnonzero(self.usable & (self.data.band == b))

    def bracket(self, lines: IntArray) -> ComplexArray:
        """Half of what H2 lies above H1 at some lines (2, 2) [N/m], between which H is if nothing tells noise."""
        blind = [k for k in lines if self.usable[k] and self.data.points[self.data.band[k]].method == "hv"]
        halves = [0.5 * (self.classic[k].h["h2"] - self.classic[k].h["h1"]) for k in blind]
        return np.mean([*halves], axis=0) if halves else np.zeros((2, 2), complex)


def solve_bands(rig: Rig, data: BandBlocks) -> BandSolution:
    """Solve all bands."""
    crude, condition = _crude(rig, data)
    used = data.driven & (condition < ONE_LINE)
    usable = used & data.clear
    lines, size = _lines(rig, data, np.where(usable[:, None, None], crude, np.nan))
    away = np.abs(lines.h - crude).max(axis=(1, 2))
    usable &= away < _RUN_AWAY * np.abs(crude).max(axis=(1, 2))
    parts = _parts(data, used, usable)
    return BandSolution(data, lines, usable, parts, _part_solution(data, lines, parts, usable), condition, size)


def _lines(rig: Rig, data: BandBlocks, start: ComplexArray) -> tuple[Solution, float]:
    """H of the lines, with the rig as they show it, and the scatter of the runs' gains."""
    by_load, spare = _own_scatter(rig, data, start)
    lines = np.arange(len(data.omega))
    # lines of one run stand for many runs: none is judged
    shape = Shape(lines, scatter=replace(Scatter.none(len(lines), len(data.blocks)), judges=False))

    def solved(rig: Rig, size: float) -> Solution:
        blocks = replace(data.blocks, gain_scatter=np.hypot(by_load, size * spare))
        return solve(rig, blocks, start, shape)

    size, widening = _FIRST, 1.0
    for _ in range(_ROUNDS if spare.any() else 0):
        solution = solved(rig, size)
        term = next(t for t in solution.terms if isinstance(t, RunGain))
        size, freedom = term.scatter(solution.fitted[term.name], by_load, _USUAL)
        widening = student_widening(freedom)
    return solved_as_learnt(rig, lambda rig: solved(rig, size * widening)), size * float(spare.any())


def _own_scatter(rig: Rig, data: BandBlocks, h: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Scatter that a run's gain has by its missed load, which may be one, or do what nothing tells, by block (n,).

    And one for every run whose point has more than the two runs that h needs, else zero: what the film makes of the
    shaft's turning on the lines themselves differs from run to run as well, and would pass for a gain.
    """
    blocks = data.blocks
    alone = ~(slopes_over_load(blocks.points, h)[1] & rig.to_set_point)
    by_load = np.hypot(GAIN_OR_LOAD, UNKNOWN_EXPONENT * alone[blocks.point]) * np.abs(blocks.miss.real)
    band = blocks.band[blocks.point]
    runs = np.array([len(np.unique(blocks.run[band == b])) for b in range(len(data.turning))])
    return by_load, np.where((runs > 2) & (data.turning < _FIRST), 1.0, 0.0)[band]


def _crude(rig: Rig, data: BandBlocks) -> tuple[ComplexArray, FloatArray]:
    """H of every line by least squares (L, 2, 2), and the condition number of its motions (L,)."""
    D, F = vector(rig, data.blocks, "displacement"), film_force(rig, data.blocks)
    usable = np.isfinite(D).all(axis=1) & np.isfinite(F).all(axis=1)
    used = data.blocks.part(np.flatnonzero(usable))
    DD, FD = (line_products(used, rows[usable], D[usable]) for rows in (D, F))
    condition = np.sqrt(np.linalg.cond(DD))
    h = np.full(DD.shape, np.nan + 0j)
    regular = condition < ONE_LINE
    h[regular] = FD[regular] @ np.linalg.inv(DD[regular])
    return h - rig.bare.at(data.omega), condition


def _parts(data: BandBlocks, used: BoolArray, usable: BoolArray) -> tuple[IntArray, ...]:
    """Parts of all bands; few tones are no band: each that is told is a point."""
    parts: list[IntArray] = []
    for b in range(len(data.turning)):
        lines = np.flatnonzero(used & (data.band == b))
        if len(lines) < 2 * MODELS["K-C-M"]:
            parts += [lines[k : k + 1] for k in np.flatnonzero(usable[lines])]
        else:
            parts += np.array_split(lines, min(_PARTS, len(lines) // 2))
    return tuple(parts)


def _part_solution(data: BandBlocks, lines: Solution, parts: Sequence[IntArray], usable: BoolArray) -> Solution:
    """The solve of the parts, a group each, from the curve of K-C-M nearest to the `usable` lines of a band."""
    start = np.full_like(lines.h, np.nan)
    columns = power_columns(data.omega / np.median(data.omega), MODELS["K-C-M"])
    for b in np.unique(data.band[usable]):
        mine = data.band == b
        numbers = least_squares(columns[usable & mine], real_numbers(lines.h[usable & mine]))
        start[mine] = complex_matrix(columns[mine] @ numbers)
    group, count = np.full(len(start), len(parts)), len(parts) + 1  # the last of those that are in no part
    for q, part in enumerate(parts):
        group[part] = q
        if len(part) == 1:  # a tone by itself has no curve but its own h
            start[part] = lines.h[part]
    start[group == len(parts)] = np.nan
    shape = Shape(group, None, count, lines.scatter.fixed(count, lines.scatter.weights), lines.fitted)
    return solve(lines.rig, lines.blocks, start, shape)
