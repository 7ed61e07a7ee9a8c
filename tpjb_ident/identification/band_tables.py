"""From the solve of the bands to their results: lines, models and points with their intervals by source."""

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.classic import ClassicLine
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.estimate.blocks import Blocks, Rig
from tpjb_ident.estimate.shape import MODELS, real_numbers
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.band_blocks import BandBlocks
from tpjb_ident.identification.band_point import BandPoint
from tpjb_ident.identification.band_solution import BandSolution
from tpjb_ident.identification.estimates import estimate_of, shared_changes, total
from tpjb_ident.results.band_result import BandLine, BandResult
from tpjb_ident.results.frequency_model import FrequencyModel, fit_over_frequency, supported
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
        return [q for q, part in enumerate(self.first.parts) if part.band == b] if len(self.usable(b)) else []

    def estimate(
        self, solution: Solution, group: int, lines: IntArray, h: ComplexArray, method: str
    ) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
        """H of some lines, a group of a solve, by all solves `h` (s, 2, 2), and its covariances by source.

        Where solves differ it is in their middle, and half of what they are apart a rectangle's half width.
        """
        half, omega = 0.5 * (h[-1] - h[0]), float(self.data.line_omega[lines].mean())
        est, budget = estimate_of(solution, group, h[0] + half, omega, method)
        if half.any():
            budget[_BRACKET] = np.diag(real_numbers(half) ** 2 / 3)
            est = replace(est, systematic=est.systematic + budget[_BRACKET])
        return replace(est, condition=float(np.median(self.first.condition[lines]))), budget


def band_results(
    solved: SolvedBands, quality: list[tuple[Condition, ...]], clearance: float | None
) -> tuple[tuple[BandResult, ...], FloatArray, tuple[str, ...]]:
    """Lines, models and points of all bands, what the points share (q, 8 P) [N/m], and the names of that."""
    bands = range(len(solved.points))
    lines = [tuple(_line(solved, solved.points[b], int(k)) for k in solved.usable(b)) for b in bands]
    parts = [solved.parts(b) for b in bands]
    points = [tuple(_point(solved, q, lines[b], quality[b], clearance) for q in parts[b]) for b in bands]
    bracket = real_numbers(solved.solutions[-1].part_h - solved.first.part_h) / np.sqrt(12)
    results = []
    for b, data in enumerate(solved.points):
        changes = np.concatenate([solved.first.part.factors[:, parts[b]], bracket[None, parts[b]]])
        models = _models(solved, b, points[b], changes) if points[b] else {}
        chosen = supported(models) if models else "raw H"
        period, width = data.spectra[0].period, data.plan.resolution
        common = lines[b], models, chosen, quality[b], data.names, period, width, points[b]
        results.append(BandResult(data.point, data.kind, *common))
    numbers = [q for members in parts for q in members]
    more = {_BRACKET: bracket[numbers]} if bracket.any() else {}
    return (tuple(results), *shared_changes(solved.first.part, numbers, more))


def _line(solved: SolvedBands, point: BandPoint, k: int) -> BandLine:
    """One line by the method that counts, and by the others."""
    h = np.array([s.h[k] for s in solved.solutions])
    best, budget = solved.estimate(solved.solution, k, np.array([k]), h, point.method)
    classic = solved.classic[k]
    alternatives = {name: value - solved.rig.bare.at(np.array([best.omega]))[0] for name, value in classic.h.items()}
    if _BRACKET in budget:
        alternatives |= {"h1": h[0], "h2": h[-1]}
    shared = best.systematic - budget.get(_BRACKET, 0.0)
    scatter = {"covariance": classic.covariance, "dof": np.full(8, classic.freedom), "systematic": shared}
    table = {point.method: best}
    for name, value in alternatives.items():
        table.setdefault(name, replace(best, h=value, method=name, condition=np.nan, **scatter))
    return BandLine(best.omega / (2 * np.pi), table, point.method, classic.coherence, classic.n_rows)


def _models(
    solved: SolvedBands, b: int, points: tuple[PointResult, ...], changes: FloatArray
) -> dict[str, FrequencyModel]:
    """Models over one band, by its parts: all of them have their runs in common, and all that these share.

    `changes` (q, parts, 8): one deviation of every source.
    """
    used = solved.data.line_omega[solved.first.used & (solved.data.band == b)] / (2 * np.pi)
    estimates = []
    for q, p in zip(solved.parts(b), points):
        records, dof = p.budget["random"], np.full(8, solved.first.part.noise_freedom(q))
        shared = total(p.budget.values()) - records
        estimates.append(replace(p.stiffness, covariance=records, dof=dof, systematic=shared))
    together = np.sqrt(len(changes)) * changes.reshape(len(changes), -1)
    models = {}
    for name, matrices in MODELS.items():
        if len(used) < 2 * matrices:
            continue
        model = fit_over_frequency(estimates, name, together)
        model = replace(model, band=(float(used.min()), float(used.max())), n_frequencies=len(used))
        if solved.points[b].method == "hv":  # without an instrument, the bias of either solve looks like a misfit
            model = replace(model, chi_square=np.nan, probability=np.nan, misfit=np.nan)
        models[name] = model
    return models


def _point(
    solved: SolvedBands, q: int, lines: tuple[BandLine, ...], quality: tuple[Condition, ...], clearance: float | None
) -> PointResult:
    """One part of a band as a point: its lines alone tell its h; K-C-M only says how h changes within it."""
    part = solved.first.parts[q]
    point = solved.points[part.band]
    h = np.array([s.part_h[q] for s in solved.solutions])
    est, budget = solved.estimate(solved.first.part, q, part.lines, h, f"band-{point.method}")
    low, high = solved.data.line_omega[part.lines[[0, -1]]] / (2 * np.pi)
    inside = [line for line in lines if low - 1e-9 <= line.frequency <= high + 1e-9]
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
    )
