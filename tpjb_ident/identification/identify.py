"""A campaign's dynamic runs to dynamic coefficients: the whole path, point by point; runs over a band by their own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.vector import zero_uncertainty
from tpjb_ident.bands.responses import BandPoint, read_points
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.conditions import Conditions, holding, merged
from tpjb_ident.errors import BadInputError
from tpjb_ident.estimate.arrowhead import real_numbers
from tpjb_ident.estimate.equation import Rig, RigStiffness, campaign_rig, mounted
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimators.estimate import MIN_COHERENCE, fit_conditions, method_of
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.identification.band_blocks import ONE_LINE, STRONG, BandSolution, band_blocks, solve_bands
from tpjb_ident.identification.campaign_solution import (
    RUN_TERMS,
    covariances_of,
    shared_changes,
    solve_campaign,
    solved_with_clocks,
    total,
    unstated,
)
from tpjb_ident.identification.point import SOLVED, finished_point, point_share
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.compensation import with_references
from tpjb_ident.phasors.whole_record import mains_frequency
from tpjb_ident.results.frequency_model import fits_over_frequency, with_frequency_outliers
from tpjb_ident.results.identification import BandLine, BandResult, Identification
from tpjb_ident.results.linearity import FilmChange, change_conditions
from tpjb_ident.results.point_result import PointResult, differing_runs, of_runs, physics, with_probe_doubts
from tpjb_ident.rounding import listed
from tpjb_ident.runs.point_data import ExcludedRun, FinishedRuns, excluded_runs, gather, without_runs
from tpjb_ident.runs.run_jobs import (
    DryTest,
    Progress,
    RunStore,
    all_runs,
    campaign_verdicts,
    check_conditions,
    dry_test,
)
from tpjb_ident.runs.static_load import static_loads
from tpjb_ident.runtime.executors import Workers
from tpjb_ident.terms.registry import cell_stiffness


def identify(
    campaign: Campaign,
    settings: IdentifySettings | None = None,
    progress: Progress | None = None,
    workers: Workers | None = None,
    store: RunStore | None = None,
    method: str | None = None,
) -> Identification:
    """Identify every operating point of a campaign.

    Parameters
    ----------
    campaign : Campaign
    settings : IdentifySettings, optional
    progress : callable, optional
        Called as progress(text, done, total).
    workers : tpjb_ident.runtime.executors.Workers, optional
        Processes or machines over which the reading of runs and the points are spread; the numbers are the same.
    store : RunStore, optional
        Keeps finished runs, so that another call after a kill goes on where this one stopped.
    method : str, optional
        In place of that of the settings: "mm-eiv", "mm", "rlm:huber", "ols", "iv".

    Returns
    -------
    Identification

    Raises
    ------
    BadInputError
        The campaign has no dynamic run, or an unknown method is asked for.
    rigdata.problem.RigDataError
        None of the records can be read. Single ones are left out and named in the result's conditions.
    RecordTooShortError
        None of the records can tell its lines apart.

    Examples
    --------
    >>> result = ti.identify(demo)
    >>> print(result.points[0])
    2.5 kN, 25 Hz: kxx 53.07 ± 0.49 MN/m, cxx 581.6 ± 5.0 kN s/m, kyy 90.68 ± 0.81 MN/m, cyy 689.1 ± 6.1 kN s/m
    """
    chosen = settings or IdentifySettings()
    campaign = with_references(campaign)
    runs = campaign.of_kind("dynamic")
    if not runs:
        raise BadInputError(f"campaign {campaign.id} has no dynamic runs; there is nothing to identify")
    report = progress or (lambda text, done, total: None)
    phasors = replace(chosen.phasors, mains=mains_frequency(campaign, chosen.phasors.mains))
    settings = replace(chosen, method=method or chosen.method, phasors=phasors)
    solver, _ = method_of(settings.method)
    dry = dry_test(campaign, settings.phasors, SOLVED if solver == "iv" else solver)  # it has no command
    sines = replace(campaign, runs=tuple(run for run in campaign.runs if not is_broadband(run)))
    parts = []
    if any(is_broadband(run) for run in runs):
        parts.append(identify_bands(campaign, settings, report, dry.stiffness))
    if sines.of_kind("dynamic"):
        finished = all_runs(sines, settings.phasors, report, workers, store)
        parts.insert(0, assemble(sines, finished, settings, report, workers, dry))
    return _joined(campaign, parts)


def _joined(campaign: Campaign, parts: Sequence[Identification]) -> Identification:
    """The points of sines and those of bands together, sorted; sources of one name are one source.

    Points that other frequencies contradict say so; positions are as uncertain as the probes' stated zeros.
    """
    points: list[PointResult] = []
    sources, conditions = {}, {}
    for part in parts:
        points += part.points
        sources.update(dict.fromkeys(part.calibration_names))
        for condition in part.conditions:
            conditions[condition.sentence()] = condition
    names = tuple(sources)
    changes, stop = np.zeros((max(len(names), 1), len(points), 8)), 0
    for part in parts:
        first, stop = stop, stop + len(part.points)
        scale = np.sqrt(len(changes) / max(len(part.calibration_names), 1))
        for name, row in zip(part.calibration_names, part.calibration_changes):
            changes[names.index(name), first:stop] = scale * row.reshape(-1, 8)
    order = sorted(range(len(points)), key=lambda i: points[i].point)
    zero = zero_uncertainty(campaign.channels.values(), "displacement")
    checked = with_frequency_outliers([points[i] for i in order])
    return replace(
        parts[0],
        points=tuple(replace(p, position_se=np.hypot(p.position_se, zero)) for p in checked),
        calibration_changes=changes[:, order].reshape(len(changes), -1),
        conditions=tuple(conditions.values()),
        bands=parts[-1].bands,
        calibration_names=names,
        cell_stiffness=parts[0].cell_stiffness or parts[-1].cell_stiffness,
    )


def assemble(
    campaign: Campaign,
    finished: FinishedRuns,
    settings: IdentifySettings,
    report: Progress,
    workers: Workers | None = None,
    dry: DryTest | None = None,
) -> Identification:
    """Estimate all points from runs already turned to phasors."""
    workers = workers or Workers()
    observations: list[Observation] = []
    for digest in finished.digests:
        observations += digest.observations
    checked = campaign_verdicts(campaign, observations)
    finished = finished.without(checked.unusable)
    digests = finished.digests
    dry = dry or DryTest()
    gathered = gather(digests)
    report("estimating", 0, len(gathered))
    rig = campaign_rig(campaign, checked.doubted, bare=dry.stiffness, to_set_point=settings.correct, off=checked.off)
    solved = solve_campaign(campaign, gathered, digests, workers, rig)
    excluded, several = finished.excluded, bool(settings.phasors.excitation_lines)
    jobs = []
    for p, data in enumerate(gathered):
        conditions = *check_conditions(checked, data.names), *without_runs(data.point, excluded, several)
        jobs.append((point_share(solved, data, p, dry, conditions),))
    points = []
    for point in workers.map(finished_point, jobs, settings):
        points.append(point)
        report("estimating", len(points), len(gathered))
    places = [data.point for data in gathered]
    remarks = unstated(campaign) + excluded_runs(excluded, len(finished.outcomes), places, several)
    named = with_probe_doubts(checked.swept, points, settings.clearance)
    changes, names = shared_changes(solved.solution, range(len(gathered)), RUN_TERMS)
    springs = cell_stiffness(solved.solution)
    return Identification(campaign.id, settings.method, named, changes, remarks, (), names, springs)


#: Share of the driven lines that must be told from noise.
_LEAST_LINES = 0.5
#: Coherence below which it is no noise that keeps the force from following the shaft, command or not, but samples that
#: were lost, say: noise that lets H1 be a sixth too small leaves 0.84.
_LEAST_COHERENCE = 0.7
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
    usable, unusable = [], []
    for run in runs:
        if run.id in bad:
            unusable.append(ExcludedRun(run.id, run.point, RigDataError(bad[run.id])))
        else:
            usable.append(run)
    excluded: list[ExcludedRun] = []

    def solve(rig: Rig) -> BandSolution:
        fast = {sensor.name: rig.rates[sensor.clock] for sensor in rig.channels if sensor.clock in rig.rates}
        points, unread = read_points(usable, settings.phasors, fast)
        excluded[:] = unusable + unread
        if not points:
            raise excluded[0].error
        loads = static_loads(campaign, points)
        data = band_blocks(points, rig, loads, settings.clearance)
        return solve_bands(mounted(loads.doubted(rig), data.blocks, campaign.mount, loads.common), data)

    rig = campaign_rig(campaign, checked.doubted, bare=bare, to_set_point=settings.correct, off=checked.off)
    solved = solved_with_clocks(rig, min(run.sample_rate for run in runs), solve)
    identified: list[PointResult] = []
    results, numbers = [], []
    points = solved.points
    for b, point in enumerate(points):
        of_loads = solved.loads.conditions(b), check_conditions(checked, point.names)
        without = without_runs(point.point, excluded, any_excitation=True)
        of_records = (run.conditions for run in point.runs)
        of_lines = solved.solution.conditions(), band_conditions(point, solved, b)
        quality = merged(*of_loads, without, *of_records, *of_lines)
        result, parts = _result(solved, b, quality, settings.clearance)
        results.append(result)
        identified += result.points
        numbers += parts
    changes, names = _shared(solved, numbers)
    named = excluded_runs(excluded, len(runs), [point.point for point in points], any_excitation=True)
    about = (*named, *unstated(campaign)), tuple(results), names, cell_stiffness(solved.part)
    return Identification(campaign.id, settings.method, tuple(identified), changes, *about)


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
    random, shared = covariances_of(solution, group)
    if half.any():
        shared[_BRACKET] = np.diag(real_numbers(half) ** 2 / 3)
    about = float(solved.omega[k]), total(random), solution.freedom(group), method, np.ones((1, 2))
    condition = float(np.median(solved.condition[lines]))
    est = DynamicStiffness(solution.h[k] + half, *about, condition=condition, systematic=total(shared))
    return est, random | shared


def _result(solved: BandSolution, b: int, quality: Conditions, clearance: float | None) -> tuple[BandResult, list[int]]:
    """Lines, models and points of one band, and the numbers of its parts."""
    data, usable = solved.points[b], solved.usable_of(b)
    lines = tuple(_line(solved, data, int(k)) for k in usable)
    parts = [q for q, part in enumerate(solved.parts) if solved.band[part[0]] == b and len(usable)]
    points, by_noise = [], []
    for q in parts:
        point = _point(solved, q, quality, clearance)
        # what runs scatter by is one for all parts: no chance between them
        dof = np.full(8, solved.part.noise_freedom(q))
        points.append(point)
        by_noise.append(replace(point, stiffness=replace(point.stiffness, dof=dof)))
    fits = fits_over_frequency(by_noise, _shared(solved, parts)[0])
    models, chosen = (fits[0].fits, fits[0].supported) if fits else ({}, "raw H")
    figures = data.names, data.runs[0].period, data.resolution, tuple(points)
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


def _point(solved: BandSolution, q: int, quality: Conditions, clearance: float | None) -> PointResult:
    """One part of a band as a point: its lines alone tell its h; K-C-M only says how h changes within it."""
    lines = solved.parts[q]
    b = int(solved.band[lines[0]])
    point = solved.points[b]
    est, budget = _estimate(solved, solved.part, q, lines, f"band-{point.method}")
    inside = [solved.classic[k] for k in lines if solved.usable[k]]
    amplitude = max(s.amplitude for s in point.runs)
    film = FilmChange(float(solved.blocks.bent[lines[0]]), is_shown=point.kind != "impact")
    bent = change_conditions(film, budget, est, amplitude, clearance)
    return PointResult(
        **of_runs(point),
        point=replace(point.point, excitation=2 * np.pi * round(est.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        n_windows=sum(line.n_rows for line in inside),
        outlier_fraction=0.0,
        coherence=float(np.median([line.coherence.min() for line in inside])) if inside else np.nan,
        amplitude=amplitude,
        quality=merged(quality, physics(est, point.inertia), bent),
        rejected=(),
        load_miss=solved.loads.misses[b],
        clearance=clearance,
        budget=budget,
        scattering=("random",),
    )


def band_conditions(point: BandPoint, solved: BandSolution, b: int) -> Conditions:
    """What the lines of one band say, and its runs beside each other."""
    mine = solved.band == b
    driven, usable = np.flatnonzero(mine & solved.driven), solved.usable_of(b)
    condition = float(np.median(solved.condition[driven])) if len(driven) else 0.0
    alike, few = condition > ONE_LINE, len(usable) < max(_LEAST_LINES * len(driven), 1)
    one_line = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
    weak = f"{len(usable)} of {mine.sum()} lines stand {STRONG:g} times (F ratio) above the noise"
    spectra = point.runs[0]
    low, high = spectra.frequencies[0], spectra.frequencies[-1]
    held = [f"{d.name} {d.frequency:.4g} Hz" for d in spectra.disturbances if low <= d.frequency <= high]
    bare = solved.solution.rig.bare
    unknown = int((~bare.known(solved.omega[usable])).sum()) if len(bare.omega) else 0
    blind = point.method == "hv" and len(usable) > 0
    coherent = float(np.median([solved.classic[k].coherence.min() for k in usable])) if len(usable) else 1.0
    # a record of blows is quiet for the most part: its noise is no fault
    least = MIN_COHERENCE if blind else _LEAST_COHERENCE * (point.kind != "impact")
    text = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {coherent:.3f})"
    return merged(
        fit_conditions(0.0 if alike or few else condition, np.empty(0), len(point.runs)),
        differing_runs(solved.run_scatter),
        holding(
            (alike, "fewer-than-two-directions", one_line),
            (few and not alike, "excitation-too-weak", weak),
            (held, "lines-left-out", listed(held, _NAMED)),
            (blind, "no-instrument", text),
            (coherent < least, "low-coherence", f"{coherent:.2f}, median over the band"),
            (unknown, "baseline-missing", f"at {unknown} of {len(usable)} lines of the band"),
        ),
    )
