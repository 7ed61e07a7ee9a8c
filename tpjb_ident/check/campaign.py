"""Read everything of a campaign and report every problem found, not just the first."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rigdata.campaign import Campaign
from rigdata.problem import Problem, RigDataError, Severity
from rigdata.run import Run
from tpjb_ident.arguments import as_campaign
from tpjb_ident.check.findings import Finding, merge
from tpjb_ident.check.magnitudes import check_magnitudes
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.check.positions import check_positions
from tpjb_ident.check.response import check_responses
from tpjb_ident.check.rig_fit import check_accelerometers, rig_fit
from tpjb_ident.check.rotation import check_rotation
from tpjb_ident.check.set_points import check_excitation, check_speed, check_static_loads
from tpjb_ident.check.slow_tests import check_dry, check_locus, check_sweeps
from tpjb_ident.conditions import Condition

_ORDER = {"error": 0, "warning": 1, "note": 2}
Progress = Callable[[int, int], None]
_LISTED = 5
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
        campaign = as_campaign(campaign, "check_campaign: campaign")
    except RigDataError as error:
        return _sorted(error.problems)
    observations: list[Observation] = []
    for count, run in enumerate(campaign.runs, start=1):
        observations.append(observe(run))
        if progress is not None:
            progress(count, len(campaign.runs))
    observations, conditions = judged(campaign, observations)
    findings: list[Finding] = [f for observation in observations for f in observation.report.found]
    merged = merge(findings, campaign.path.name, campaign.runs)
    rig = [_problem(condition, campaign.path.name) for condition in conditions]
    return _sorted([*campaign.notes, *merged, *rig, *_leftovers(campaign)])


def judged(campaign: Campaign, observations: Sequence[Observation]) -> tuple[list[Observation], tuple[Condition, ...]]:
    """Judge runs beside each other; what is found stands in the reports of the copies that are given back.

    And what contradicts the description of the rig in all runs: identification finds that by itself.
    """
    observations = [replace(observation, report=observation.report.copy()) for observation in observations]
    of_kind = {k: [s for s in observations if s.run.kind == k] for k in ("dynamic", "dry_pivot", "locus", "clearance")}
    dynamic = of_kind["dynamic"]
    # what is judged by one line of excitation says nothing of runs that are excited over a band
    of_kind["dynamic"] = [s for s in dynamic if s.run.excitation_kind == "sine"]
    for observation in observations:
        check_speed(observation)
    static = check_static_loads(observations)
    check_positions(observations)
    check_magnitudes(observations, campaign.housing_mass)
    check_excitation(of_kind["dynamic"], campaign.housing_mass)
    _spread_doubts(observations)
    check_dry(of_kind["dry_pivot"])
    _spread_doubts(observations)
    check_responses(of_kind["dynamic"], campaign.housing_mass, of_kind["clearance"])
    check_rotation(of_kind["dynamic"])
    check_sweeps(of_kind["clearance"])
    check_locus(of_kind["locus"])
    _check_duplicates(observations)
    fit = rig_fit(campaign, dynamic, static)
    if fit is None:
        return observations, ()
    check_accelerometers(fit)
    return observations, fit.solution.conditions()


def _problem(condition: Condition, file: str) -> Problem:
    severity: Severity = "error" if condition.severity == "error" else "warning"
    return Problem(severity, file, str(condition), condition.detail, condition.meaning)


def _spread_doubts(observations: Sequence[Observation]) -> None:
    """Cells that are wired wrongly in many runs are so in all, also where the load does not show it."""
    judged = [observation for observation in observations if observation.run.kind in {"dynamic", "locus", "dry_pivot"}]
    doubted = sum("force" in observation.report.doubts for observation in judged)
    if doubted >= 3 and 3 * doubted >= len(judged):
        for observation in observations:
            observation.report.doubts.add("force")


def _check_duplicates(observations: Sequence[Observation]) -> None:
    first: dict[str, Observation] = {}
    for observation in observations:
        earlier = first.setdefault(observation.digest, observation) if observation.digest else observation
        if earlier.run.id == observation.run.id:  # itself, or another excitation in its record
            continue
        if _shared_record(observation.run, earlier.run):
            text = f"shares its record with run {earlier.run.id}, at another excitation frequency"
            observation.report.say("shared", "note", "", text, "Nothing, if both lines were excited at once")
            continue
        text = f"holds the very samples of run {earlier.run.id} ({earlier.run.file})"
        cure = "One of the two is a copy: find the right file, or delete the run"
        observation.report.say("duplicate", "error", "", text, cure)


def _shared_record(first: Run, second: Run) -> bool:
    """Whether one record excited at several frequencies serves both runs."""
    same = replace(first.point, excitation=second.point.excitation) == second.point
    return first.kind == second.kind == "dynamic" and same and first.point != second.point


def _sorted(problems: Sequence[Problem]) -> list[Problem]:
    return sorted(dict.fromkeys(problems), key=lambda p: _ORDER[p.severity])


def _leftovers(campaign: Campaign) -> list[Problem]:
    """Note records without a run: forgotten in the manifest, or left from another campaign."""
    if campaign.path.is_dir():
        names = _files(campaign)
        place, noun = campaign.path.name, "file"
    else:
        names = _groups(campaign)
        place, noun = f"{campaign.path.name}:/runs", "group"
    if not names:
        return []
    more = f", ... ({len(names)} in all)" if len(names) > _LISTED else ""
    listed = ", ".join(ascii(n)[1:-1][:60] for n in names[:_LISTED])
    text = f"no run names the {noun}{'' if len(names) == 1 else 's'} {listed}{more}"
    return [Problem("note", place, "", text, "Add them to the manifest, or nothing if they are not wanted")]


def _files(campaign: Campaign) -> list[str]:
    known = {p.resolve() for p in campaign.files.values()}
    records = [p for n, p in campaign.files.items() if n not in {"campaign.toml", campaign.bearing_name}]
    suffixes = {p.suffix.lower() for p in records}
    unlisted: list[Path] = []
    for folder in sorted({p.parent for p in records}):
        try:
            beside = list(itertools.islice(folder.iterdir(), _MAX_LOOKED_AT))
        except OSError:  # the folder is not there: the runs themselves say so
            continue
        unlisted += [p for p in beside if p.suffix.lower() in suffixes and p.resolve() not in known and p.is_file()]
    return sorted(p.name for p in unlisted)


def _groups(campaign: Campaign) -> list[str]:
    from rigdata.readers.hdf5.guards import resolve
    from rigdata.readers.hdf5.reader import open_readonly

    known = {run.id for run in campaign.runs}
    try:
        with open_readonly(campaign.path, campaign.path.name) as handle:
            runs = resolve(handle, "runs", campaign.path.name)
            names = [] if runs is None else [str(n) for n in itertools.islice(runs, _MAX_LOOKED_AT)]
    except RigDataError:  # the runs themselves say so
        return []
    return sorted(set(names) - known)
