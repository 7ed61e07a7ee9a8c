"""A campaign's broadband runs to h over frequency: the whole path, all operating points in one solve."""

from collections.abc import Mapping

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import Condition, holding, merged
from tpjb_ident.estimate.blocks import RigStiffness, Sensor
from tpjb_ident.estimate.sensors import campaign_rig, sensors_of
from tpjb_ident.estimators.estimate import MIN_COHERENCE, fit_conditions
from tpjb_ident.identification.band_blocks import STRONG, band_blocks
from tpjb_ident.identification.band_point import BandPoint, band_groups, read_point
from tpjb_ident.identification.band_solution import ONE_LINE, solve_bands
from tpjb_ident.identification.band_tables import SolvedBands, band_results
from tpjb_ident.identification.campaign_blocks import run_temperatures, unstated
from tpjb_ident.identification.clocks import solved_with_clocks
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.quality import differing_runs
from tpjb_ident.rounding import listed
from tpjb_ident.runs.checked_runs import campaign_verdicts, check_conditions
from tpjb_ident.runs.finished_runs import ExcludedRun, excluded_runs, without_runs
from tpjb_ident.runs.run_jobs import Progress
from tpjb_ident.runs.static_load import static_loads
from tpjb_ident.terms.registry import cell_stiffness

#: Share of the driven lines that must be told from noise.
_LEAST_LINES = 0.5
#: Disturbing lines that are named.
_NAMED = 6


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
    groups = band_groups([run for run in runs if run.id not in checked.unusable])

    def solve(sensors: tuple[Sensor, ...], rates: Mapping[str, float]) -> SolvedBands:
        fast = {sensor.name: rates[sensor.device] for sensor in sensors if sensor.device in rates}
        points, bad = [], list(unusable)
        for group in groups:
            point, without = read_point(group, campaign.housing_mass, settings.phasors, fast)
            points += [] if point is None else [point]
            bad += without
        if not points:
            raise bad[0].error
        loads = static_loads(campaign, points)
        temperatures = run_temperatures(campaign, [(s.phasors.run, s.temperatures) for p in points for s in p.spectra])
        data, solutions = [], []
        # without an instrument twice: all noise the force's, then all the displacement's
        for turn in range(2 if any(point.method == "hv" for point in points) else 1):
            data.append(band_blocks(points, sensors, loads.misses, temperatures, settings.clearance, turn))
            blocks, known = data[-1].blocks, {"bare": bare, "rates": rates, "to_set_point": settings.correct}
            rig = campaign_rig(campaign, loads.doubted(sensors), blocks, loads.common, **known)
            solutions.append(solve_bands(rig, data[-1]))
        return SolvedBands(tuple(points), loads, data[0], tuple(solutions), tuple(bad))

    solved = solved_with_clocks(sensors_of(campaign), min(run.sample_rate for run in runs), solve)
    points, bad = solved.points, solved.excluded
    quality = []
    for b, point in enumerate(points):
        of_runs = solved.loads.conditions(b), check_conditions(checked, point.names)
        without = without_runs(point.point, bad, any_excitation=True)
        of_records = (spectra.phasors.conditions for spectra in point.spectra)
        of_lines = solved.first.lines.conditions(), band_conditions(point, solved, b)
        quality.append(merged(*of_runs, without, *of_records, *of_lines))
    results, changes, names = band_results(solved, quality, settings.clearance)
    places = [point.point for point in points]
    named = excluded_runs(bad, len(runs), places, any_excitation=True, kind="run over a band") + unstated(campaign)
    identified = tuple(point for band in results for point in band.points)
    springs = cell_stiffness(solved.first.part)
    return Identification(campaign.id, settings.method, identified, changes, named, results, names, springs)


def band_conditions(point: BandPoint, solved: SolvedBands, b: int) -> tuple[Condition, ...]:
    """What the lines of one band say, and its runs beside each other."""
    driven = np.flatnonzero((solved.data.band == b) & solved.data.driven)
    usable = solved.usable(b)
    condition = float(np.median(solved.first.condition[driven])) if len(driven) else 0.0
    alike, few = condition > ONE_LINE, len(usable) < max(_LEAST_LINES * len(driven), 1)
    one_line = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
    weak = f"{len(usable)} of {len(driven)} driven lines stand {STRONG:g} times (F ratio) above the noise"
    spectra = point.spectra[0]
    low, high = spectra.frequencies[0], spectra.frequencies[-1]
    held = [f"{d.name} {d.frequency:.4g} Hz" for d in spectra.disturbances if low <= d.frequency <= high]
    bare = solved.rig.bare
    unknown = int((~bare.known(solved.data.omega[usable])).sum()) if len(bare.omega) else 0
    uncorrected = not point.has_accelerometers and spectra.phasors.housing_mass > 0
    blind = point.method == "hv" and len(usable) > 0
    coherent = float(np.median([solved.classic[k].coherence.min() for k in usable])) if blind else 1.0
    text = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {coherent:.3f})"
    return merged(
        fit_conditions(0.0 if alike or few else condition, np.empty(0), len(point.spectra)),
        differing_runs(solved.first.run_scatter),
        holding(
            (alike, "fewer-than-two-directions", one_line),
            (few and not alike, "excitation-too-weak", weak),
            (held, "lines-left-out", listed(held, _NAMED)),
            (blind, "no-instrument", text),
            (coherent < MIN_COHERENCE, "low-coherence", f"{coherent:.2f}, median over the band"),
            (unknown, "baseline-missing", f"at {unknown} of {len(usable)} lines of the band"),
            (uncorrected, "inertia-not-corrected", "no accelerometers"),
        ),
    )
