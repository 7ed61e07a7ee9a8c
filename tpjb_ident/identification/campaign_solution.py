"""Means of a campaign's points as blocks, and H of all of them by one solve, clocks and mains put right on the way.

Clocks of further devices are found as the solve goes on: whether there are any, and how fast they run.
Cells on a clock that is off by e turn against the probes by 2 pi f e per second, alike in all runs and at all lines in
proportion to their frequency. A beat or a wander of one device does neither. So a clock is supposed only where one
rate explains the slopes of all runs; where the manifest states clocks, they are as stated. Over a band its responses
turn as the windows of sines do.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.arrowhead import complex_matrix
from tpjb_ident.estimate.equation import Blocks, Rig, axes_of, film_force, mounted, sensors_of, stacked, vector
from tpjb_ident.estimate.noise import unbiased_noise
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.identification.point_means import PointMeans, point_means
from tpjb_ident.results.linearity import FilmChange, film_change
from tpjb_ident.runs.point_data import PointData, RunDigest
from tpjb_ident.runs.static_load import StaticLoads, missed_load, static_loads
from tpjb_ident.runtime.executors import Workers
from tpjb_ident.terms.clock import START, Clock
from tpjb_ident.terms.mains import MAINS_ON_LINE, MainsFit, fit_mains, force_pickup, force_pickup_spread, mains_pickup
from tpjb_ident.terms.registry import solve, solved_as_learnt

if TYPE_CHECKING:
    from tpjb_ident.identification.band_blocks import BandSolution


#: Standard errors beyond which a rate is one, and phase [rad] over a record from which it matters.
_CLEAR, _NOTABLE = 6.0, 2e-3
#: Probability below which one rate does not explain the runs' slopes.
_ONE_RATE = 1e-3
#: Share of the runs that tell it, those nearest to their median.
_USUAL = 0.8
#: Passes over the records in which the clocks' rates are found, at most, and phase [rad] over a record that the solve
#: puts right by itself.
_CLOCK_PASSES, _TURNED = 2, 1e-2


#: Of sines, or over bands.
Answer = TypeVar("Answer", "CampaignSolution", "BandSolution")


def solved_with_clocks(rig: Rig, rate: float, solve: Callable[[Rig], Answer]) -> Answer:
    """Solve, find the devices, and solve again with the rates of their clocks put right in the records.

    `rate` [Hz] of the records. Devices that the manifest states are taken at their times; one that was found started
    within a sample of the first.
    """
    answer = solve(rig)
    rig = with_found_devices(rig, answer.solution.blocks, START / rate)
    if rig.rates:
        answer = solve(rig)
    for _ in range(_CLOCK_PASSES if len({sensor.clock for sensor in rig.channels}) > 1 else 0):
        solution, blocks = answer.solution, answer.solution.blocks
        more = Clock(solution.rig, blocks).rates(solution.fitted[Clock.name].value)
        turn = max(map(abs, more.values())) * (2 * blocks.time * blocks.omega).max()
        if turn < _TURNED:
            break
        rates = {device: rig.rates.get(device, 0.0) + change for device, change in more.items()}
        rig = replace(rig, rates=rates)
        answer = solve(rig)
    return answer


def with_found_devices(rig: Rig, blocks: Blocks, start: float) -> Rig:
    """The rig, cells and accelerometers with devices of their own and their rates where their phases show them.

    They started within `start` [s] of the first, one deviation.
    """
    force = None if any(sensor.clock for sensor in rig.channels) else _rate(rig, blocks, "force")
    if force is None or not force.clear:
        return rig
    acceleration = _rate(rig, blocks, "acceleration")
    # too weak to tell: as a rule accelerometers are recorded with the cells
    devices, rates = {"force": "cells", "acceleration": "cells"}, {"cells": force.rate}
    if acceleration is not None and abs(acceleration.rate - force.rate) > _CLEAR * np.hypot(
        acceleration.error, force.error
    ):
        devices["acceleration"] = "accelerometers" if acceleration.clear else ""
        rates |= {"accelerometers": acceleration.rate} if acceleration.clear else {}
    sensors = []
    for s in rig.channels:
        clock = devices.get(s.quantity, "")
        sensors.append(replace(s, clock=clock, delay_uncertainty=s.delay_uncertainty or start) if clock else s)
    return replace(rig, channels=tuple(sensors), rates=rates)


class _Rate(NamedTuple):
    rate: float
    error: float  #: standard error
    clear: bool  #: whether it is a rate of its own


def _rate(rig: Rig, blocks: Blocks, quantity: str) -> _Rate | None:
    """Rate of a quantity's clock against the probes'; None where no one rate explains the runs."""
    rows, probes = rig.pick(quantity), rig.pick("displacement")
    usable = (blocks.windows > 3) & blocks.present[:, rows + probes].all(axis=1) & np.isnan(blocks.shaft)
    if not rows or usable.sum() < 2:
        return None
    turn, turn_error = _turning(blocks, rows)
    probe, probe_error = _turning(blocks, probes)
    rate, error = ((probe - turn) / blocks.omega)[usable], (np.hypot(turn_error, probe_error) / blocks.omega)[usable]
    # a run that slipped tells nothing of a rate
    near = np.argsort(np.abs(rate - np.median(rate)) / error)[: max(2, int(_USUAL * len(rate)))]
    weight = 1 / np.hypot(error, np.median(error)) ** 2
    middle, doubt = float(np.average(rate[near], weights=weight[near])), float(1 / np.sqrt(np.sum(weight)))
    alike = chdtrc(len(near), np.sum(((rate - middle)[near] / error[near]) ** 2)) > _ONE_RATE
    turned = float(np.median(np.abs(rate) * 2 * (blocks.omega * blocks.time)[usable]))
    return _Rate(middle, doubt, abs(middle) > _CLEAR * doubt and turned > _NOTABLE) if alike else None


def _turning(blocks: Blocks, rows: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Rate at which the phase of some sensors turns (n,) [rad/s], and its standard error (n,)."""
    z = blocks.z[:, rows]
    power = np.maximum(np.sum(np.abs(z) ** 2, axis=1), 1e-300)
    turning = np.sum(z.conj() * blocks.slope[:, rows], axis=1).imag / power
    noise = blocks.slope_noise[:, rows][:, :, rows]
    variance = np.einsum("ni,nij,nj->n", z.conj(), noise, z).real / 2 / power**2
    return turning, np.sqrt(np.maximum(variance, 0.0))


