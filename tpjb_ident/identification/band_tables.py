"""From the solve of the bands to their results: lines, models and points with their intervals by source."""

from __future__ import annotations

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
from tpjb_ident.identification.shared_changes import sources_of, total
from tpjb_ident.results.band_result import BandLine, BandResult
from tpjb_ident.results.frequency_model import FrequencyModel, fit_over_frequency, supported
from tpjb_ident.results.harmonics import FilmChange, change_conditions
from tpjb_ident.results.point_result import PointResult, mean_position
from tpjb_ident.results.quality import feeds_motion
from tpjb_ident.runs.excluded_runs import ExcludedRun
from tpjb_ident.runs.point_data import pad_means
from tpjb_ident.runs.static_load import LoadMiss, StaticLoads


@dataclass(frozen=True)
class SolvedBands:
    """All bands with their solve; where there is no instrument, one with all noise on the force, one with all on D."""

    points: tuple[BandPoint, ...]
    loads: StaticLoads
    data: BandBlocks
    classic: tuple[ClassicLine, ...]  #: by line
    solutions: tuple[BandSolution, ...]
    excluded: tuple[ExcludedRun, ...] = ()

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

    def usable(self, b: int) -> IntArray:
        """Lines of a band with an answer."""
        finite = np.all([np.isfinite(s.h).all(axis=(1, 2)) for s in self.solutions], axis=0)
        return np.flatnonzero(finite & (self.data.band == b))

    def parts(self, b: int) -> list[int]:
        """Parts of a band that become points."""
        return [q for q, part in enumerate(self.first.parts) if part.band == b] if len(self.usable(b)) else []

    def between(self, h: list[ComplexArray]) -> tuple[ComplexArray, FloatArray]:
        """The middle of the solves' H (2, 2), and half of what they are apart (8,) as a standard deviation.

        That of a rectangle is half its width by the root of three.
        """
        half = 0.5 * (h[-1] - h[0])
        return h[0] + half, real_numbers(half) / np.sqrt(3)


def band_result(
    solved: SolvedBands, b: int, miss: LoadMiss, told: tuple[Condition, ...], clearance: float | None
) -> BandResult:
    """Lines, models and points of one band."""
    point = solved.points[b]
    lines = tuple(_line(solved, point, int(k)) for k in solved.usable(b))
    models = _models(solved, b) if len(lines) else {}
    chosen = supported(models) if models else "raw H"
    ids = tuple(s.phasors.run for s in point.spectra)
    period, width = point.spectra[0].period, point.plan.resolution
    result = BandResult(point.point, point.group.kind, lines, models, chosen, told, ids, period, width)
    return replace(result, points=tuple(_point(solved, q, result, miss, clearance) for q in solved.parts(b)))


def _noise_dof(solved: SolvedBands, chosen: np.ndarray) -> float:
    """Real degrees of freedom of the noise of some blocks."""
    return 2 * float(np.median(solved.data.blocks.dof[chosen])) if chosen.any() else 1.0


def _line(solved: SolvedBands, point: BandPoint, k: int) -> BandLine:
    """One line by the method that counts, and by the others."""
    omega = float(solved.data.line_omega[k])
    classic, solution = solved.classic[k], solved.first.lines
    h, bracket = solved.between([s.h[k] for s in solved.solutions])
    of_line = solved.data.line[solved.data.blocks.point]
    dof = solution.freedom(k, of_line == k, _noise_dof(solved, of_line == k))
    systematic = total(share[k] for share in solution.shares.values())
    own = systematic + np.diag(bracket**2)
    none, condition = np.empty((0, 2)), float(solved.first.condition[k])
    best = DynamicStiffness(h, omega, solution.records[k], dof, point.method, none, condition=condition, systematic=own)
    table = {point.method: best}
    rig = solved.first.rig.bare.at(np.array([omega]))[0]
    others = {name: value - rig for name, value in classic.h.items()}
    if len(solved.solutions) > 1 and bracket.any():
        others |= {"h1": solved.solutions[0].h[k], "h2": solved.solutions[1].h[k]}
    for name, value in others.items():
        free = np.full(8, classic.freedom)
        other = DynamicStiffness(value, omega, classic.covariance, free, name, none, systematic=systematic)
        table.setdefault(name, other)
    return BandLine(omega / (2 * np.pi), table, point.method, classic.coherence, classic.n_rows)


