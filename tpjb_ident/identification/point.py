"""One operating point of a solved campaign: H with its budget, every other method beside it, figures and flags."""

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions
from tpjb_ident.conditions import Conditions, holding, merged
from tpjb_ident.estimators.estimate import REJECTED_WEIGHT, estimate_table, fit_conditions, method_of, not_locked
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.campaign_solution import RUN_TERMS, CampaignSolution, covariances_of, total
from tpjb_ident.identification.point_means import channel_windows, means_attenuation, vectors
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.run_data import RunPhasors, complex_median
from tpjb_ident.results.linearity import FilmChange, amplitude_slope, change_conditions
from tpjb_ident.results.point_result import (
    PointResult,
    amplitude,
    coherence,
    differing_runs,
    directional_pattern,
    flags,
    of_runs,
    rejected_windows,
)
from tpjb_ident.runs.point_data import PointData
from tpjb_ident.runs.run_jobs import DryTest

#: Name of the method that the solve stands for in the tables.
SOLVED = "mm-eiv"
#: Windows that a run needs, for its mean to be nearly free of each window's own noise.
_MIN_WINDOWS = 5
#: Smallest sine of the angle between two excitation directions that counts as two.
_MIN_SINE = 0.1


@dataclass(frozen=True)
class PointShare:
    """One point with what the solve of the campaign says of it."""

    #: its windows as they would be at the set point, without what is in the readings beside the motion
    data: PointData
    estimate: DynamicStiffness | None
    budget: dict[str, FloatArray]
    conditions: Conditions
    checks: Conditions
    miss: ComplexArray
    film: FilmChange


def point_share(solved: CampaignSolution, data: PointData, p: int, dry: DryTest, checks: Conditions) -> PointShare:
    """The part of a campaign's solution that belongs to point `p`; `checks`: what is known of its runs beforehand."""
    solution, blocks = solved.solution, solved.solution.blocks
    runs, m = len(data.runs), len(solution.rig)
    shift, factor = np.zeros((runs, m), complex), np.ones((runs, m), complex)
    change, weight = np.zeros((runs, 2, 2), complex), np.zeros(runs)
    mine = np.flatnonzero(blocks.point == p)
    g = [data.names.index(blocks.runs[run]) for run in blocks.run[mine]]
    shift[g], factor[g] = solution.shift[mine], solution.factor[mine]
    change[g], weight[g] = solution.run_change[mine], solution.scatter.weights[mine]
    estimate, budget = _estimate(solved, p, weight, data)
    if solved.means[p].shaft_conditions:  # more than runs say of the shaft on their lines
        data = replace(data, runs=tuple(map(_without_shaft, data.runs)))
    z, _ = channel_windows(data, solution.rig)
    D, F = vectors((z - shift[data.run_index]) / factor[data.run_index], data, solution.rig)
    corrected = replace(data, D=D, F=F - np.einsum("nij,nj->ni", change[data.run_index], D))
    miss, film = solved.loads.misses[p], solved.film[p]
    conditions = *_conditions(solved, p), *dry.missing(data.omega)
    return PointShare(corrected, estimate, budget, conditions, checks, miss, film)


def _without_shaft(run: RunPhasors) -> RunPhasors:
    return replace(run, conditions=tuple(c for c in run.conditions if not c.endswith("X on excitation line")))


def _conditions(solved: CampaignSolution, p: int) -> Conditions:
    conditions = [*differing_runs(solved.run_difference(p)), *solved.loads.conditions(p), *solved.solution.conditions()]
    if p in solved.mains:
        conditions.append(solved.mains[p].condition())
    conditions += solved.means[p].shaft_conditions
    for term in solved.solution.terms:
        conditions += term.point_conditions(p, solved.solution.fitted[term.name], solved.h[p])
    return tuple(conditions)


def _estimate(
    solved: CampaignSolution, p: int, run_weight: FloatArray, data: PointData
) -> tuple[DynamicStiffness | None, dict[str, FloatArray]]:
    """H of the solve with its budget; None where the runs do not tell it."""
    solution, means = solved.solution, solved.means[p]
    windows = means.means
    if not np.isfinite(solution.h[p]).all() or windows is None:
        return None, {}
    random, shared = covariances_of(solution, p, RUN_TERMS)
    freedom = solution.freedom(p)
    if p in solved.mains:
        random["mains"] = solved.mains[p].covariance
        freedom = np.minimum(freedom, solved.mains[p].dof)
    if p in solved.in_cells:
        shared["mains on the cells"] = solved.in_cells[p]
    weights = windows.weights * run_weight[data.run_index]
    runs = int((run_weight > 0).sum())
    flags = fit_conditions(means.condition, weights[data.whole], runs)
    estimate = DynamicStiffness(
        solved.h[p],
        float(np.median(solution.blocks.omega[solution.blocks_of(p)])),
        total(random),
        freedom,
        SOLVED,
        np.repeat(weights[:, None], 2, axis=1),
        (*means.status, *flags, *not_locked(windows.wandering, runs)),
        means.condition,
        float(solution.chi_square[p]),
        int(max(solution.spare[p], 0)),
        means_attenuation(windows, solution.rig),
        total(shared),
    )
    return estimate, random | shared


