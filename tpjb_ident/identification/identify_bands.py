"""A campaign's broadband runs to h over frequency: the whole path, all operating points in one solve."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.bands.classic import ClassicLine, classic_line
from tpjb_ident.bands.run_spectra import OPEN_ENDS, is_broadband
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import merged
from tpjb_ident.estimate.blocks import RigStiffness, Sensor
from tpjb_ident.estimate.sensors import campaign_rig, sensors_of
from tpjb_ident.identification.band_blocks import STRONG, BandBlocks, band_blocks
from tpjb_ident.identification.band_conditions import band_conditions, run_conditions
from tpjb_ident.identification.band_point import BandPoint, band_groups, read_point
from tpjb_ident.identification.band_solution import BandSolution, solve_bands
from tpjb_ident.identification.band_tables import SolvedBands, band_result
from tpjb_ident.identification.campaign_blocks import run_temperatures, unstated
from tpjb_ident.identification.clocks import solved_with_clocks
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.identification.shared_changes import shared_changes
from tpjb_ident.results.identification import Identification
from tpjb_ident.runs.checked_runs import campaign_verdicts, check_conditions
from tpjb_ident.runs.excluded_runs import ExcludedRun, lost_points, named_runs, without_runs
from tpjb_ident.runs.static_load import static_loads
from tpjb_ident.terms.registry import cell_stiffness

Progress = Callable[[str, int, int], None]
#: What each method takes for the source of motion; without an instrument first one, then the other of these.
_INSTRUMENTS = {"periods": ("periods", "periods"), "iv": ("command", "command"), "hv": ("displacement", "force")}
#: Coherence of the force with the displacements that a line needs where nothing else tells signal from noise.
_LEAST_COHERENCE = 0.5


def identify_bands(
    campaign: Campaign, settings: IdentifySettings, progress: Progress, bare: RigStiffness
) -> Identification:
    """Identify every operating point of a campaign that was excited over a band."""
    runs = tuple(run for run in campaign.of_kind("dynamic") if is_broadband(run))
    seen = []
    for done, run in enumerate(runs):
        progress(run.id, done, len(runs))
        seen.append(observe(run))
    checked = campaign_verdicts(campaign, seen)
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
    points, remaining, loads = solved.points, solved.excluded, solved.loads
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
    found = tuple(point for band in results for point in band.points)
    parts = [q for b in range(len(points)) for q in solved.parts(b)]
    changes, names = shared_changes(solved.first.part, parts)
    return Identification(
        campaign.id, settings.method, found, changes, named, tuple(results), names, cell_stiffness(solved.first.part)
    )


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
    classic = []
    for point in points:
        ends = point.group.kind in OPEN_ENDS
        classic += [classic_line(point.spectra, groups, ends) for groups in point.plan.groups]
    measured = [(s.phasors.run, s.temperatures) for point in points for s in point.spectra]
    temperatures = run_temperatures(campaign, measured)
    passes = 2 if any(point.method == "hv" for point in points) else 1
    solutions: list[BandSolution] = []
    data: BandBlocks | None = None
    for turn in range(passes):
        instruments = [_INSTRUMENTS[point.method][turn] for point in points]
        own = band_blocks(points, sensors, loads.misses, temperatures, instruments)
        own = own.with_film(points, settings.clearance) if settings.clearance else own
        rig = campaign_rig(campaign, sensors, own.blocks, loads.common, bare)
        solutions.append(solve_bands(rig, own, settings.correct, _told(points, own, classic), rates))
        data = data or own
    assert data is not None
    return SolvedBands(tuple(points), loads, data, tuple(classic), tuple(solutions))


def _told(points: Sequence[BandPoint], data: BandBlocks, classic: Sequence[ClassicLine]) -> np.ndarray:
    """Lines whose excitation stands clear of the noise, (L,)."""
    quiet = np.array([points[b].method == "hv" for b in data.band], dtype=bool)
    coherence = np.array([float(np.min(line.coherence)) for line in classic])
    return np.where(quiet, np.nan_to_num(coherence) > _LEAST_COHERENCE, data.strength > STRONG)
