"""A campaign's dynamic runs to dynamic coefficients: the whole path, point by point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.vector import zero_uncertainty
from tpjb_ident.dynamic.broadband.run_spectra import is_broadband
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import lost_points, named_at_points
from tpjb_ident.dynamic.results.quality import with_probe_doubts
from tpjb_ident.dynamic.runs.baseline import DryTest, dry_test
from tpjb_ident.dynamic.runs.checked_runs import check_finished
from tpjb_ident.dynamic.runs.excluded_runs import named_runs
from tpjb_ident.dynamic.runs.finished_runs import FinishedRuns
from tpjb_ident.dynamic.runs.point_source import point_sources
from tpjb_ident.dynamic.runs.run_jobs import Progress, all_runs
from tpjb_ident.dynamic.runs.run_store import RunStore
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.errors import BadInputError
from tpjb_ident.identification.band_point import BandSettings
from tpjb_ident.identification.campaign_blocks import unstated
from tpjb_ident.identification.campaign_solution import solve_campaign
from tpjb_ident.identification.identify_bands import IdentifiedBands, identify_bands
from tpjb_ident.identification.methods import own_method
from tpjb_ident.identification.point import PointTask, finished_point, point_share
from tpjb_ident.identification.shared_changes import SharedChanges, shared_changes
from tpjb_ident.phasors.mains_frequency import mains_frequency
from tpjb_ident.runtime.executors import Workers, map_ordered


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
    2.5 kN, 25 Hz: kxx 53.06 ± 0.49 MN/m, cxx 581.5 ± 5.0 kN s/m, kyy 90.68 ± 0.81 MN/m, cyy 689.0 ± 6.0 kN s/m
    """
    chosen = settings or IdentifySettings()
    runs = campaign.of_kind("dynamic")
    if not runs:
        raise BadInputError(f"campaign {campaign.id} has no dynamic runs; there is nothing to identify")
    report = progress or (lambda text, done, total: None)
    settings = _with_mains(replace(chosen, method=method or chosen.method), campaign)
    sines = replace(campaign, runs=tuple(run for run in campaign.runs if not is_broadband(run)))
    bands = None
    dry = dry_test(campaign, settings.phasors, own_method(settings.method))
    if any(is_broadband(run) for run in runs):
        bands = identify_bands(campaign, _band_settings(settings), report, dry.stiffness)
    if not sines.of_kind("dynamic"):
        identification = Identification(campaign.id, settings.method, (), np.zeros((1, 0)))
    else:
        finished = all_runs(sines, settings.phasors, report, workers, store)
        identification = assemble(sines, finished, settings, report, workers, dry)
    identification = identification if bands is None else _with_bands(identification, bands)
    return _with_zero_uncertainty(identification, campaign)


def _with_zero_uncertainty(identification: Identification, campaign: Campaign) -> Identification:
    """Positions of the shaft are as uncertain as the probes' stated zeros."""
    zero = zero_uncertainty(campaign.channels.values(), "displacement")
    if not zero.any():
        return identification
    points = tuple(replace(p, position_se=np.hypot(p.position_se, zero)) for p in identification.points)
    return replace(identification, points=points)


def _with_bands(result: Identification, bands: IdentifiedBands) -> Identification:
    """The points of sines and those of bands together, sorted as ever."""
    points = [*result.points, *(p for band in bands.results for p in band.points)]
    sines = SharedChanges(result.calibration_changes, result.calibration_names, result.cell_stiffness)
    joint = sines.beside(bands.shared)
    changes = joint.changes.reshape(len(joint.changes), len(points), 8)
    order = sorted(range(len(points)), key=lambda i: points[i].point)
    table = {c.sentence(): c for c in (*result.conditions, *bands.conditions)}
    return replace(
        result,
        points=tuple(points[i] for i in order),
        calibration_changes=changes[:, order].reshape(len(changes), -1),
        conditions=tuple(table.values()),
        bands=bands.results,
        calibration_names=joint.names,
        cell_stiffness=joint.cell_stiffness,
    )


def _band_settings(settings: IdentifySettings) -> BandSettings:
    phasors = settings.phasors
    return BandSettings(phasors.lines.mains, phasors.delays, settings.correct, settings.clearance)


def _with_mains(settings: IdentifySettings, campaign: Campaign) -> IdentifySettings:
    lines = settings.phasors.lines
    mains = mains_frequency(campaign, lines.mains)
    if mains == lines.mains:
        return settings
    return replace(settings, phasors=replace(settings.phasors, lines=replace(lines, mains=mains)))


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
    checked = check_finished(campaign, finished)
    digests = finished.digests
    dry = dry or DryTest()
    sources = point_sources(finished)
    report("estimating", 0, len(sources))
    solved = solve_campaign(campaign, sources, digests, workers, settings.correct, dry.stiffness)
    temperatures = {digest.run: digest.temperatures for digest in digests}
    task = PointTask(settings, solved.task, temperatures, checked, dry)
    jobs = [(source, point_share(solved, source, p)) for p, source in enumerate(sources)]
    points = []
    for point in map_ordered(workers, finished_point, jobs, task):
        points.append(point)
        report("estimating", len(points), len(sources))
    excluded, several = finished.left_out, bool(settings.phasors.excitation_lines)
    conditions = named_runs(excluded, len(digests) + len(excluded)) + lost_points(points, excluded, several)
    named = with_probe_doubts(checked.swept, named_at_points(points, excluded, several), settings.clearance)
    shared = shared_changes(solved.solution, range(len(sources)))
    remarks = unstated(campaign) + conditions
    return Identification(
        campaign.id, settings.method, named, shared.changes, remarks, (), shared.names, shared.cell_stiffness
    )