def finished_point(settings: IdentifySettings, share: PointShare) -> PointResult:
    """The point with every method, its uncertainties and what is to be said of it."""
    data = share.data
    by_method = all_methods(data, settings, share.estimate)
    if not settings.keep_weights:  # a verdict per window in place of its weights: 1 byte instead of 16
        for name, est in by_method.items():
            by_method[name] = replace(est, weights=(est.weights.min(axis=1) >= REJECTED_WEIGHT)[:, None])
    best = by_method[settings.method]
    weights = best.weights.min(axis=1)
    size, coherent = amplitude(data, weights), coherence(data.D, data.F, best.h, weights)
    linearity = amplitude_slope(data, best.h, weights)
    conditions = merged(
        *(run.conditions for run in data.runs),
        best.status,
        flags(data, best, coherent),
        directional_pattern(data, weights),
        linearity.condition(),
        disagreement(by_method, settings.method),
        share.conditions,
        change_conditions(share.film, share.budget, best, size, settings.clearance),
        share.checks,
    )
    return PointResult(
        **of_runs(data),
        point=data.point,
        stiffness=best,
        by_method=by_method,
        n_windows=len(data.D),
        outlier_fraction=float((weights < REJECTED_WEIGHT).mean()),
        coherence=coherent,
        amplitude=size,
        quality=conditions,
        rejected=rejected_windows(data, best.h, weights),
        load_miss=share.miss,
        linearity=linearity,
        clearance=settings.clearance,
        budget=share.budget,
    )


def all_methods(
    data: PointData, settings: IdentifySettings, solved: DynamicStiffness | None
) -> dict[str, DynamicStiffness]:
    """Every method that was asked for and applies; the solve's is there where it has an answer, and its scatter."""
    drive = _nominal_drive(data)
    table = phasor_table(data.D, data.F, data.run_index, drive)
    estimates = {}
    for name in dict.fromkeys((*settings.methods, settings.method)):
        method, norm = method_of(name)
        if name == SOLVED and solved is not None:
            estimates[name] = solved
        elif method != "iv" or drive is not None or settings.method == "iv":
            estimates[name] = estimate_table(table, data.omega, method, norm, solved)
    return estimates


def disagreement(by_method: dict[str, DynamicStiffness], default: str) -> Conditions:
    """Say which methods differ from the default beyond both intervals."""
    best = by_method[default]
    conditions = []
    for name, estimate in by_method.items():
        if name == default or not (np.isfinite(estimate.h).all() and np.isfinite(best.h).all()):
            continue
        gap = np.abs(estimate.vector - best.vector)
        room = np.hypot(estimate.half_width(systematic=False), best.half_width(systematic=False))
        if (gap > room).any():
            worst = np.argmax(gap / room)
            conditions.append(f"{name} ({gap[worst] / room[worst]:.1f} times the interval)")
    return holding((conditions, "methods-disagree", f"{', '.join(conditions)} away from {default}"))


def _nominal_drive(data: PointData) -> ComplexArray | None:
    """Instruments (n, 2) [N] of one point's windows; None where the campaign cannot give them.

    The format has no channel for the actuators' command. But every run states the direction of its excitation, and the
    part of its own mean force along that direction has the size and phase of the command: averaged over the run's
    windows it knows next to nothing of a single window's noise, and nothing of the displacements' noise.
    """
    angles = np.array([run.direction for run in data.runs], dtype=float)
    if not np.abs(np.sin(angles - angles[0])).max() >= _MIN_SINE:  # or one is not stated
        return None
    drives = []
    for i, along in enumerate(directions(angles)):
        sizes = data.F[data.run_index == i] @ along
        sizes = sizes[np.isfinite(sizes)]
        if len(sizes) < _MIN_WINDOWS:
            return None
        drives.append(complex_median(sizes) * along)
    return np.array(drives)[data.run_index]
