"""Read everything of a campaign and report every problem found, not just the first."""

from __future__ import annotations

from pathlib import Path

from rigdata.campaign import Campaign, Run, load_campaign
from rigdata.problem import Problem, RigDataError


def check_campaign(path: str | Path) -> list[Problem]:
    """Read every channel of every run.

    Parameters
    ----------
    path : str or Path
        As for `rigdata.load_campaign`.

    Returns
    -------
    list of Problem
        Empty where nothing was found. Never raises for bad input: it is then in the list.
    """
    try:
        campaign = load_campaign(path)
    except RigDataError as error:
        return list(error.problems)
    problems = list(campaign.notes)
    for run in campaign.runs:
        problems.extend(_check_run(campaign, run))
    return problems


def _check_run(campaign: Campaign, run: Run) -> list[Problem]:
    found: list[Problem] = []
    for name in campaign.channels:
        try:
            run.record(name)
        except RigDataError as error:
            found.extend(p for p in error.problems if p not in found)
    return found
