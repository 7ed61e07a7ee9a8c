"""From the solve of the bands to their results: lines, models and points with their intervals by source."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.classic import ClassicLine
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, change_conditions
from tpjb_ident.dynamic.results.band_result import BandLine, BandResult
from tpjb_ident.dynamic.results.frequency_model import FrequencyModel, supported
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.results.quality import feeds_motion
from tpjb_ident.dynamic.runs.point_data import pad_means
from tpjb_ident.estimate.shape import MODELS, real_numbers
from tpjb_ident.identification.band_blocks import BandBlocks
from tpjb_ident.identification.band_point import BandPoint
from tpjb_ident.identification.band_solution import BandSolution
from tpjb_ident.identification.shared_changes import RUN_TERMS, SharedChanges, shared_changes

#: Degrees of freedom of the noise of a model: it averages over many lines.
_MANY = 1e4


@dataclass(frozen=True)
class SolvedBands:
    """All bands with their solve; where there is no instrument, one with all noise on the force, one with all on D."""

    points: tuple[BandPoint, ...]
    data: BandBlocks
    classic: tuple[ClassicLine, ...]  #: by line
    solutions: tuple[BandSolution, ...]

    @property
    def first(self) -> BandSolution:
        """The solve that counts, or the lower of two."""
        return self.solutions[0]

    def usable(self, b: int) -> IntArray:
        """Lines of a band with an answer."""
        finite = np.all([np.isfinite(s.h).all(axis=(1, 2)) for s in self.solutions], axis=0)
        return np.flatnonzero(finite & (self.data.band == b))

    def parts(self, b: int) -> list[int]:
        """Parts of a band that become points."""
        return [q for q, part in enumerate(self.first.parts) if part.band == b] if len(self.usable(b)) else []

    def between(self, h: list[ComplexArray]) -> tuple[ComplexArray, FloatArray]:
        """The middle of the solves' H (2, 2), and half of what they are apart (8,)."""
        half = 0.5 * (h[-1] - h[0])
        return h[0] + half, np.abs(real_numbers(half))


def band_result(
    solved: SolvedBands, b: int, miss: LoadMiss, told: tuple[Condition, ...], clearance: float | None
) -> BandResult:
    """Lines, models and points of one band."""
    point = solved.points[b]
    lines = tuple(_line(solved, point, int(k)) for k in solved.usable(b))
    quiet = point.method == "hv"
    models = {}
    for name in MODELS if len(lines) else ():
        if np.isfinite(solved.first.models[name].numbers[b]).all():
            models[name] = _model(solved, name, b, quiet)
    chosen = supported(models) if models else "raw H"
    ids = tuple(s.phasors.run for s in point.spectra)
    period, width = point.spectra[0].period, point.plan.resolution
    result = BandResult(point.point, point.group.kind, lines, models, chosen, told, ids, period, width)
    return replace(result, points=tuple(_point(solved, q, result, miss, clearance) for q in solved.parts(b)))


def shared_by_bands(solved: SolvedBands) -> SharedChanges:
    """The sources of the points of all bands."""
    parts = [q for b in range(len(solved.points)) for q in solved.parts(b)]
    return shared_changes(solved.first.part, parts)


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
    systematic = np.sum([np.zeros((8, 8)), *(share[k] for share in solution.shares.values())], axis=0)
    # a rectangle's standard deviation is half its width by the root of three
    own = systematic + np.diag(bracket**2) / 3
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


def _model(solved: SolvedBands, name: str, b: int, quiet: bool) -> FrequencyModel:
    """One model over one band, held against h in its parts."""
    fits = [s.models[name] for s in solved.solutions]
    first, data = fits[0].solution, solved.data
    half = 0.5 * (fits[-1].numbers[b] - fits[0].numbers[b])
    lines = solved.first.used & (data.band == b)
    scale = np.repeat(solved.first.middle[b] ** -np.arange(MODELS[name], dtype=float), 4)
    outer = np.outer(scale, scale)
    shared = np.sum([np.diag(half**2) / 3, *(share[b] for share in first.shares.values())], axis=0)
    dof = first.freedom(b, data.band[data.line[data.blocks.point]] == b, _MANY)
    chi_square, spare, probability, misfit = _held_against_parts(solved, name, b)
    unjudged = float("nan")  # without an instrument, the bias of either solve looks like a misfit
    omega = data.line_omega[lines]
    return FrequencyModel(
        name,
        (fits[0].numbers[b] + half) * scale,
        first.records[b] * outer,
        dof,
        shared * outer,
        unjudged if quiet else chi_square,
        spare,
        unjudged if quiet else probability,
        unjudged if quiet else misfit,
        (float(omega.min()) / (2 * np.pi), float(omega.max()) / (2 * np.pi)),
        int(lines.sum()),
    )


def _held_against_parts(solved: SolvedBands, name: str, b: int) -> tuple[float, int, float, float]:
    """Chi-square, degrees of freedom, probability and largest misfit of a model in parts of the band."""
    found = solved.first
    mine = [q for q, part in enumerate(found.parts) if part.band == b]
    if not mine:
        return float("nan"), 0, 1.0, float("nan")
    spare = 8 * len(mine) - 4 * MODELS[name]
    total, noise_dof, squares = 0.0, 0.0, []
    of_part = _part_of_block(solved)
    for q in mine:
        off = real_numbers(found.part_h[q] - found.models[name].at_parts[q])
        covariance = found.part.given[q]
        total += float(off @ np.linalg.solve(covariance, off))
        noise_dof += _noise_dof(solved, of_part == q)
        size = float(np.sum(np.abs(found.part_h[q]) ** 2))
        squares.append((float(off @ off) - float(np.trace(covariance))) / size)
    probability = float(fdtrc(spare, noise_dof, total / spare)) if spare > 0 else 1.0
    return total, max(spare, 0), probability, float(np.sqrt(max(*squares, 0.0)))


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
    positions = np.array([s.position for s in point.spectra])
    amplitude = max(s.amplitude for s in point.spectra)
    share = float(solved.data.bent[part.band]) if len(solved.data.bent) else 0.0
    bent = change_conditions(FilmChange(share), share, est, amplitude, clearance)
    number = len(positions)
    return PointResult(
        point=replace(point.point, excitation=2 * np.pi * round(part.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        static_load_measured=float(np.linalg.norm(point.mean_loads.mean(axis=0))),
        position=positions.mean(axis=0),
        position_se=positions.std(axis=0, ddof=1) / np.sqrt(number) if number > 1 else np.full(2, np.nan),
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
    shared = {name: share[q] for name, share in solution.shares.items() if np.any(share[q])}
    own = {"random": solution.records[q]} | {name: shared.pop(name) for name in RUN_TERMS if name in shared}
    if bracket.any():
        shared["no instrument"] = np.diag(bracket**2) / 3
    of_part = _part_of_block(solved) == q
    dof = solution.freedom(q, of_part, _noise_dof(solved, of_part))
    condition = float(np.median([line.stiffness.condition for line in result.lines])) if result.lines else np.nan
    covariance, systematic = (np.sum([np.zeros((8, 8)), *parts.values()], axis=0) for parts in (own, shared))
    return DynamicStiffness(
        h, part.omega, covariance, dof, f"band-{point.method}", np.ones((1, 2)), condition=condition,
        systematic=systematic,
    ), own | shared  # fmt: skip