#: Degrees of freedom below which the noise of a point is taken together with the other points'.
_FREEDOM = 60.0
#: Error of a run's mean load where its windows do not tell, relative.
_LOAD_ERROR = 2e-4
#: Scatter of the force from run to run with which mains is fitted, at least.
_LEAST_SCATTER = 1e-3


def unstated(campaign: Campaign) -> Conditions:
    """Say which probes and cells have no uncertainty in the manifest."""
    names = [s.name for s in sensors_of(campaign) if s.quantity in VECTOR_QUANTITIES[:2] and s.uncertainty is None]
    text = f"no uncertainty in the manifest for {', '.join(names)}: their systematic part is left out"
    return holding((names, "calibration-uncertainty-unstated", text))


def campaign_blocks(
    points: Sequence[PointData], means: Sequence[PointMeans], misses: Sequence[ComplexArray], bent: FloatArray
) -> Blocks:
    """Stack the runs of all points; `bent` (P,)."""
    noises, freedoms = _pooled_noise(means, [data.runs[0].length for data in points])
    names: list[str] = []
    calibrations: list[dict[Hashable, int]] = [{} for _ in means[0].channels[0]]
    rows = []
    for p, (data, point, miss) in enumerate(zip(points, means, misses)):
        w = point.means
        for g, (run, line) in enumerate(zip(data.runs, data.lines)):
            if w is None or not w.count[g] > 0:
                continue
            channels = point.channels[g]
            load, loads = data.point.static_load, run.means("force")
            loads = loads[np.isfinite(loads).all(axis=1)]
            # standard error of the size of the run's mean cell force
            error = float(np.linalg.norm(loads.std(axis=0, ddof=1)) / np.sqrt(len(loads))) if len(loads) > 1 else 0.0
            row = channel_columns(channels, calibrations)
            row |= {
                "point": p,
                "run": len(names),
                "omega": 2 * np.pi * run.lines.driven[line],
                "z": w.mean[g] * row["present"],
                "noise": noises[p] / w.count[g],
                "dof": freedoms[p],
                "slope": w.slope[g],
                "slope_noise": (noises[p] + w.motion) / max(float(w.spread[g]), 1e-12),
                "windows": w.count[g],
                "time": w.time[g],
                "temperature": run.temperature,
                "film_temperature": run.film_temperature,
                "miss": missed_load(miss, [g]),
                "miss_error": error / load if load > 0 else _LOAD_ERROR,
                "shaft": point.shaft[g],
            }
            names.append(run.run)
            rows.append(row)
    return stacked([data.point for data in points], names, len(calibrations), rows, bent)


def channel_columns(channels: Sequence[Channel | None], tables: list[dict[Hashable, int]]) -> dict[str, Any]:
    """What a block's channels (m,) are; `tables` numbers the calibrations of each sensor, new ones join it."""
    numbers = []
    for channel, table in zip(channels, tables):
        numbers.append(0 if channel is None else table.setdefault(channel.calibration, len(table)))
    present = np.array([channel is not None for channel in channels])
    return {"present": present, "along": axes_of(channels), "calibration": numbers}


