"""One operating point of a solved campaign: H with its budget, every other method beside it, figures and flags."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.check.findings import Verdicts
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.corrections.static_load import LoadMiss, load_conditions
from tpjb_ident.dynamic.estimators.estimate import REJECTED_WEIGHT, estimate_table, fit_conditions, not_locked
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, change_conditions
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.baseline import DryTest
from tpjb_ident.dynamic.runs.checked_runs import check_conditions
from tpjb_ident.dynamic.runs.point_data import PointData, pad_means
from tpjb_ident.dynamic.runs.point_source import PointSource
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.identification.campaign_solution import CampaignSolution
from tpjb_ident.identification.methods import Figures, all_methods, point_figures
from tpjb_ident.identification.point_means import (
    MeansTask,
    PointMeans,
    channel_windows,
    clock_turns,
    vectors,
    window_times,
)
from tpjb_ident.identification.shared_changes import RUN_TERMS

#: Name of the method that the solve stands for in the tables.
SOLVED = "mm-eiv"


@dataclass(frozen=True)
class PointShare:
    """What the solve of the campaign says of one point: all that its windows are finished with."""

    shift: ComplexArray  #: (g, m): taken off the readings of every run
    factor: ComplexArray  #: (g, m)
    run_change: ComplexArray  #: (g, 2, 2)
    estimate: DynamicStiffness | None
    budget: dict[str, FloatArray]
    conditions: tuple[Condition, ...]
    shaft: bool
    miss: LoadMiss
    film: FilmChange
    amplitude_left: float  #: share of H by which the amplitude may still change it
    mains_in_cells: float  #: N


@dataclass(frozen=True)
class PointTask:
    """What all points of a campaign are finished with."""

    settings: IdentifySettings
    means: MeansTask
    temperatures: dict[str, dict[int, float]]
    checked: Verdicts
    dry: DryTest


def point_share(solved: CampaignSolution, source: PointSource, p: int) -> PointShare:
    """The part of a campaign's solution that belongs to point `p`."""
    blocks, solution, means = solved.blocks, solved.solution, solved.means[p]
    runs = len(source.digests)
    m = len(solved.rig)
    shift, factor = np.zeros((runs, m), complex), np.ones((runs, m), complex)
    change, weight = np.zeros((runs, 2, 2), complex), np.zeros(runs)
    places = np.flatnonzero(blocks.point == p)
    names = [digest.run for digest in source.digests]
    for b in places:
        g = names.index(blocks.runs[blocks.run[b]])
        shift[g] = solution.shift[b] + solved.mains_shift[b]
        factor[g], change[g], weight[g] = solution.factor[b], solution.run_change[b], solution.weights[b]
    window_weight = np.zeros(0) if means.means is None else means.means.weights
    estimate, budget = _estimate(solved, p, window_weight, weight, source)
    amplitude = budget.get("amplitude")
    left = 0.0
    if amplitude is not None and estimate is not None:
        size = float(np.linalg.norm(estimate.h)) / np.sqrt(2)
        left = float(1.96 * np.sqrt(np.diag(amplitude).max()) / size)
    film = solved.film[p]
    in_cells = solved.cell_pickup if p in solved.in_cells else 0.0
    return PointShare(
        shift,
        factor,
        change,
        estimate,
        budget,
        _conditions(solved, p),
        bool(means.shaft_conditions),
        solved.misses[p],
        film,
        min(left, film.share) if film.share else 0.0,
        in_cells,
    )


def _conditions(solved: CampaignSolution, p: int) -> tuple[Condition, ...]:
    found = [
        *load_conditions(solved.misses[p], solved.common),
        *solved.zero.conditions(),
        *solved.solution.conditions(),
    ]
    if p in solved.mains and solved.pickup is not None:
        found.append(solved.mains[p].condition(solved.pickup))
    found += solved.means[p].shaft_conditions
    for term in solved.solution.terms:
        found += term.point_conditions(p, solved.solution.fitted[term.name], solved.h[p])
    return tuple(found)


def _estimate(
    solved: CampaignSolution, p: int, window_weight: FloatArray, run_weight: FloatArray, source: PointSource
) -> tuple[DynamicStiffness | None, dict[str, FloatArray]]:
    """H of the solve with its budget; None where the runs do not tell it."""
    solution, means = solved.solution, solved.means[p]
    if not np.isfinite(solution.h[p]).all() or means.means is None:
        return None, {}
    budget = {"random": solution.records[p]}
    for name in RUN_TERMS:
        if name in solution.shares:
            budget[name] = solution.shares[name][p]
    mine = solved.blocks.point == p
    dof = solution.freedom(p, mine, 2 * float(np.median(solved.blocks.dof[mine])))
    if p in solved.mains:
        fit = solved.mains[p]
        budget["mains"] = fit.covariance
        dof = np.minimum(dof, fit.dof)
    random = np.sum(list(budget.values()), axis=0)
    common = {name: share[p] for name, share in solution.shares.items() if name not in RUN_TERMS}
    common = {name: share for name, share in common.items() if np.any(share)}
    if p in solved.in_cells:
        common["mains on the cells"] = solved.in_cells[p]
    weights = window_weight * run_weight[_run_index(source, window_weight)]
    omega = float(np.median(solved.blocks.omega[mine]))
    estimate = DynamicStiffness(
        solved.h[p],
        omega,
        random,
        dof,
        SOLVED,
        np.repeat(weights[:, None], 2, axis=1),
        (*means.status, *_status(means.condition, weights, int((run_weight > 0).sum()), means)),
        means.condition,
        float(solution.chi_square[p]),
        int(max(solution.spare[p], 0)),
        means.attenuation,
        np.sum(list(common.values()), axis=0) if common else np.zeros((8, 8)),
    )
    return estimate, {**budget, **common}


