"""Findings of the check, those that many runs share told once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rigdata.problem import Problem, Severity
from rigdata.run import Run

_LISTED = 4


@dataclass(frozen=True)
class Finding:
    """A problem of one run, with a key that equal problems of other runs share.

    Attributes
    ----------
    problem : Problem
    key : str
        E.g. ``"dead X1A"``.
    """

    problem: Problem
    key: str


@dataclass(frozen=True)
class Reporter:
    """Gathers the findings of one run.

    Attributes
    ----------
    run : Run
    found : list of Finding
    doubts : set of str
        Quantities that an error of this run makes useless for further conclusions.
    gains : dict of str to float
        Standard deviation that a finding adds to the gain of a channel, by its name.
    """

    run: Run
    found: list[Finding] = field(default_factory=list)
    doubts: set[str] = field(default_factory=set)
    gains: dict[str, float] = field(default_factory=dict)

    def copy(self) -> Reporter:
        """A reporter that has found the same so far."""
        return Reporter(self.run, list(self.found), set(self.doubts), dict(self.gains))

    def say(self, key: str, severity: Severity, place: str, what: str, cure: str) -> None:
        """Note a finding; `key` is the same for equal findings in other runs.

        Parameters
        ----------
        key : str
            The same for equal findings in other runs.
        severity : Severity
        place : str
            Where in the file.
        what : str
            What is wrong.
        cure : str
            What to do.
        """
        self.found.append(Finding(Problem(severity, self.run.file, place, what, cure, self.run.id), key))

    def take(self, problems: Sequence[Problem]) -> None:
        """Note problems that a reader raised.

        Parameters
        ----------
        problems : sequence of Problem
        """
        self.found.extend(Finding(p, f"{p.place} {p.what}") for p in problems)


def _is_shared(concerned: int, alike: int) -> bool:
    """Whether a finding is one of the campaign: a third of the runs alike have it, three at least."""
    return concerned >= 3 and 3 * concerned >= alike


def merge(findings: Sequence[Finding], file: str, runs: Sequence[Run]) -> list[Problem]:
    """Tell a finding once that a third (three at least) of the runs of its kinds share.

    Parameters
    ----------
    findings : sequence of Finding
    file : str
        Display name of the campaign's manifest or file.
    runs : sequence of Run
        All runs of the campaign.

    Returns
    -------
    list of Problem
        In the order of first appearance.
    """
    groups: dict[tuple[str, str], list[Problem]] = {}
    for finding in findings:
        groups.setdefault((finding.key, finding.problem.severity), []).append(finding.problem)
    kind_of = {run.id: run.kind for run in runs}
    merged: list[Problem] = []
    for group in groups.values():
        concerned = list(dict.fromkeys(p.run for p in group if p.run))
        kinds = {kind_of[r] for r in concerned}
        alike = sum(run.kind in kinds for run in runs)
        if not _is_shared(len(concerned), alike):
            merged.extend(group)
            continue
        first = group[0]
        listed = ", ".join(concerned[:_LISTED]) + (", ..." if len(concerned) > _LISTED else "")
        what = f"{first.what}; and so in {len(concerned)} runs ({listed})"
        merged.append(Problem(first.severity, file, first.place, what, first.cure))
    return merged


@dataclass(frozen=True)
class Verdicts:
    """Findings by run.

    Attributes
    ----------
    unusable : dict of str to Problem
        Runs with an error of their own: they say nothing, the others stand.
    shared : dict of str to list of Problem
        Errors that a third of the runs or more have in common: what is wrong is wrong with the campaign.
    doubtful : dict of str to list of Problem
        Warnings.
    gains : dict of str to float
        What differences between channels that should agree add to the uncertainty of their gains.
    """

    unusable: dict[str, Problem] = field(default_factory=dict)
    shared: dict[str, list[Problem]] = field(default_factory=dict)
    doubtful: dict[str, list[Problem]] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)


def verdicts(reports: Sequence[Reporter]) -> Verdicts:
    """Sort the findings of runs of one kind.

    Parameters
    ----------
    reports : sequence of Reporter
        As of the observations that `tpjb_ident.check.campaign.judged` gives.
    """
    groups: dict[tuple[str, Severity], dict[str, Problem]] = {}
    found = Verdicts()
    for one in reports:
        found.gains.update(one.gains)
        for finding in one.found:
            groups.setdefault((finding.key, finding.problem.severity), {}).setdefault(one.run.id, finding.problem)
    alike = len({one.run.id for one in reports})
    for (_, severity), concerned in groups.items():
        for run, problem in concerned.items():
            if severity == "warning":
                found.doubtful.setdefault(run, []).append(problem)
            elif severity == "error" and _is_shared(len(concerned), alike):
                found.shared.setdefault(run, []).append(problem)
            elif severity == "error":
                found.unusable.setdefault(run, problem)
    return found