def _pooled_noise(means: Sequence[PointMeans], lengths: Sequence[float]) -> tuple[list[ComplexArray], FloatArray]:
    """Noise of a window at every point with its degrees of freedom; with few, the campaign's own noise joins in.

    What points share is the noise's density: that of a window goes with one over its length [s].
    """
    nothing = (0.0, np.zeros_like(means[0].residual[1]))
    own = [nothing if p.means is None else (p.means.spare, n * p.means.noise) for p, n in zip(means, lengths)]
    densities = own
    if sum(spare for spare, _ in own) < _FREEDOM:
        # too few windows in all the campaign: what the lines leave of the records tells the noise
        densities = own + [p.residual for p in means]
    total = sum(spare for spare, _ in densities)
    density = sum(spare * noise for spare, noise in densities) / max(total, 1.0)
    noises, freedoms = [], []
    for (spare, noise), length in zip(own, lengths):
        more = min(max(_FREEDOM - spare, 0.0), total - spare)
        freedom = max(spare + more, 1.0)
        noises.append(unbiased_noise((spare * noise + more * density) / freedom / length, freedom))
        freedoms.append(freedom)
    return noises, np.array(freedoms)


#: Standard deviations by which noise alone may be beyond its mean.
_CHANCE = 3.0


@dataclass(frozen=True, repr=False)
class CampaignSolution:
    """H of every point of a campaign, and what was put right on the way."""

    means: tuple[PointMeans, ...]
    loads: StaticLoads
    film: tuple[FilmChange, ...]
    solution: Solution
    mains: dict[int, MainsFit] = field(default_factory=dict)  #: by point
    in_cells: dict[int, FloatArray] = field(default_factory=dict)  #: by point, (8, 8): mains in the cells

    @cached_property
    def misfits(self) -> FloatArray:
        """Force of every block that H leaves, over its force, (n,)."""
        return misfits(self.solution)

    def run_difference(self, p: int) -> float:
        """Share of the force by which runs of point `p` differ, beyond what their noise alone makes of them."""
        counted = self.solution.blocks_of(p) & (self.solution.scatter.weights > 0)
        spare = counted.sum() - 2  # two runs fix H: what is left over is shared by all of them
        if spare < 1:
            return 0.0
        noise = np.mean(self._noise_power[counted]) * (1 + _CHANCE / np.sqrt(2 * spare))
        return float(np.sqrt(max(np.sum(self.misfits[counted] ** 2) / spare - noise, 0.0)))

    @cached_property
    def _noise_power(self) -> FloatArray:
        """Mean square of the misfits that noise alone has, (n,)."""
        solution, blocks, (_, F) = self.solution, self.solution.blocks, remainders(self.solution)
        units = [replace(blocks, z=solution.shift + unit) for unit in np.eye(blocks.z.shape[1])]
        by = np.stack([remainders(replace(solution, blocks=unit))[0] for unit in units], axis=2)
        variance = np.einsum("nij,njk,nik->n", by, blocks.noise, by.conj()).real
        return np.asarray(variance / np.linalg.norm(F, axis=1) ** 2)

    @property
    def h(self) -> ComplexArray:
        """H of every point at the frequency found, (P, 2, 2) [N/m]."""
        h = self.solution.h.copy()
        for p, fit in self.mains.items():
            h[p] = h[p] + complex_matrix(fit.shift)
        return h


def solve_campaign(
    campaign: Campaign, points: Sequence[PointData], digests: Sequence[RunDigest], workers: Workers, rig: Rig
) -> CampaignSolution:
    """Means of all points, clocks, one solve; where mains is on a line, its angles and the solve once more."""
    loads = static_loads(campaign, points)

    def solved(rig: Rig) -> CampaignSolution:
        means = tuple(workers.map(point_means, [(data,) for data in points], rig))
        film = tuple(film_change(data.film_lines, point.start) for data, point in zip(points, means))
        bent = np.array([change.share for change in film])
        blocks = campaign_blocks(points, means, loads.misses, bent)
        rig = mounted(loads.doubted(rig), blocks, campaign.mount, loads.common)
        start = np.array([point.start for point in means]) - rig.bare.at(np.array([data.omega for data in points]))
        solution = solved_as_learnt(rig, lambda rig: solve(rig, blocks, start))
        return CampaignSolution(means, loads, film, solution)

    rate = min((digest.sample_rate for digest in digests if digest.sample_rate > 0), default=np.inf)
    last = solved_with_clocks(rig, rate, solved)
    solution, blocks = last.solution, last.solution.blocks
    force = force_pickup([digest.mains_force for digest in digests])
    on_line = [p for p, data in enumerate(points) if data.says(MAINS_ON_LINE) and p in blocks.point]
    fits = _mains(on_line, digests, solution, force) if rig.to_set_point and on_line else {}
    if fits:
        shift, probes = np.zeros_like(blocks.z), solution.rig.pick("displacement")
        for p, fit in fits.items():
            rows = np.flatnonzero(blocks.point == p)[:, None], probes
            shift[rows] = np.einsum("nja,na->nj", blocks.along[rows], fit.pickup)
        again = solve(solution.rig, replace(blocks, z=blocks.z - shift), solution.h)
        last = replace(last, solution=replace(again, blocks=blocks, shift=again.shift + shift), mains=fits)
    D = vector(solution.rig, blocks, "displacement")
    in_cells = {p: force_pickup_spread(D[blocks.point == p], force) for p in on_line if force.any()}
    return replace(last, in_cells=in_cells)