def _run_index(source: PointSource, window_weight: FloatArray) -> np.ndarray:
    index = source.data.run_index
    return index if len(index) == len(window_weight) else np.zeros(len(window_weight), dtype=int)


def _status(condition: float, weights: FloatArray, runs: int, means: PointMeans) -> tuple[Condition, ...]:
    counted = weights[means.usable] if len(weights) == len(means.usable) else weights
    wandering = 0 if means.means is None else means.means.wandering
    return (*fit_conditions(condition, counted, runs), *not_locked(wandering, runs))


def finished_point(task: PointTask, source: PointSource, share: PointShare) -> PointResult:
    """The point with every method, its uncertainties and what is to be said of it."""
    settings = task.settings
    recorded = source.data
    corrected = _corrected(recorded, task.means, share)
    table = phasor_table(corrected.D, corrected.F, corrected.run_index)
    solved = share.estimate or estimate_table(table, corrected.omega, SOLVED)
    by_method = all_methods(corrected, settings, {SOLVED: solved})
    if share.estimate is not None:
        by_method = {name: _with_common(est, share) for name, est in by_method.items()}
    if not settings.keep_weights:
        by_method = {name: _counted_only(est) for name, est in by_method.items()}
    best = by_method[settings.method]
    figures = point_figures(_without_shaft_remarks(corrected, share), settings, by_method, share.mains_in_cells)
    bent = change_conditions(share.film, share.amplitude_left, best, figures.amplitude, settings.clearance)
    checks = check_conditions(task.checked, [run.run for run in recorded.runs])
    missing = task.dry.missing(recorded.omega)
    conditions = merged(share.conditions, missing, bent, checks)
    figures = replace(figures, conditions=merged(figures.conditions, conditions))
    return _result(task, recorded, by_method, figures, share)


def _without_shaft_remarks(data: PointData, share: PointShare) -> PointData:
    """The point without its runs' own remarks on the shaft's line, where the solve has more to say of it."""
    if not share.shaft:
        return data
    runs = []
    for run in data.runs:
        kept = tuple(c for c in run.conditions if not str(c).endswith("X on excitation line"))
        runs.append(replace(run, conditions=kept))
    return replace(data, runs=tuple(runs))


def _corrected(data: PointData, task: MeansTask, share: PointShare) -> PointData:
    """The point's windows as they would be at the set point, without what is in the readings beside the motion."""
    z, _ = channel_windows(data, task)
    z = z * clock_turns(data, task, window_times(data))
    z = (z - share.shift[data.run_index]) / share.factor[data.run_index]
    D, F = vectors(z, data, task)
    F = F - np.einsum("nij,nj->ni", share.run_change[data.run_index], D)
    return replace(data, D=D, F=F)


def _with_common(est: DynamicStiffness, share: PointShare) -> DynamicStiffness:
    """Another method's estimate with what the campaign's runs and sensors share."""
    if share.estimate is None or est is share.estimate:
        return est
    wider = [share.budget[name] for name in (*RUN_TERMS, "mains") if name in share.budget]
    covariance = np.sum([est.covariance, *wider], axis=0)
    return replace(est, covariance=covariance, systematic=share.estimate.systematic)


def _counted_only(est: DynamicStiffness) -> DynamicStiffness:
    """The estimate with a verdict per window in place of its weights: 1 byte instead of 16."""
    return replace(est, weights=(est.weights.min(axis=1) >= REJECTED_WEIGHT)[:, None])


def _result(
    task: PointTask,
    data: PointData,
    by_method: dict[str, DynamicStiffness],
    figures: Figures,
    share: PointShare,
) -> PointResult:
    positions = data.mean_positions
    number = len(positions)
    spread = positions.std(axis=0, ddof=1) / np.sqrt(number) if number > 1 else np.full(2, np.nan)
    return PointResult(
        point=data.point,
        stiffness=by_method[task.settings.method],
        by_method=by_method,
        static_load_measured=float(np.linalg.norm(data.mean_loads.mean(axis=0))),
        position=positions.mean(axis=0),
        position_se=spread,
        temperatures=pad_means([task.temperatures.get(run.run, {}) for run in data.runs]),
        n_records=len(data.runs),
        n_windows=len(data.D),
        outlier_fraction=figures.outlier_fraction,
        coherence=figures.coherence,
        amplitude=figures.amplitude,
        quality=figures.conditions,
        rejected=figures.rejected,
        runs=tuple(run.run for run in data.runs),
        load_miss=share.miss,
        linearity=figures.linearity,
        inertia_corrected=data.runs[0].acceleration is not None,
        clearance=task.settings.clearance,
        budget=share.budget,
    )
