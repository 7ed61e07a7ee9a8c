"""A campaign's broadband runs to h over frequency: the whole path, all operating points in one solve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import merged
from tpjb_ident.estimate.blocks import RigStiffness, Sensor
from tpjb_ident.estimate.sensors import campaign_rig, sensors_of
from tpjb_ident.identification.band_blocks import band_blocks
from tpjb_ident.identification.band_conditions import band_conditions, run_conditions
from tpjb_ident.identification.band_point import BandPoint, band_groups, read_point
from tpjb_ident.identification.band_solution import solve_bands
from tpjb_ident.identification.band_tables import SolvedBands, band_results
from tpjb_ident.identification.campaign_blocks import run_temperatures, unstated
from tpjb_ident.identification.clocks import solved_with_clocks
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.results.identification import Identification
from tpjb_ident.runs.checked_runs import campaign_verdicts, check_conditions
from tpjb_ident.runs.finished_runs import ExcludedRun, excluded_runs, without_runs
from tpjb_ident.runs.run_jobs import Progress
from tpjb_ident.runs.static_load import static_loads
from tpjb_ident.terms.registry import cell_stiffness


def identify_bands(
    campaign: Campaign, settings: IdentifySettings, progress: Progress, bare: RigStiffness
) -> Identification:
    """Identify every operating point of a campaign that was excited over a band."""
    runs = tuple(run for run in campaign.of_kind("dynamic") if is_broadband(run))
    observations = []
    for done, run in enumerate(runs):
        progress(run.id, done, len(runs))
        observations.append(observe(run))
    checked = campaign_verdicts(campaign, observations)
    unusable = [
        ExcludedRun(r.id, r.point, RigDataError(checked.unusable[r.id])) for r in runs if r.id in checked.unusable
    ]
    groups = band_groups(tuple(run for run in runs if run.id not in checked.unusable))

    def solve(sensors: tuple[Sensor, ...], rates: Mapping[str, float]) -> SolvedBands:
        fast = {sensor.name: rates[sensor.device] for sensor in sensors if sensor.device in rates}
        points, bad = [], list(unusable)
        for group in groups:
            point, without = read_point(group, campaign.housing_mass, settings.phasors, fast)
            points += [] if point is None else [point]
            bad += without
        if not points:
            raise bad[0].error
        return replace(_solved(campaign, points, sensors, rates, settings, bare), excluded=tuple(bad))

    solved = solved_with_clocks(sensors_of(campaign), min(run.sample_rate for run in runs), solve)
    points, bad = solved.points, solved.excluded
    quality = []
    for b, point in enumerate(points):
        of_runs = solved.loads.conditions(b), check_conditions(checked, point.runs)
        without = without_runs(point.point, bad, any_excitation=True)
        of_band = run_conditions(point, solved.first), band_conditions(point, solved, b)
        quality.append(merged(*of_runs, without, *of_band))
    results, changes, names = band_results(solved, quality, settings.clearance)
    places = [point.point for point in points]
    named = excluded_runs(bad, len(runs), places, any_excitation=True, kind="run over a band") + unstated(campaign)
    identified = tuple(point for band in results for point in band.points)
    springs = cell_stiffness(solved.first.part)
    return Identification(campaign.id, settings.method, identified, changes, named, results, names, springs)


def _solved(
    campaign: Campaign,
    points: Sequence[BandPoint],
    sensors: tuple[Sensor, ...],
    rates: Mapping[str, float],
    settings: IdentifySettings,
    bare: RigStiffness,
) -> SolvedBands:
    """All bands solved, twice where there is no instrument: all noise the force's, then all the displacement's."""
    loads = static_loads(campaign, points)
    temperatures = run_temperatures(campaign, [(s.phasors.run, s.temperatures) for p in points for s in p.spectra])
    data, solutions = [], []
    for turn in range(2 if any(point.method == "hv" for point in points) else 1):
        data.append(band_blocks(points, sensors, loads.misses, temperatures, settings.clearance, turn))
        rig = campaign_rig(campaign, sensors, data[-1].blocks, loads.common, bare)
        solutions.append(solve_bands(rig, data[-1], settings.correct, rates))
    return SolvedBands(tuple(points), loads, data[0], tuple(solutions))
