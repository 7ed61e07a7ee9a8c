"""A campaign's dynamic runs to dynamic coefficients: the whole path, point by point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.vector import zero_uncertainty
from tpjb_ident.check.findings import Verdicts
from tpjb_ident.check.redundant_channels import widened
from tpjb_ident.conditions import merged
from tpjb_ident.dynamic.broadband.band_point import BandSettings, is_broadband
from tpjb_ident.dynamic.broadband.identify_bands import IdentifiedBands, identify_bands
from tpjb_ident.dynamic.corrections.cell_zero import cell_zero_uncertainty
from tpjb_ident.dynamic.corrections.find import Correction, find_corrections
from tpjb_ident.dynamic.corrections.mains import MAINS_ON_LINE, force_pickup, force_pickup_spread
from tpjb_ident.dynamic.corrections.systematic_sources import (
    GainDraws,
    SystematicSources,
    apparent_change,
    gain_draws,
    systematic_sources,
)
from tpjb_ident.dynamic.estimators.estimate import REJECTED_WEIGHT
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.identify_point import Completion, first_estimate, own_method, point_figures, point_result
from tpjb_ident.dynamic.instruments.amplitude import ZeroAmplitude, zero_amplitude
from tpjb_ident.dynamic.instruments.findings import InstrumentFindings, film_change_at, inspect_instruments
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, change_conditions, change_spread
from tpjb_ident.dynamic.results.gains import Pairs, channel_pairs, gain_doubts, swept_probes, with_probe_doubts
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult, lost_points, named_at_points
from tpjb_ident.dynamic.runs.baseline import measured_baseline
from tpjb_ident.dynamic.runs.checked_runs import check_conditions, check_finished
from tpjb_ident.dynamic.runs.excluded_runs import named_runs
from tpjb_ident.dynamic.runs.finished_runs import FinishedRuns
from tpjb_ident.dynamic.runs.point_source import PointSource, point_sources
from tpjb_ident.dynamic.runs.run_jobs import Progress, all_runs
from tpjb_ident.dynamic.runs.run_store import RunStore
from tpjb_ident.dynamic.runs.synchronous import without_synchronous
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.mains_frequency import mains_frequency
from tpjb_ident.runtime.executors import InProcessWorkers, Workers, map_ordered


def identify(
    campaign: Campaign,
    settings: IdentifySettings | None = None,
    progress: Progress | None = None,
    workers: Workers | None = None,
    store: RunStore | None = None,
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
    2.5 kN, 25 Hz: kxx 53.12 ± 0.63 MN/m, cxx 582.3 ± 6.6 kN s/m, kyy 90.7 ± 1.1 MN/m, cyy 689.1 ± 8.0 kN s/m
    """
    settings = settings or IdentifySettings()
    runs = campaign.of_kind("dynamic")
    if not runs:
        raise BadInputError(f"campaign {campaign.id} has no dynamic runs; there is nothing to identify")
    report = progress or (lambda text, done, total: None)
    settings = _with_mains(settings, campaign)
    sines = replace(campaign, runs=tuple(run for run in campaign.runs if not is_broadband(run)))
    bands = None
    if any(is_broadband(run) for run in runs):
        rig = measured_baseline(campaign, settings.phasors, own_method(settings.method))
        bands = identify_bands(campaign, _band_settings(settings), report, rig)
    if not sines.of_kind("dynamic"):
        identification = Identification(campaign.id, settings.method, (), np.zeros((settings.n_calibration, 0)))
    else:
        with all_runs(sines, settings.phasors, report, workers, store) as finished:
            identification = assemble(sines, finished, settings, report, workers)
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
    joint = np.concatenate([result.calibration_changes, bands.changes], axis=1)
    changes = joint.reshape(len(joint), len(points), 8)
    order = sorted(range(len(points)), key=lambda i: points[i].point)
    table = {c.sentence(): c for c in (*result.conditions, *bands.conditions)}
    return replace(
        result,
        points=tuple(points[i] for i in order),
        calibration_changes=changes[:, order].reshape(len(changes), -1),
        conditions=tuple(table.values()),
        bands=bands.results,
    )


def _band_settings(settings: IdentifySettings) -> BandSettings:
    phasors = settings.phasors
    lines, draws = phasors.lines.mains, (settings.n_calibration, settings.seed)
    return BandSettings(lines, phasors.delays, settings.correct, *draws, settings.clearance)


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
) -> Identification:
    """Estimate all points from runs already turned to phasors, a few points' windows in memory at a time."""
    workers = workers or InProcessWorkers()
    checked = check_finished(campaign, finished)
    digests = finished.digests
    findings, sources = inspect_instruments(point_sources(finished), _delays_stated(campaign))
    baseline = measured_baseline(campaign, settings.phasors, own_method(settings.method))
    sources = [replace(source, baseline=baseline) for source in sources]
    axes = np.array([c.axis for c in campaign.channels.values() if c.quantity == "displacement"], dtype=float)
    sweeps = swept_probes(campaign)
    report("estimating", 0, len(sources))
    first = list(map_ordered(workers, _first, [(source,) for source in sources], settings))
    mains = [digest.mains for digest in digests]
    in_cells = [digest.mains_force for digest in digests]
    corrections = find_corrections(sources, mains, axes, first, cell_zero_uncertainty(campaign), in_cells)
    work = _Points(
        settings,
        findings,
        {digest.run: digest.temperatures for digest in digests},
        directions_differ(first),
        channel_pairs(campaign, sweeps),
        gain_draws(widened(campaign.channels, checked.gains), settings.n_calibration, settings.seed),
        systematic_sources(campaign, settings.n_calibration, settings.seed + 1),
        force_pickup(in_cells),
        checked,
    )
    points, changes = [], []
    for point, change in map_ordered(workers, _finished, list(zip(sources, corrections)), work):
        points.append(point)
        changes.append(change)
        report("estimating", len(points), len(sources))
    joint = np.concatenate(changes, axis=1)
    excluded, several = finished.left_out, bool(settings.phasors.excitation_lines)
    conditions = named_runs(excluded, len(digests) + len(excluded)) + lost_points(points, excluded, several)
    named = with_probe_doubts(sweeps, named_at_points(points, excluded, several), settings.clearance)
    return Identification(campaign.id, settings.method, named, joint, work.draws.conditions() + conditions)


