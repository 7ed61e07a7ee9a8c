"""A campaign's dynamic runs to dynamic coefficients: the whole path, point by point."""

from dataclasses import replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.vector import zero_uncertainty
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.conditions import merged
from tpjb_ident.errors import BadInputError
from tpjb_ident.estimators.estimate import method_of
from tpjb_ident.identification.campaign_solution import solve_campaign, unstated
from tpjb_ident.identification.estimates import RUN_TERMS, shared_changes
from tpjb_ident.identification.identify_bands import identify_bands
from tpjb_ident.identification.point import SOLVED, PointTask, finished_point, point_share
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.mains_frequency import mains_frequency
from tpjb_ident.results.frequency_outliers import with_frequency_outliers
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.quality import with_probe_doubts
from tpjb_ident.runs.baseline import DryTest, dry_test
from tpjb_ident.runs.checked_runs import check_finished
from tpjb_ident.runs.finished_runs import FinishedRuns, excluded_runs, without_runs
from tpjb_ident.runs.point_data import gather
from tpjb_ident.runs.run_jobs import Progress, all_runs
from tpjb_ident.runs.run_store import RunStore
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
    2.5 kN, 25 Hz: kxx 53.07 ± 0.49 MN/m, cxx 581.6 ± 5.0 kN s/m, kyy 90.68 ± 0.81 MN/m, cyy 689.0 ± 6.1 kN s/m
    """
    chosen = settings or IdentifySettings()
    runs = campaign.of_kind("dynamic")
    if not runs:
        raise BadInputError(f"campaign {campaign.id} has no dynamic runs; there is nothing to identify")
    report = progress or (lambda text, done, total: None)
    settings = _with_mains(replace(chosen, method=method or chosen.method), campaign)
    dry = dry_test(campaign, settings.phasors, _without_instruments(settings.method))
    sines = replace(campaign, runs=tuple(run for run in campaign.runs if not is_broadband(run)))
    bands = None
    if any(is_broadband(run) for run in runs):
        bands = identify_bands(campaign, settings, report, dry.stiffness)
    identification = Identification(campaign.id, settings.method, (), np.zeros((1, 0)))
    if sines.of_kind("dynamic"):
        finished = all_runs(sines, settings.phasors, report, workers, store)
        identification = assemble(sines, finished, settings, report, workers, dry)
    identification = identification if bands is None else _joined(identification, bands)
    identification = replace(identification, points=with_frequency_outliers(identification.points))
    return _with_zero_uncertainty(identification, campaign)


def _without_instruments(name: str) -> str:
    """The method of a name, or the default one where it needs a command; an unknown one is refused."""
    method, _ = method_of(name)
    return SOLVED if method == "iv" else method


def _with_zero_uncertainty(identification: Identification, campaign: Campaign) -> Identification:
    """Positions of the shaft are as uncertain as the probes' stated zeros."""
    zero = zero_uncertainty(campaign.channels.values(), "displacement")
    points = tuple(replace(p, position_se=np.hypot(p.position_se, zero)) for p in identification.points)
    return replace(identification, points=points)


def _joined(sines: Identification, bands: Identification) -> Identification:
    """The points of sines and those of bands together, sorted as ever; sources of one name are one source."""
    points = [*sines.points, *bands.points]
    names = tuple(dict.fromkeys((*sines.calibration_names, *bands.calibration_names)))
    changes = np.zeros((max(len(names), 1), len(points), 8))
    for part, places in ((sines, slice(len(sines.points))), (bands, slice(len(sines.points), None))):
        scale = np.sqrt(len(changes) / max(len(part.calibration_names), 1))
        for name, row in zip(part.calibration_names, part.calibration_changes):
            changes[names.index(name), places] = scale * row.reshape(-1, 8)
    order = sorted(range(len(points)), key=lambda i: points[i].point)
    conditions = {condition.sentence(): condition for condition in (*sines.conditions, *bands.conditions)}
    return replace(
        sines,
        points=tuple(points[i] for i in order),
        calibration_changes=changes[:, order].reshape(len(changes), -1),
        conditions=tuple(conditions.values()),
        bands=bands.bands,
        calibration_names=names,
        cell_stiffness=sines.cell_stiffness or bands.cell_stiffness,
    )


def _with_mains(settings: IdentifySettings, campaign: Campaign) -> IdentifySettings:
    lines = settings.phasors.lines
    lines = replace(lines, mains=mains_frequency(campaign, lines.mains))
    return replace(settings, phasors=replace(settings.phasors, lines=lines))


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
    finished, checked = check_finished(campaign, finished)
    digests = finished.digests
    dry = dry or DryTest()
    gathered = gather([digest.phasors for digest in digests], digests)
    report("estimating", 0, len(gathered))
    solved = solve_campaign(campaign, gathered, digests, workers, settings.correct, dry.stiffness)
    task = PointTask(settings, solved.task, checked, dry)
    jobs = [(data, point_share(solved, data, p)) for p, data in enumerate(gathered)]
    excluded, several = finished.excluded, bool(settings.phasors.excitation_lines)
    points = []
    for point in workers.map(finished_point, jobs, task):
        without = without_runs(point.point, excluded, several)
        points.append(replace(point, quality=merged(point.quality, without)))
        report("estimating", len(points), len(gathered))
    places = [data.point for data in gathered]
    remarks = unstated(campaign) + excluded_runs(excluded, len(finished.outcomes), places, several)
    named = with_probe_doubts(checked.swept, points, settings.clearance)
    changes, names = shared_changes(solved.solution, range(len(gathered)), RUN_TERMS)
    springs = cell_stiffness(solved.solution)
    return Identification(campaign.id, settings.method, named, changes, remarks, (), names, springs)
