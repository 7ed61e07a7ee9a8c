"""A campaign's broadband runs to h over frequency: the whole path, all operating points in one solve."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.classic import ClassicLine, classic_line
from tpjb_ident.dynamic.broadband.run_spectra import OPEN_ENDS, is_broadband
from tpjb_ident.dynamic.corrections.static_load import StaticLoads, static_loads
from tpjb_ident.dynamic.results.band_result import BandResult
from tpjb_ident.dynamic.runs.checked_runs import campaign_verdicts, check_conditions
from tpjb_ident.dynamic.runs.excluded_runs import ExcludedRun, lost_points, named_runs, without_runs
from tpjb_ident.estimate.blocks import Rig, RigStiffness, Sensor
from tpjb_ident.estimate.sensors import found_mount, sensors_of
from tpjb_ident.identification.band_blocks import STRONG, BandBlocks, band_blocks
from tpjb_ident.identification.band_conditions import band_conditions, run_conditions
from tpjb_ident.identification.band_point import BandPoint, BandSettings, band_groups, read_point
from tpjb_ident.identification.band_solution import BandSolution, solve_bands
from tpjb_ident.identification.band_tables import SolvedBands, band_result, shared_by_bands
from tpjb_ident.identification.campaign_blocks import run_temperatures, unstated
from tpjb_ident.identification.shared_changes import SharedChanges
from tpjb_ident.terms.clock import START

Progress = Callable[[str, int, int], None]
#: What each method takes for the source of motion; without an instrument first one, then the other of these.
_INSTRUMENTS = {"periods": ("periods", "periods"), "iv": ("command", "command"), "hv": ("displacement", "force")}
#: Coherence of the force with the displacements that a line needs where nothing else tells signal from noise.
_LEAST_COHERENCE = 0.5


@dataclass(frozen=True)
class IdentifiedBands:
    """What a campaign's broadband runs give."""

    results: tuple[BandResult, ...]
    shared: SharedChanges = field(repr=False)
    conditions: tuple[Condition, ...] = ()


def identify_bands(
    campaign: Campaign, settings: BandSettings, progress: Progress, bare: RigStiffness
) -> IdentifiedBands:
    """Identify every operating point of a campaign that was excited over a band."""
    runs = tuple(run for run in campaign.of_kind("dynamic") if is_broadband(run))
    seen = list(_observed(runs, progress))
    checked = campaign_verdicts(campaign, seen)
    remaining = [
        ExcludedRun(r.id, r.point, RigDataError(checked.unusable[r.id])) for r in runs if r.id in checked.unusable
    ]
    points: list[BandPoint] = []
    for group in band_groups(tuple(run for run in runs if run.id not in checked.unusable)):
        point, bad = read_point(group, campaign.housing_mass, settings)
        remaining += bad
        points += [] if point is None else [point]
    if not points:
        raise remaining[0].error
    loads = static_loads(campaign, points)
    solved = _solved(campaign, points, loads, settings, bare)
    results = []
    for b, point in enumerate(points):
        conditions = merged(
            loads.conditions(b),
            check_conditions(checked, [s.phasors.run for s in point.spectra]),
            without_runs(point.point, remaining, any_excitation=True),
            run_conditions(point, solved.first),
            band_conditions(point, solved, b),
        )
        results.append(band_result(solved, b, loads.misses[b], conditions, settings.clearance))
    lost = lost_points([point.point for point in points], remaining, any_excitation=True, kind="run over a band")
    named = named_runs(remaining, len(runs)) + lost + unstated(campaign)
    return IdentifiedBands(tuple(results), shared_by_bands(solved), named)


def _observed(runs: tuple[Run, ...], progress: Progress) -> Iterator[Observation]:
    for done, run in enumerate(runs):
        progress(run.id, done, len(runs))
        yield observe(run)


def _solved(
    campaign: Campaign,
    points: list[BandPoint],
    loads: StaticLoads,
    settings: BandSettings,
    bare: RigStiffness,
) -> SolvedBands:
    """All bands solved, twice where there is no instrument: all noise the force's, then all the displacement's."""
    sensors = _sensors(campaign, points)
    classic = [_classic(point, k) for point in points for k in range(len(point.plan.groups))]
    measured = [(s.phasors.run, s.temperatures) for point in points for s in point.spectra]
    temperatures = run_temperatures(campaign, measured)
    passes = 2 if any(point.method == "hv" for point in points) else 1
    solutions: list[BandSolution] = []
    data: BandBlocks | None = None
    for turn in range(passes):
        instruments = [_INSTRUMENTS[point.method][turn] for point in points]
        own = band_blocks(points, sensors, loads.misses, temperatures, instruments)
        own = own.with_film(points, settings.clearance) if settings.clearance else own
        rig = Rig(sensors, campaign.housing_mass, campaign.mass_uncertainty, bare=bare, static=loads.common != 0)
        mount = found_mount(sensors, own.blocks, getattr(campaign, "mount", None), loads.common)
        solutions.append(solve_bands(replace(rig, mount=mount), own, settings.correct, _told(points, own, classic)))
        data = data or own
    assert data is not None
    return SolvedBands(tuple(points), data, tuple(classic), tuple(solutions))


def _told(points: Sequence[BandPoint], data: BandBlocks, classic: Sequence[ClassicLine]) -> np.ndarray:
    """Lines whose excitation stands clear of the noise, (L,)."""
    quiet = np.array([points[b].method == "hv" for b in data.band], dtype=bool)
    coherence = np.array([float(np.min(line.coherence)) for line in classic])
    return np.where(quiet, np.nan_to_num(coherence) > _LEAST_COHERENCE, data.strength > STRONG)


def _classic(point: BandPoint, k: int) -> ClassicLine:
    return classic_line(point.spectra, point.plan.bins(k), point.group.kind in OPEN_ENDS)


def _sensors(campaign: Campaign, points: Sequence[BandPoint]) -> tuple[Sensor, ...]:
    """The campaign's sensors; quantities whose clocks were put right started within a sample of the probes."""
    spectra = [s for point in points for s in point.spectra]
    apart = frozenset().union(*(s.clocks for s in spectra))
    rate = min(run.sample_rate for point in points for run in point.group.runs)
    sensors = []
    for sensor in sensors_of(campaign):
        late = sensor.quantity in apart and not sensor.delay_uncertainty
        sensors.append(replace(sensor, delay_uncertainty=START / rate, device="cells") if late else sensor)
    return tuple(sensors)
