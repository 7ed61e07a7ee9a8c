"""The solve of a whole campaign: means of its points to H of all of them, clocks and mains put right on the way."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.estimate.blocks import Blocks, Rig, RigStiffness, Sensor, film_force, vector
from tpjb_ident.estimate.sensors import campaign_rig, sensors_of
from tpjb_ident.estimate.shape import complex_matrix
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.identification.campaign_blocks import campaign_blocks, run_temperatures
from tpjb_ident.identification.clocks import solved_with_clocks
from tpjb_ident.identification.point_means import MeansTask, PointMeans, point_means
from tpjb_ident.results.linearity import FilmChange, film_change
from tpjb_ident.runs.finished_runs import RunDigest
from tpjb_ident.runs.point_data import PointData
from tpjb_ident.runs.static_load import StaticLoads, static_loads
from tpjb_ident.runtime.executors import Workers
from tpjb_ident.terms.mains import (
    MAINS_ON_LINE,
    MainsFit,
    Pickup,
    fit_mains,
    force_pickup,
    force_pickup_spread,
    mains_pickup,
)
from tpjb_ident.terms.registry import solve, solved_as_learnt

#: Scatter of the force from run to run with which mains is fitted, at least.
_LEAST_SCATTER = 1e-3


@dataclass(frozen=True)
class CampaignSolution:
    """H of every point of a campaign, and what was put right on the way."""

    task: MeansTask
    means: tuple[PointMeans, ...] = field(repr=False)
    loads: StaticLoads = field(repr=False)
    film: tuple[FilmChange, ...]
    solution: Solution = field(repr=False)
    mains_shift: ComplexArray = field(repr=False)  #: (n, m), SI: pick-up taken off the blocks' readings
    pickup: Pickup | None = None
    mains: dict[int, MainsFit] = field(default_factory=dict, repr=False)  #: by point
    in_cells: dict[int, FloatArray] = field(default_factory=dict, repr=False)  #: by point, (8, 8): mains in the cells

    @cached_property
    def misfits(self) -> FloatArray:
        """Force of every block that H leaves, over its force, (n,)."""
        return misfits(self.solution)

    @property
    def h(self) -> ComplexArray:
        """H of every point at the frequency found, (P, 2, 2) [N/m]."""
        h = self.solution.h.copy()
        for p, fit in self.mains.items():
            h[p] = h[p] + complex_matrix(fit.shift)
        return h


def solve_campaign(
    campaign: Campaign,
    points: Sequence[PointData],
    digests: Sequence[RunDigest],
    workers: Workers,
    correct: bool,
    bare: RigStiffness,
) -> CampaignSolution:
    """Means of all points, clocks, one solve; where mains is on a line, its angles and the solve once more."""
    sensors = sensors_of(campaign)
    temperatures = run_temperatures(campaign, [(digest.run, digest.temperatures) for digest in digests])
    common = MeansTask(sensors, temperatures=temperatures)
    loads = static_loads(campaign, points)

    def solved(sensors: tuple[Sensor, ...], rates: Mapping[str, float]) -> CampaignSolution:
        task = replace(common, sensors=sensors, rates=rates)
        means = tuple(workers.map(point_means, [(data,) for data in points], task))
        film = tuple(_film(data, point) for data, point in zip(points, means))
        bent = np.array([change.share for change in film])
        blocks = campaign_blocks(points, means, loads.misses, bent, temperatures)
        rig = campaign_rig(
            campaign, loads.doubted(sensors), blocks, loads.common, bare=bare, rates=rates, to_set_point=correct
        )
        start = np.array([point.start for point in means]) - bare.at(np.array([data.omega for data in points]))
        solution = solved_as_learnt(rig, lambda rig: solve(rig, blocks, start))
        return CampaignSolution(task, means, loads, film, solution, np.zeros_like(blocks.z))

    rate = min((digest.sample_rate for digest in digests if digest.sample_rate > 0), default=np.inf)
    last = solved_with_clocks(sensors, rate, solved)
    solution, blocks = last.solution, last.solution.blocks
    force = force_pickup([digest.mains_force for digest in digests])
    on_line = [p for p, data in enumerate(points) if data.says(MAINS_ON_LINE) and p in blocks.point]
    pickup, fits = _mains(on_line, digests, solution, force) if correct and on_line else (None, {})
    if fits:
        shift = _mains_readings(solution.rig, blocks, fits)
        again = solve(solution.rig, replace(blocks, z=blocks.z - shift), solution.h)
        last = replace(last, solution=again, mains_shift=shift, pickup=pickup, mains=fits)
    D = vector(solution.rig, blocks, "displacement")
    in_cells = {p: force_pickup_spread(D[blocks.point == p], force) for p in on_line if force.any()}
    return replace(last, in_cells=in_cells)


def _film(data: PointData, point: PointMeans) -> FilmChange:
    lines = [digest.harmonics[line] for digest, line in zip(data.digests, data.lines) if digest.harmonics]
    return film_change([line for line in lines if line is not None], point.start)


def _mains(
    points: Sequence[int], digests: Sequence[RunDigest], solution: Solution, force: FloatArray
) -> tuple[Pickup | None, dict[int, MainsFit]]:
    """Angles of the mains at the points on whose line it is; `force` (2,): mains in the cells [N]."""
    rig, blocks = solution.rig, solution.blocks
    across = blocks.along[0, rig.of("displacement")]
    pickup = mains_pickup([digest.mains for digest in digests], np.arctan2(across[:, 1], across[:, 0]))
    if pickup is None:
        return None, {}
    D, F = at_set_point(solution)
    free = ~np.isin(blocks.point, points) & np.isfinite(F).all(axis=1)
    typical = float(np.sqrt(np.nanmedian(misfits(solution)[free] ** 2 / 2 / np.log(2)))) if free.any() else 0.0
    fits = {}
    for p in points:
        mine = blocks.point == p
        usual = float(np.median(np.linalg.norm(F[mine], axis=1)))
        in_cells = float(np.linalg.norm(force)) / usual / np.sqrt(2)
        scatter = float(np.hypot(max(typical, _LEAST_SCATTER), in_cells if in_cells > typical else 0.0))
        fit = fit_mains(D[mine], F[mine], pickup, scatter) if np.isfinite(solution.h[p]).all() else None
        if fit is not None:
            fits[p] = fit
    return pickup, fits


def at_set_point(solution: Solution) -> tuple[ComplexArray, ComplexArray]:
    """Displacement and oil force (n, 2) of every block, as they would be at the set point."""
    rig, blocks = solution.rig, solution.blocks
    clean = replace(blocks, z=(blocks.z - solution.shift) / solution.factor)
    D = vector(rig, clean, "displacement")
    return D, film_force(rig, clean) - np.einsum("nij,nj->ni", solution.run_change, D)


def misfits(solution: Solution) -> FloatArray:
    """Force of every block that H leaves, over its force, (n,)."""
    D, F = at_set_point(solution)
    residual = F - np.einsum("nij,nj->ni", solution.h[solution.blocks.point], D)
    return np.linalg.norm(residual, axis=1) / np.linalg.norm(F, axis=1)


def _mains_readings(rig: Rig, blocks: Blocks, fits: Mapping[int, MainsFit]) -> ComplexArray:
    """Pick-up of the probes, (n, m) [m]."""
    shift = np.zeros_like(blocks.z)
    probes = rig.of("displacement")
    for p, fit in fits.items():
        places = np.flatnonzero(blocks.point == p)
        shift[np.ix_(places, probes)] = np.einsum("nja,na->nj", blocks.along[np.ix_(places, probes)], fit.pickup)
    return shift
