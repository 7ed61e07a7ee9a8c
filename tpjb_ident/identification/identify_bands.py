"""A campaign's broadband runs to h over frequency: one solve of all operating points; its lines, points and models."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import Condition, holding, merged
from tpjb_ident.estimate.blocks import RigStiffness, Sensor
from tpjb_ident.estimate.sensors import campaign_rig, sensors_of
from tpjb_ident.estimate.shape import real_numbers
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimators.estimate import MIN_COHERENCE, fit_conditions
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.band_blocks import STRONG, band_blocks
from tpjb_ident.identification.band_point import BandPoint, band_groups, read_point
from tpjb_ident.identification.band_solution import ONE_LINE, BandSolution, solve_bands
from tpjb_ident.identification.campaign_solution import run_temperatures, unstated
from tpjb_ident.identification.clocks import solved_with_clocks
from tpjb_ident.identification.estimates import estimate_of, shared_changes
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.results.band_result import BandLine, BandResult
from tpjb_ident.results.frequency_model import fits_over_frequency
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.linearity import FilmChange, change_conditions
from tpjb_ident.results.point_result import PointResult, of_runs
from tpjb_ident.results.quality import differing_runs, physics
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
#: Source of what the solves without an instrument are apart.
_BRACKET = "no instrument"


def identify_bands(
    campaign: Campaign, settings: IdentifySettings, progress: Progress, bare: RigStiffness
) -> Identification:
    """Identify every operating point of a campaign that was excited over a band."""
    runs = [run for run in campaign.of_kind("dynamic") if is_broadband(run)]
    observations = []
    for done, run in enumerate(runs):
        progress(run.id, done, len(runs))
        observations.append(observe(run))
    checked = campaign_verdicts(campaign, observations)
    bad = checked.unusable
    unusable = [ExcludedRun(run.id, run.point, RigDataError(bad[run.id])) for run in runs if run.id in bad]
    groups = band_groups([run for run in runs if run.id not in bad])

    excluded: list[ExcludedRun] = []

    def solve(sensors: tuple[Sensor, ...], rates: Mapping[str, float]) -> BandSolution:
        fast = {sensor.name: rates[sensor.device] for sensor in sensors if sensor.device in rates}
        points = []
        excluded[:] = unusable
        for group in groups:
            point, without = read_point(group, campaign.housing_mass, settings.phasors, fast)
            points += [] if point is None else [point]
            excluded.extend(without)
        if not points:
            raise excluded[0].error
        loads = static_loads(campaign, points)
        temperatures = run_temperatures(campaign, [(s.phasors.run, s.temperatures) for p in points for s in p.spectra])
        data = band_blocks(points, sensors, loads, temperatures, settings.clearance)
        known = {"bare": bare, "rates": rates, "to_set_point": settings.correct}
        return solve_bands(campaign_rig(campaign, loads.doubted(sensors), data.blocks, loads.common, **known), data)

    solved = solved_with_clocks(sensors_of(campaign), min(run.sample_rate for run in runs), solve)
    results, numbers = [], []
    points = solved.data.points
    for b, point in enumerate(points):
        of_loads = solved.data.loads.conditions(b), check_conditions(checked, point.names)
        without = without_runs(point.point, excluded, any_excitation=True)
        of_records = (spectra.phasors.conditions for spectra in point.spectra)
        of_lines = solved.solution.conditions(), band_conditions(point, solved, b)
        quality = merged(*of_loads, without, *of_records, *of_lines)
        result, parts = _result(solved, b, quality, settings.clearance)
        results.append(result)
        numbers += parts
    changes, names = _shared(solved, numbers)
    places = [point.point for point in points]
    named = excluded_runs(excluded, len(runs), places, any_excitation=True)
    identified = tuple(point for band in results for point in band.points)
    about = (*named, *unstated(campaign)), tuple(results), names, cell_stiffness(solved.part)
    return Identification(campaign.id, settings.method, identified, changes, *about)


def _shared(solved: BandSolution, parts: list[int]) -> tuple[FloatArray, tuple[str, ...]]:
    """What some parts share: what scatters from run to run is common to them too."""
    halves = np.array([solved.bracket(solved.parts[q]) for q in parts]).reshape(-1, 2, 2)
    more = {_BRACKET: real_numbers(halves) / np.sqrt(3)} if halves.any() else {}
    return shared_changes(solved.part, parts, more=more)


def _estimate(
    solved: BandSolution, solution: Solution, group: int, lines: IntArray, method: str
) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
    """H of a group of lines, at the middle one, and its covariances by source.

    Without an instrument all noise was the force's: H is in the middle of H1 and H2, as uncertain as a rectangle.
    """
    k, half = lines[len(lines) // 2], solved.bracket(lines)
    est, budget = estimate_of(solution, group, solution.h[k] + half, float(solved.data.omega[k]), method)
    if half.any():
        budget[_BRACKET] = np.diag(real_numbers(half) ** 2 / 3)
        est = replace(est, systematic=est.systematic + budget[_BRACKET])
    return replace(est, condition=float(np.median(solved.condition[lines]))), budget


def _result(
    solved: BandSolution, b: int, quality: tuple[Condition, ...], clearance: float | None
) -> tuple[BandResult, list[int]]:
    """Lines, models and points of one band, and the numbers of its parts."""
    data, usable = solved.data.points[b], solved.usable_of(b)
    lines = tuple(_line(solved, data, int(k)) for k in usable)
    parts = [q for q, part in enumerate(solved.parts) if solved.data.band[part[0]] == b and len(usable)]
    points = [_point(solved, q, quality, clearance) for q in parts]
    # what runs scatter by is one for all parts: no chance between them
    free = [np.full(8, solved.part.noise_freedom(q)) for q in parts]
    by_noise = [replace(p, stiffness=replace(p.stiffness, dof=dof)) for p, dof in zip(points, free)]
    fits = fits_over_frequency(by_noise, _shared(solved, parts)[0])
    models, chosen = (fits[0].fits, fits[0].supported) if fits else ({}, "raw H")
    figures = data.names, data.spectra[0].period, data.resolution, tuple(points)
    return BandResult(data.point, data.kind, lines, models, chosen, quality, *figures), parts


def _line(solved: BandSolution, point: BandPoint, k: int) -> BandLine:
    """One line by the method that counts, and by the others: how runs scatter is no matter of the method."""
    classic = solved.classic[k]
    best, _ = _estimate(solved, solved.solution, k, np.array([k]), point.method)
    (bare,) = solved.solution.rig.bare.at(np.array([best.omega]))
    table = {point.method: best}
    for name, value in classic.h.items():
        table.setdefault(name, replace(best, h=value - bare, method=name))
    return BandLine(best.omega / (2 * np.pi), table, point.method, classic.coherence, classic.n_rows)


def _point(solved: BandSolution, q: int, quality: tuple[Condition, ...], clearance: float | None) -> PointResult:
    """One part of a band as a point: its lines alone tell its h; K-C-M only says how h changes within it."""
    lines = solved.parts[q]
    b = int(solved.data.band[lines[0]])
    point = solved.data.points[b]
    est, budget = _estimate(solved, solved.part, q, lines, f"band-{point.method}")
    inside = [solved.classic[k] for k in lines if solved.usable[k]]
    amplitude = max(s.amplitude for s in point.spectra)
    film = FilmChange(float(solved.data.blocks.bent[lines[0]]))
    bent = change_conditions(film, budget, est, amplitude, clearance)
    return PointResult(
        **of_runs(point, [s.temperatures for s in point.spectra]),
        point=replace(point.point, excitation=2 * np.pi * round(est.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        n_windows=sum(line.n_rows for line in inside),
        outlier_fraction=0.0,
        coherence=float(np.median([line.coherence.min() for line in inside])) if inside else float("nan"),
        amplitude=amplitude,
        quality=merged(quality, physics(est, point.inertia), bent),
        rejected=(),
        load_miss=solved.data.loads.misses[b],
        clearance=clearance,
        budget=budget,
        scattering=("random",),
    )


def band_conditions(point: BandPoint, solved: BandSolution, b: int) -> tuple[Condition, ...]:
    """What the lines of one band say, and its runs beside each other."""
    mine = solved.data.band == b
    driven, usable = np.flatnonzero(mine & solved.data.driven), solved.usable_of(b)
    condition = float(np.median(solved.condition[driven])) if len(driven) else 0.0
    alike, few = condition > ONE_LINE, len(usable) < max(_LEAST_LINES * len(driven), 1)
    one_line = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
    weak = f"{len(usable)} of {mine.sum()} lines stand {STRONG:g} times (F ratio) above the noise"
    spectra = point.spectra[0]
    low, high = spectra.frequencies[0], spectra.frequencies[-1]
    held = [f"{d.name} {d.frequency:.4g} Hz" for d in spectra.disturbances if low <= d.frequency <= high]
    bare = solved.solution.rig.bare
    unknown = int((~bare.known(solved.data.omega[usable])).sum()) if len(bare.omega) else 0
    blind = point.method == "hv" and len(usable) > 0
    coherent = float(np.median([solved.classic[k].coherence.min() for k in usable])) if blind else 1.0
    text = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {coherent:.3f})"
    return merged(
        fit_conditions(0.0 if alike or few else condition, np.empty(0), len(point.spectra)),
        differing_runs(solved.run_scatter),
        holding(
            (alike, "fewer-than-two-directions", one_line),
            (few and not alike, "excitation-too-weak", weak),
            (held, "lines-left-out", listed(held, _NAMED)),
            (blind, "no-instrument", text),
            (coherent < MIN_COHERENCE, "low-coherence", f"{coherent:.2f}, median over the band"),
            (unknown, "baseline-missing", f"at {unknown} of {len(usable)} lines of the band"),
        ),
    )