def _first(settings: IdentifySettings, source: PointSource) -> DynamicStiffness:
    return first_estimate(without_synchronous(source.load()), settings)


def _finished(work: _Points, source: PointSource, correction: Correction) -> tuple[PointResult, FloatArray]:
    return work.finish(source, correction)


@dataclass(frozen=True)
class _Points:
    """What all points of a campaign are finished with."""

    settings: IdentifySettings
    findings: InstrumentFindings
    temperatures: dict[str, dict[int, float]]
    differ: bool
    pairs: Pairs | None
    draws: GainDraws
    sources: SystematicSources
    mains_force: FloatArray
    checked: Verdicts

    def finish(self, source: PointSource, correction: Correction) -> tuple[PointResult, FloatArray]:
        """One point with all its uncertainties, and what the draws of the systematic ones do to it."""
        settings, recorded = self.settings, source.load()
        used = correction if settings.correct else correction.measured_only()
        data, corrected = without_synchronous(recorded), without_synchronous(used.apply(recorded))
        coincident = source.found(MAINS_ON_LINE)
        mains = float(np.linalg.norm(self.mains_force)) if coincident else 0.0
        figures = point_figures(corrected, settings, self.differ, mains)
        first = figures.by_method[settings.method]
        film = film_change_at(source, first)
        none = zero_amplitude(corrected, first.h, film.share) if settings.correct else None
        if none is not None:
            corrected = none.apply(corrected)
            figures = point_figures(corrected, settings, self.differ, mains)
        before = figures.by_method[settings.method]
        by_method = {name: used.widened(est) for name, est in figures.by_method.items()}
        best = by_method[settings.method]
        amplitude_part, uncertain = _amplitude_part(film, none, best)
        changes = {"calibration": apparent_change(data, best, self.draws), **self.sources.changes(data, best)}
        systematic = {name: np.cov(change.T, bias=True) for name, change in changes.items()}
        systematic |= self.findings.spreads(data, best) | source.baseline.spread(data) | amplitude_part
        if coincident and self.mains_force.any():
            systematic["mains on the cells"] = force_pickup_spread(data, self.mains_force)
        if not settings.keep_weights:
            by_method = {name: _counted_only(est) for name, est in by_method.items()}
        covariance = np.sum(list(systematic.values()), axis=0)
        with_both = {name: replace(est, systematic=covariance) for name, est in by_method.items()}
        bent = change_conditions(film, uncertain, with_both[settings.method], figures.amplitude, settings.clearance)
        bent += () if none is None else none.conditions()
        conditions = (used.conditions, self.findings.conditions(data), source.baseline.missing(data), bent)
        gains = gain_doubts(data, self.pairs) if data.shaft is None else ()
        doubts = (gains, *conditions, check_conditions(self.checked, [run.run for run in recorded.runs]))
        completion = Completion(with_both, merged(*doubts), used.miss, {**used.budget(before), **systematic})
        point_data = corrected if data.shaft is None else recorded
        finished = point_result(point_data, figures, completion, self.temperatures, settings)
        return finished, np.sum(list(changes.values()), axis=0)


def _amplitude_part(
    film: FilmChange, none: ZeroAmplitude | None, est: DynamicStiffness
) -> tuple[dict[str, FloatArray], float]:
    """Covariance by source that the amplitude of the excitation leaves, and the share of H that it may come to."""
    if none is not None:
        return {"amplitude": none.left}, none.uncertain(est.h)
    return ({"amplitude": change_spread(film.share, est)} if film.share else {}), film.share


def _delays_stated(campaign: Campaign) -> bool:
    """Whether the manifest says how late channels are, or how well that is known."""
    return any(
        getattr(c, "delay_uncertainty", 0.0) > 0 or getattr(getattr(c, "response", None), "delay", 0.0) != 0.0
        for c in campaign.channels.values()
    )


def _counted_only(est: DynamicStiffness) -> DynamicStiffness:
    """The estimate with a verdict per window in place of its weights: 1 byte instead of 16."""
    return replace(est, weights=(est.weights.min(axis=1) >= REJECTED_WEIGHT)[:, None])


def directions_differ(first: list[DynamicStiffness]) -> bool:
    """Whether runs differ by more than their windows do, judged over all points of the campaign.

    Few runs per point tell little about it; the cause (set points that are missed a little) is the same
    at all points. Beyond doubt means: the summed chi-square has a probability below 1e-4.
    """
    estimates = [est for est in first if np.isfinite(est.chi_square) and est.spare_equations > 0]
    dof = sum(est.spare_equations for est in estimates)
    total = sum(est.chi_square * est.spare_equations for est in estimates)
    return dof > 0 and float(chdtrc(dof, total)) < 1e-4