def _models(solved: SolvedBands, b: int) -> dict[str, FrequencyModel]:
    """Models over one band, by its parts: all of them have their runs in common, and all that these share."""
    part, data = solved.first.part, solved.data
    lines = solved.first.used & (data.band == b)
    members, of_part = solved.parts(b), _part_of_block(solved)
    estimates, changes = [], []
    for q in members:
        h, bracket = solved.between([s.part_h[q] for s in solved.solutions])
        change = np.concatenate([part.factors[:, q], bracket[None]])
        omega, dof = solved.first.parts[q].omega, np.full(8, _noise_dof(solved, of_part == q))
        shared = change.T @ change
        none = np.empty((0, 2))
        estimates.append(DynamicStiffness(h, omega, part.records[q], dof, "", none, systematic=shared))
        changes.append(change)
    together = np.sqrt(len(changes[0])) * np.concatenate(changes, axis=1)
    band = data.line_omega[lines].min() / (2 * np.pi), data.line_omega[lines].max() / (2 * np.pi)
    models = {}
    for name, matrices in MODELS.items():
        if lines.sum() < 2 * matrices:
            continue
        model = fit_over_frequency(estimates, name, together)
        model = replace(model, band=band, n_frequencies=int(lines.sum()))
        if solved.points[b].method == "hv":  # without an instrument, the bias of either solve looks like a misfit
            model = replace(model, chi_square=np.nan, probability=np.nan, misfit=np.nan)
        models[name] = model
    return models


def _part_of_block(solved: SolvedBands) -> IntArray:
    """Part that every block belongs to (n,); -1 of those in none."""
    of_line = np.full(len(solved.data.band), -1, dtype=np.intp)
    for q, part in enumerate(solved.first.parts):
        of_line[part.lines] = q
    return of_line[solved.data.line[solved.data.blocks.point]]


def _point(solved: SolvedBands, q: int, result: BandResult, miss: LoadMiss, clearance: float | None) -> PointResult:
    """One part of a band as a point: its lines alone tell its h; K-C-M only says how h changes within it."""
    part = solved.first.parts[q]
    point = solved.points[part.band]
    est, budget = _estimate(solved, point, q, result)
    low, high = (solved.data.line_omega[part.lines[k]] / (2 * np.pi) for k in (0, -1))
    inside = [line for line in result.lines if low - 1e-9 <= line.frequency <= high + 1e-9]
    position, position_se = mean_position(np.array([s.position for s in point.spectra]))
    amplitude = max(s.amplitude for s in point.spectra)
    share = float(solved.data.bent[part.band]) if len(solved.data.bent) else 0.0
    bent = change_conditions(FilmChange(share), share, est, amplitude, clearance)
    return PointResult(
        point=replace(point.point, excitation=2 * np.pi * round(part.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        static_load_measured=float(np.linalg.norm(point.mean_loads.mean(axis=0))),
        position=position,
        position_se=position_se,
        temperatures=pad_means([s.temperatures for s in point.spectra]),
        n_records=len(point.spectra),
        n_windows=sum(line.n_rows for line in inside),
        outlier_fraction=0.0,
        coherence=float(np.median([line.coherence.min() for line in inside])) if inside else float("nan"),
        amplitude=amplitude,
        quality=merged(result.quality, feeds_motion(est), bent),
        rejected=(),
        runs=result.runs,
        load_miss=miss,
        inertia_corrected=point.spectra[0].phasors.acceleration is not None,
        clearance=clearance,
        budget=budget,
    )


def _estimate(
    solved: SolvedBands, point: BandPoint, q: int, result: BandResult
) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
    """The part's h with all its uncertainties, and these by source."""
    part, solution = solved.first.parts[q], solved.first.part
    h, bracket = solved.between([s.part_h[q] for s in solved.solutions])
    own, shared = sources_of(solution, q)
    if bracket.any():
        shared["no instrument"] = np.diag(bracket**2)
    of_part = _part_of_block(solved) == q
    dof = solution.freedom(q, of_part, _noise_dof(solved, of_part))
    condition = float(np.median([line.stiffness.condition for line in result.lines])) if result.lines else np.nan
    name, weights, systematic = f"band-{point.method}", np.ones((1, 2)), total(shared.values())
    est = DynamicStiffness(
        h, part.omega, total(own.values()), dof, name, weights, condition=condition, systematic=systematic
    )
    return est, own | shared
