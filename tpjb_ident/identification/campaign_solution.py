"""The solve of a whole campaign: means of its points to H of all of them, clocks and mains put right on the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.dynamic.corrections.cell_zero import CellZero, cell_zero_uncertainty
from tpjb_ident.dynamic.corrections.static_load import LoadMiss, campaign_zero, load_misses
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, film_change
from tpjb_ident.dynamic.runs.finished_runs import RunDigest
from tpjb_ident.dynamic.runs.point_source import PointSource
from tpjb_ident.estimate.blocks import Blocks, Rig, RigStiffness, vector
from tpjb_ident.estimate.sensors import found_mount, sensors_of
from tpjb_ident.estimate.solve import Solution, Solver
from tpjb_ident.estimate.term import Term
from tpjb_ident.identification.campaign_blocks import campaign_blocks, run_temperatures, with_start
from tpjb_ident.identification.point_means import MeansTask, PointMeans, point_means, sensor_axes
from tpjb_ident.identification.unstated_clocks import with_found_devices
from tpjb_ident.runtime.executors import Workers, map_ordered
from tpjb_ident.terms.clock import START, Clock
from tpjb_ident.terms.gain import Gain
from tpjb_ident.terms.housing import Housing
from tpjb_ident.terms.load_turn import LoadTurn
from tpjb_ident.terms.mains import (
    MAINS_ON_LINE,
    MainsFit,
    Pickup,
    fit_mains,
    force_pickup,
    force_pickup_spread,
    mains_pickup,
)
from tpjb_ident.terms.registry import TERMS

#: Passes over the windows in which the clocks' rates are found.
_CLOCK_PASSES = 2
#: Scatter of the force from run to run with which mains is fitted, at least.
_LEAST_SCATTER = 1e-3


@dataclass(frozen=True)
class CampaignSolution:
    """H of every point of a campaign, and what was put right on the way."""

    rig: Rig
    task: MeansTask
    blocks: Blocks = field(repr=False)
    means: tuple[PointMeans, ...] = field(repr=False)
    misses: tuple[LoadMiss, ...] = field(repr=False)
    common: complex  #: cells over set points, all runs together
    zero: CellZero
    film: tuple[FilmChange, ...]
    solution: Solution = field(repr=False)
    pickup: Pickup | None
    mains: dict[int, MainsFit] = field(repr=False)  #: by point
    in_cells: dict[int, FloatArray] = field(repr=False)  #: by point, (8, 8): mains in the cells
    cell_pickup: float  #: N: mains in the cells
    mains_shift: ComplexArray = field(repr=False)  #: (n, m), SI: pick-up taken off the blocks' readings

    @property
    def h(self) -> ComplexArray:
        """H of every point at the frequency found, (P, 2, 2) [N/m]."""
        h = self.solution.h.copy()
        for p, fit in self.mains.items():
            h[p] = h[p] + fit.change
        return h


def solve_campaign(
    campaign: Campaign,
    sources: Sequence[PointSource],
    digests: Sequence[RunDigest],
    workers: Workers,
    correct: bool,
    bare: RigStiffness,
) -> CampaignSolution:
    """Means of all points, clocks, one solve; where mains is on a line, its angles and the solve once more."""
    sensors = sensors_of(campaign)
    temperatures = run_temperatures(campaign, [(digest.run, digest.temperatures) for digest in digests])
    task = MeansTask(sensors, sensor_axes(sensors, campaign), temperatures=temperatures)
    zero = campaign_zero(sources, cell_zero_uncertainty(campaign))
    misses, common = load_misses(sources, zero.force)
    offsets: dict[str, float] = {}
    for count in range(_CLOCK_PASSES + 1):
        means = tuple(map_ordered(workers, point_means, [(source,) for source in sources], task))
        film = tuple(_film(source, point) for source, point in zip(sources, means))
        bent = np.array([change.share for change in film])
        blocks = campaign_blocks(sources, means, misses, bent, temperatures)
        if count == 0:
            rate = min((digest.sample_rate for digest in digests if digest.sample_rate > 0), default=np.inf)
            devices = with_found_devices(sensors, blocks)
            # devices that the manifest states are taken at their times; one that was found started when nobody knows
            sensors = sensors if devices == sensors else with_start(devices, START / rate)
        mount = found_mount(sensors, blocks, getattr(campaign, "mount", None), common)
        rig = Rig(sensors, campaign.housing_mass, campaign.mass_uncertainty, mount, bare=bare, static=common != 0)
        if len({sensor.device for sensor in sensors}) == 1 or count == _CLOCK_PASSES:
            break
        rates = _clock_rates(rig, blocks, _starts(rig, sources, means))
        offsets = {device: offsets.get(device, 0.0) + rate for device, rate in rates.items()}
        task = replace(task, sensors=sensors, rates=offsets)
    start = _starts(rig, sources, means)

    def solved(rig: Rig, blocks: Blocks) -> Solution:
        used = [term for term in TERMS if correct or term is not LoadTurn]
        terms = [Clock(rig, blocks, offsets) if term is Clock else term(rig, blocks) for term in used]
        return Solver(rig, blocks, terms, start, correct).run()

    solution = solved(rig, blocks)
    learnt = learnt_rig(rig, solution)
    if learnt is not rig:
        rig, solution = learnt, solved(learnt, blocks)
    pickup, fits = _mains(sources, digests, rig, blocks, solution) if correct else (None, {})
    shift = np.zeros_like(blocks.z)
    if fits:
        shift = _mains_readings(rig, blocks, fits)
        solution = solved(rig, replace(blocks, z=blocks.z - shift))
    force = force_pickup([digest.mains_force for digest in digests])
    in_cells = _in_cells(sources, rig, blocks, force)
    size = float(np.linalg.norm(force))
    return CampaignSolution(
        rig, task, blocks, means, tuple(misses), common, zero, film, solution, pickup, fits, in_cells, size, shift
    )


def learnt_rig(rig: Rig, solution: Solution) -> Rig:
    """The rig, as uncertain as a solve shows it to be where that contradicts what is stated; itself where not."""
    return _with_gain_spread(_with_lag(rig, solution), solution)


def _with_lag(rig: Rig, solution: Solution) -> Rig:
    """The rig, its cells as uncertain in time as the housing shows them late, where the manifest says nothing."""
    housing = next((term for term in solution.terms if isinstance(term, Housing)), None)
    if housing is None or any(sensor.delay_uncertainty for sensor in rig.sensors):
        return rig
    lag = housing.lag_of_cells(solution.fitted[housing.name])
    if not lag:
        return rig
    sensors = tuple(replace(s, delay_uncertainty=lag) if s.quantity == "force" else s for s in rig.sensors)
    return _contradicted(replace(rig, sensors=sensors), housing, solution)


def _with_gain_spread(rig: Rig, solution: Solution) -> Rig:
    """The rig, gains of a quantity as uncertain as its channels show where they contradict what is stated."""
    gain = next((term for term in solution.terms if isinstance(term, Gain)), None)
    if gain is None:
        return rig
    spread = gain.spread(solution.fitted[gain.name])
    if not spread:
        return rig
    wide = {s.name: max(spread.get(s.quantity, 0.0), s.uncertainty or 0.0) or None for s in rig.sensors}
    sensors = tuple(replace(s, uncertainty=wide[s.name]) for s in rig.sensors)
    return _contradicted(replace(rig, sensors=sensors), gain, solution)


def _contradicted(rig: Rig, term: Term, solution: Solution) -> Rig:
    """The rig, with what a term's test said of sensors that are now taken as more uncertain."""
    return replace(rig, contradicted={**rig.contradicted, term.name: term.conditions(solution.fitted[term.name])})


