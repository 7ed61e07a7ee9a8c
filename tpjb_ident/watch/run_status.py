"""How a run of the plan stands: to be run, being written, good, worth a look, to be repeated, replaced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from rigdata.problem import Problem
from rigdata.run import Run
from tpjb_ident.check.findings import Finding
from tpjb_ident.check.observation import Observation

State = Literal["to run", "being written", "good", "look", "repeat", "replaced"]
#: Warnings of the check that only another record mends: what was lost cannot be calibrated back.
LOST_SAMPLES = ("clipped", "dead", "empty", "missing", "stuck", "gap", "jitter", "short", "no excitation", "step")
#: A finding in so many runs at least, and in this share of those of their kinds, is not the runs' fault.
COMMON_RUNS, COMMON_SHARE = 3, 1 / 3


@dataclass(frozen=True)
class RunStatus:
    """One run of the plan, or beside it."""

    run: Run
    state: State
    findings: tuple[Finding, ...] = field(default=(), repr=False)
    landed: str = ""
    planned: bool = True

    @property
    def counts(self) -> bool:
        """Whether the test that it stands for is done."""
        return self.state in ("good", "look")

    @property
    def first(self) -> Problem | None:
        """The gravest finding that has a say in the state."""
        grave = [f for f in self.findings if _forces_repeat(f)] or list(self.findings)
        return grave[0].problem if grave else None


def judge_states(
    runs: Sequence[Run],
    seen: Sequence[Observation],
    landed: Mapping[str, str],
    planned: frozenset[str],
    moving: frozenset[str],
) -> tuple[list[RunStatus], list[list[Finding]]]:
    """State of every run, and the findings that so many runs share that no repeat will cure them."""
    common = _common([one.report.found for one in seen], [one.run.kind for one in seen])
    shared = {id(f) for group in common for f in group}
    found = {one.run.id: [f for f in one.report.found if id(f) not in shared] for one in seen}
    states = []
    for run in runs:
        own = tuple(sorted(found.get(run.id, []), key=lambda f: ("error", "warning", "note").index(f.problem.severity)))
        state: State = "to run"
        if run.id in moving:
            state = "being written"
        elif run.id in found:
            state = _state(own)
        states.append(RunStatus(run, state, own, landed.get(run.id, ""), run.id in planned))
    return _replaced(states), common


def _state(findings: Sequence[Finding]) -> State:
    if any(_forces_repeat(f) for f in findings):
        return "repeat"
    return "look" if any(f.problem.severity == "warning" for f in findings) else "good"


def _forces_repeat(finding: Finding) -> bool:
    severity = finding.problem.severity
    return severity == "error" or (severity == "warning" and finding.key.startswith(LOST_SAMPLES))


def _common(found: Sequence[Sequence[Finding]], kinds: Sequence[str]) -> list[list[Finding]]:
    """Findings that a third of the runs of their kinds have alike; notes are nobody's trouble."""
    groups: dict[str, list[Finding]] = {}
    of_kind: dict[str, set[str]] = {}
    for findings, kind in zip(found, kinds, strict=True):
        for finding in findings:
            if finding.problem.severity != "note":
                groups.setdefault(finding.key, []).append(finding)
                of_kind.setdefault(finding.key, set()).add(kind)
    common = []
    for key, group in groups.items():
        concerned = {f.problem.run for f in group}
        alike = sum(kind in of_kind[key] for kind in kinds)
        if len(concerned) >= COMMON_RUNS and len(concerned) >= COMMON_SHARE * alike:
            common.append(group)
    return common


def _replaced(states: Sequence[RunStatus]) -> list[RunStatus]:
    """A bad run is replaced by a later one of the same test that is better."""
    done = [s for s in states if s.counts]
    return [
        replace(s, state="replaced")
        if s.state == "repeat" and any(_same_test(s.run, d.run) and d.landed >= s.landed for d in done)
        else s
        for s in states
    ]


def _same_test(one: Run, other: Run) -> bool:
    alike = one.kind == other.kind and one.point == other.point and one.id != other.id
    return alike and (one.excitation_direction, one.pad, one.branch) == (
        other.excitation_direction, other.pad, other.branch)  # fmt: skip