def _mains(
    points: Sequence[int], digests: Sequence[RunDigest], solution: Solution, force: FloatArray
) -> dict[int, MainsFit]:
    """Angles of the mains at the points on whose line it is; `force` (2,): mains in the cells [N]."""
    rig, blocks = solution.rig, solution.blocks
    across = blocks.along[0, rig.pick("displacement")]
    pickup = mains_pickup([digest.mains for digest in digests], np.arctan2(across[:, 1], across[:, 0]))
    if pickup is None:
        return {}
    D, F = at_set_point(solution)
    free = ~np.isin(blocks.point, points) & np.isfinite(F).all(axis=1)
    typical = float(np.sqrt(np.nanmedian(misfits(solution)[free] ** 2 / 2 / np.log(2)))) if free.any() else 0.0
    fits = {}
    for p in points:
        mine = blocks.point == p
        usual = np.median(np.linalg.norm(F[mine], axis=1))
        in_cells = np.linalg.norm(force) / usual / np.sqrt(2)
        scatter = np.hypot(max(typical, _LEAST_SCATTER), in_cells if in_cells > typical else 0.0)
        fit = fit_mains(D[mine], F[mine], pickup, scatter) if np.isfinite(solution.h[p]).all() else None
        if fit is not None:
            fits[p] = fit
    return fits


def at_set_point(solution: Solution) -> tuple[ComplexArray, ComplexArray]:
    """Displacement and oil force (n, 2) of every block, as they would be at the set point."""
    rig, blocks = solution.rig, solution.blocks
    clean = replace(blocks, z=(blocks.z - solution.shift) / solution.factor)
    D = vector(rig, clean, "displacement")
    return D, film_force(rig, clean) - np.einsum("nij,nj->ni", solution.run_change, D)


def misfits(solution: Solution) -> FloatArray:
    """Force of every block that H leaves, over its force, (n,)."""
    residual, F = remainders(solution)
    return np.linalg.norm(residual, axis=1) / np.linalg.norm(F, axis=1)


def remainders(solution: Solution) -> tuple[ComplexArray, ComplexArray]:
    """Force of every block that H leaves, and the force at the set point, (n, 2) [N]."""
    D, F = at_set_point(solution)
    return F - np.einsum("nij,nj->ni", solution.h[solution.blocks.point], D), F


#: Terms whose uncertainty scatters with the runs: of points that each have runs of their own.
RUN_TERMS = ("load miss", "load direction")


def covariances_of(
    solution: Solution, point: int, by_run: Sequence[str] = ()
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Covariances (8, 8) of a point of a solve by source, random and shared ones; what scatters `by_run` is random."""
    shared = {name: share[point] for name, share in solution.shares.items() if np.any(share[point])}
    random = {"random": solution.records[point]}
    for name in by_run:
        if name in shared:
            random[name] = shared.pop(name)
    return random, shared


def total(covariances: Mapping[str, FloatArray]) -> FloatArray:
    """Sum of covariances (8, 8) by source."""
    return sum(covariances.values(), np.zeros((8, 8)))


def shared_changes(
    solution: Solution, points: Sequence[int], by_run: Sequence[str] = (), more: Mapping[str, FloatArray] | None = None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Changes (q, 8 P) of some points by all terms but points' own, and those that differ from point to point `by_run`.

    They are scaled so that the mean of the rows' products is their covariance [N/m]; with the names of the sources.
    `more`: one deviation (P, 8) of further sources by name.
    """
    rows, names, count = [], [], 0
    for term in solution.terms:
        for parameter in () if term.points else term.parameters:
            if term.name not in by_run:
                rows.append(count)
                names.append(f"{term.name}: {parameter.name}")
            count += 1
    further = more or {}
    names += further
    if not names:
        return np.zeros((1, 8 * len(points))), ()
    factors = np.concatenate([solution.factors[np.ix_(rows, points)], *(f[None] for f in further.values())])
    return factors.reshape(len(names), -1) * np.sqrt(len(names)), tuple(names)