def _film(source: PointSource, point: PointMeans) -> FilmChange:
    pairs = [digest.harmonics[line] for digest, line in zip(source.digests, source.data.lines) if digest.harmonics]
    return film_change([pair for pair in pairs if pair is not None], point.start)


def _starts(rig: Rig, sources: Sequence[PointSource], means: Sequence[PointMeans]) -> ComplexArray:
    """H of the film to start from at every point, (P, 2, 2) [N/m]."""
    omega = np.array([source.data.omega for source in sources])
    return np.array([point.start for point in means]) - rig.bare.at(omega)


def _clock_rates(rig: Rig, blocks: Blocks, start: ComplexArray) -> dict[str, float]:
    """Rates of the devices' clocks that the blocks show, relative."""
    clock = Clock(rig, blocks)
    fitted = Solver(rig, blocks, [Gain(rig, blocks), clock, Housing(rig, blocks)], start).run().fitted
    return clock.rates(fitted[clock.name].value)


def _mains(
    sources: Sequence[PointSource],
    digests: Sequence[RunDigest],
    rig: Rig,
    blocks: Blocks,
    solution: Solution,
) -> tuple[Pickup | None, dict[int, MainsFit]]:
    """Angles of the mains at every point on whose line it is."""
    coincident = [p for p, source in enumerate(sources) if source.found(MAINS_ON_LINE)]
    if not coincident:
        return None, {}
    across = blocks.along[0, rig.of("displacement")]
    pickup = mains_pickup([digest.mains for digest in digests], np.arctan2(across[:, 1], across[:, 0]))
    if pickup is None:
        return None, {}
    D, F = at_set_point(rig, blocks, solution)
    free = ~np.isin(blocks.point, coincident) & np.isfinite(F).all(axis=1)
    residual = F - np.einsum("nij,nj->ni", solution.h[blocks.point], D)
    share = np.sum(np.abs(residual) ** 2, axis=1) / 2 / np.sum(np.abs(F) ** 2, axis=1)
    typical = float(np.sqrt(np.nanmedian(share[free]) / np.log(2))) if free.any() else _LEAST_SCATTER
    force = force_pickup([digest.mains_force for digest in digests])
    fits = {}
    for p in coincident:
        mine = blocks.point == p
        usual = float(np.median(np.linalg.norm(F[mine], axis=1))) if mine.any() else 1.0
        in_cells = float(np.linalg.norm(force)) / usual / np.sqrt(2)
        scatter = float(np.hypot(max(typical, _LEAST_SCATTER), in_cells if in_cells > typical else 0.0))
        fit = fit_mains(D[mine], F[mine], pickup, scatter) if np.isfinite(solution.h[p]).all() else None
        if fit is not None:
            fits[p] = fit
    return pickup, fits


