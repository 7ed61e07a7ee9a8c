"""Read everything of a campaign and report every problem found, not just the first."""

import itertools
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import Problem, RigDataError, Severity
from rigdata.run import Run
from tpjb_ident.arguments import as_campaign
from tpjb_ident.check.findings import far, is_shared, merge
from tpjb_ident.check.magnitudes import check_magnitudes
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.check.probe_readings import check_positions, check_shaft_lines
from tpjb_ident.check.rig_fit import rig_fit
from tpjb_ident.check.run_gain import check_agreement, check_film, point_runs
from tpjb_ident.check.sensor_axes import check_cells, check_sweep
from tpjb_ident.check.set_points import check_excitation, check_places, check_rotation, check_speed, check_static_loads
from tpjb_ident.check.slow_tests import check_dry, check_locus, check_sweeps
from tpjb_ident.conditions import SEVERITIES, Conditions
from tpjb_ident.phasors.compensation import with_references
from tpjb_ident.rounding import listed
from tpjb_ident.terms.mains import MAINS_ON_LINE

Progress = Callable[[int, int], None]
_MAX_LOOKED_AT = 10_000


def check_campaign(campaign: str | Path | Campaign, progress: Progress | None = None) -> list[Problem]:
    """Read every channel of every run and judge it, alone and beside the others.

    Parameters
    ----------
    campaign : str, Path or Campaign
        As for `rigdata.load_campaign`, or what that gives.
    progress : callable, optional
        Called with the number of runs read so far and of all runs.

    Returns
    -------
    list of Problem
        Errors first; empty where nothing was found. Bad input never raises: it is in the list. A problem
        with a `run` concerns that run alone; one without concerns the campaign.

    Examples
    --------
    >>> ti.check_campaign(demo)  # nothing found
    []
    """
    try:
        campaign = with_references(as_campaign(campaign, "check_campaign: campaign"))
    except RigDataError as error:
        return _sorted(error.problems)
    observations = []
    for count, run in enumerate(campaign.runs, start=1):
        observations.append(observe(run))
        if progress is not None:
            progress(count, len(campaign.runs))
    observations, conditions = judged(campaign, observations)
    findings = []
    for observation in observations:
        findings += observation.report.findings
    merged = merge(findings, campaign.runs)
    for condition in conditions:
        severity: Severity = "error" if condition.severity == "error" else "warning"
        merged.append(Problem(severity, campaign.path.name, str(condition), condition.detail, condition.meaning))
    return _sorted([*campaign.notes, *merged, *_leftovers(campaign)])


def judged(campaign: Campaign, observations: Sequence[Observation]) -> tuple[list[Observation], Conditions]:
    """Judge runs beside each other; what is found stands in the reports of the copies that are given back.

    And what contradicts the description of the rig in all runs: identification finds that by itself.
    """
    observations = [replace(observation, report=observation.report.copy()) for observation in observations]

    def of_kind(kind: str) -> list[Observation]:
        return [observation for observation in observations if observation.run.kind == kind]

    # what is judged by one line of excitation says nothing of runs that are excited over a band
    dynamic = of_kind("dynamic")
    sines = [observation for observation in dynamic if observation.run.excitation_kind == "sine"]
    for observation in observations:
        check_speed(observation)
    static = check_static_loads(observations, campaign.mount)
    if static:
        check_cells(observations)
    check_positions(dynamic)
    check_places(dynamic)
    check_magnitudes(observations)
    check_excitation(sines)
    check_dry(of_kind("dry_pivot"))
    _spread_doubts(observations)
    for runs in point_runs(sines):
        check_film(runs)
        # where mains stand on the line, of another phase in every run, none differs by its own fault
        if not any(MAINS_ON_LINE in observation.conditions for observation in runs.observations):
            check_agreement(runs)
    check_rotation(sines)
    check_shaft_lines(sines)
    check_sweeps(of_kind("clearance"))
    check_sweep(campaign, of_kind("clearance"), of_kind("dry_pivot"))
    check_locus(of_kind("locus"))
    _check_duplicates(observations)
    _check_lengths(observations)
    fit = rig_fit(campaign, dynamic, static)
    return observations, () if fit is None else fit.conditions()


def _spread_doubts(observations: Sequence[Observation]) -> None:
    """Cells that are wired wrongly in many runs are so in all, also where the load does not show it."""
    judged = [observation for observation in observations if observation.run.kind in {"dynamic", "locus", "dry_pivot"}]
    if is_shared(sum(observation.report.cells_doubted for observation in judged), len(judged)):
        for observation in observations:
            observation.report.cells_doubted = True


def _check_duplicates(observations: Sequence[Observation]) -> None:
    first: dict[str, Observation] = {}
    for observation in observations:
        earlier = first.setdefault(observation.digest, observation).run
        if not observation.digest or earlier.id == observation.run.id:  # itself, or another excitation in its record
            continue
        kind = "shared" if _shared_record(observation.run, earlier) else "duplicate"
        observation.report.ask(kind, other=earlier.id, file=earlier.file)


def _check_lengths(observations: Sequence[Observation]) -> None:
    """Records far shorter than the others of a kind of test were cut off; lengths that scatter say nothing."""
    groups = defaultdict(list)
    for observation in observations:
        run = observation.run
        if observation.seconds > 0:
            groups[run.kind, run.branch, run.excitation_kind, run.point.excitation].append(observation)
    for alike in groups.values():
        lengths = np.array([observation.seconds for observation in alike])
        usual = float(np.median(lengths))
        for observation, is_apart in zip(alike, far(abs(lengths / usual - 1), 0.2, 4.0, count=3)):
            if is_apart:
                length = observation.seconds
                observation.report.ask("short record", usual / length, length=length, usual=usual)


def _shared_record(first: Run, second: Run) -> bool:
    """Whether one record excited at several frequencies serves both runs."""
    is_same = replace(first.point, excitation=second.point.excitation) == second.point
    return first.kind == second.kind == "dynamic" and is_same and first.point != second.point


def _sorted(problems: Sequence[Problem]) -> list[Problem]:
    return sorted(dict.fromkeys(problems), key=lambda p: SEVERITIES.index(p.severity))


def _leftovers(campaign: Campaign) -> list[Problem]:
    """Note records without a run: forgotten in the manifest, or left from another campaign."""
    noun, read = ("file", _files) if campaign.path.is_dir() else ("group", _groups)
    try:
        names = read(campaign)
    except RigDataError:  # the runs themselves say so
        return []
    if not names:
        return []
    text = f"no run names the {noun}{'s' * (len(names) > 1)} {listed([ascii(name)[1:-1][:60] for name in names])}"
    cure = "Add them to the manifest, or nothing if they are not wanted"
    return [Problem("note", campaign.path.name, "", text, cure)]


def _files(campaign: Campaign) -> list[str]:
    from rigdata.survey.exports import records_below  # with it come the readers of text: not for who identifies alone

    named = set(map(Path.resolve, campaign.files.values()))
    return [path.name for path in records_below(campaign.path) if path.resolve() not in named]


def _groups(campaign: Campaign) -> list[str]:
    from rigdata.readers.hdf5.guards import resolve
    from rigdata.readers.hdf5.reader import open_readonly

    file = campaign.path.name
    with open_readonly(campaign.path, file) as handle:
        runs = resolve(handle, "runs", file)
        names = {str(name) for name in itertools.islice(runs or (), _MAX_LOOKED_AT)}
    return sorted(names - {run.id for run in campaign.runs})
