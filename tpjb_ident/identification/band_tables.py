"""From the solve of the bands to their results: lines, models and points with their intervals by source."""

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.classic import ClassicLine
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.shape import real_numbers
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.band_blocks import BandBlocks
from tpjb_ident.identification.band_point import BandPoint
from tpjb_ident.identification.band_solution import BandSolution
from tpjb_ident.identification.estimates import estimate_of, shared_changes
from tpjb_ident.results.band_result import BandLine, BandResult
from tpjb_ident.results.frequency_model import fits_over_frequency
from tpjb_ident.results.linearity import FilmChange, change_conditions
from tpjb_ident.results.point_result import PointResult, of_runs
from tpjb_ident.results.quality import feeds_motion
from tpjb_ident.runs.finished_runs import ExcludedRun
from tpjb_ident.runs.static_load import StaticLoads

#: Source of what the solves without an instrument are apart.
_BRACKET = "no instrument"


@dataclass(frozen=True)
class SolvedBands:
    """All bands with their solve; where there is no instrument, one with all noise on the force, one with all on D."""

    points: tuple[BandPoint, ...]
    loads: StaticLoads
    data: BandBlocks
    solutions: tuple[BandSolution, ...]
    excluded: tuple[ExcludedRun, ...]

    @property
    def first(self) -> BandSolution:
        """The solve that counts, or the lower of two."""
        return self.solutions[0]

    @property
    def rig(self) -> Rig:
        """As the solve that counts knows it."""
        return self.first.rig

    @property
    def blocks(self) -> Blocks:
        """Of the solve that counts."""
        return self.data.blocks

    @property
    def solution(self) -> Solution:
        """Of the lines."""
        return self.first.lines

    @property
    def classic(self) -> list[ClassicLine]:
        """All lines by the methods of analysers."""
        return [line for point in self.points for line in point.classic]

    def usable(self, b: int) -> IntArray:
        """Lines of a band with an answer."""
        finite = np.all([np.isfinite(s.h).all(axis=(1, 2)) for s in self.solutions], axis=0)
        return np.flatnonzero(finite & (self.data.band == b))

    def parts(self, b: int) -> list[int]:
        """Parts of a band that become points."""
        return [q for q, part in enumerate(self.first.parts) if part.band == b]

    def estimate(
        self, solution: Solution, group: int, lines: IntArray, h: ComplexArray, method: str
    ) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
        """H of some lines, a group of a solve, by all solves `h` (s, 2, 2), and its covariances by source.

        Where solves differ it is in their middle, and half of what they are apart a rectangle's half width.
        """
        half, omega = 0.5 * (h[-1] - h[0]), float(self.data.omega[lines].mean())
        est, budget = estimate_of(solution, group, h[0] + half, omega, method)
        if half.any():
            budget[_BRACKET] = np.diag(real_numbers(half) ** 2 / 3)
            est = replace(est, systematic=est.systematic + budget[_BRACKET])
        return replace(est, condition=float(np.median(self.first.condition[lines]))), budget


def band_results(
    solved: SolvedBands, quality: list[tuple[Condition, ...]], clearance: float | None
) -> tuple[tuple[BandResult, ...], FloatArray, tuple[str, ...]]:
    """Lines, models and points of all bands, what the points share (q, 8 P) [N/m], and the names of that."""
    bracket = real_numbers(solved.solutions[-1].part_h - solved.first.part_h) / np.sqrt(12)

    def shared(parts: list[int]) -> tuple[FloatArray, tuple[str, ...]]:
        # runs are those of all parts: what scatters from run to run is common to them
        more = {_BRACKET: bracket[parts]} if bracket.any() else {}
        return shared_changes(solved.first.part, parts, more=more)

    results, numbers = [], []
    for b, data in enumerate(solved.points):
        lines = tuple(_line(solved, data, int(k)) for k in solved.usable(b))
        parts = solved.parts(b) if lines else []
        points = tuple(_point(solved, q, quality[b], clearance) for q in parts)
        # what runs scatter by is one for all parts: no chance between them
        free = [np.full(8, solved.first.part.noise_freedom(q)) for q in parts]
        by_noise = [replace(p, stiffness=replace(p.stiffness, dof=dof)) for p, dof in zip(points, free)]
        fits = fits_over_frequency(by_noise, shared(parts)[0])
        models, chosen = (fits[0].fits, fits[0].supported) if fits else ({}, "raw H")
        period, width = data.spectra[0].period, data.plan.resolution
        common = lines, models, chosen, quality[b], data.names, period, width, points
        results.append(BandResult(data.point, data.kind, *common))
        numbers += parts
    return (tuple(results), *shared(numbers))


def _line(solved: SolvedBands, point: BandPoint, k: int) -> BandLine:
    """One line by the method that counts, and by the others: how runs scatter is no matter of the method."""
    h = np.array([s.h[k] for s in solved.solutions])
    best, budget = solved.estimate(solved.solution, k, np.array([k]), h, point.method)
    classic = solved.classic[k]
    alternatives = {name: value - solved.rig.bare.at(np.array([best.omega]))[0] for name, value in classic.h.items()}
    if _BRACKET in budget:
        alternatives |= {"h1": h[0], "h2": h[-1]}
    table = {point.method: best}
    for name, value in alternatives.items():
        table.setdefault(name, replace(best, h=value, method=name))
    return BandLine(best.omega / (2 * np.pi), table, point.method, classic.coherence, classic.n_rows)


def _point(solved: SolvedBands, q: int, quality: tuple[Condition, ...], clearance: float | None) -> PointResult:
    """One part of a band as a point: its lines alone tell its h; K-C-M only says how h changes within it."""
    part = solved.first.parts[q]
    point = solved.points[part.band]
    h = np.array([s.part_h[q] for s in solved.solutions])
    est, budget = solved.estimate(solved.first.part, q, part.lines, h, f"band-{point.method}")
    inside = [solved.classic[k] for k in np.intersect1d(part.lines, solved.usable(part.band))]
    amplitude = max(s.amplitude for s in point.spectra)
    share = float(solved.blocks.bent[solved.blocks.band == part.band][0])
    bent = change_conditions(FilmChange(share), share, est, amplitude, clearance)
    return PointResult(
        **of_runs(point),
        point=replace(point.point, excitation=2 * np.pi * round(part.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        n_windows=sum(line.n_rows for line in inside),
        outlier_fraction=0.0,
        coherence=float(np.median([line.coherence.min() for line in inside])) if inside else float("nan"),
        amplitude=amplitude,
        quality=merged(quality, feeds_motion(est), bent),
        rejected=(),
        load_miss=solved.loads.misses[part.band],
        clearance=clearance,
        budget=budget,
        scattering=("random",),
    )