def at_set_point(rig: Rig, blocks: Blocks, solution: Solution) -> tuple[ComplexArray, ComplexArray]:
    """Displacement and oil force (n, 2) of every block, as they would be at the set point."""
    clean = replace(blocks, z=(blocks.z - solution.shift) / solution.factor)
    D, F = vector(rig, clean, "displacement"), vector(rig, clean, "force")
    if len(rig.of("acceleration")) > 1:
        F = F + rig.mass * np.nan_to_num(vector(rig, clean, "acceleration"))
    return D, F - np.einsum("nij,nj->ni", solution.run_change, D)


def _mains_readings(rig: Rig, blocks: Blocks, fits: Mapping[int, MainsFit]) -> ComplexArray:
    """Pick-up of the probes, (n, m) [m]."""
    shift = np.zeros_like(blocks.z)
    probes = rig.of("displacement")
    for p, fit in fits.items():
        places = np.flatnonzero(blocks.point == p)
        shift[np.ix_(places, probes)] = np.einsum("nja,na->nj", blocks.along[np.ix_(places, probes)], fit.pickup)
    return shift


def _in_cells(sources: Sequence[PointSource], rig: Rig, blocks: Blocks, size: FloatArray) -> dict[int, FloatArray]:
    """Covariance (8, 8) by point of mains in the cells, whose phase is another one in every run; `size` (2,) [N]."""
    if not size.any():
        return {}
    D = vector(rig, blocks, "displacement")
    spreads = {}
    for p, source in enumerate(sources):
        mine = blocks.point == p
        if source.found(MAINS_ON_LINE) and mine.any():
            spreads[p] = force_pickup_spread(D[mine], size)
    return spreads
