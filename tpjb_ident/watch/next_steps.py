"""How the runs of a plan stand, and what to do next: what to repair, to repeat, to run, and what the plan lacks."""

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem
from rigdata.run import Run
from tpjb_ident.check.findings import Finding, grouped
from tpjb_ident.check.observation import Observation
from tpjb_ident.columns import place_of, set_point
from tpjb_ident.conditions import SEVERITIES
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.rounding import counted, listed

State = Literal["to run", "being written", "good", "look", "repeat", "replaced"]
#: Warnings of the check that only another record repairs: what was lost cannot be calibrated back.
_LOST_SAMPLES = ("clipped", "dead", "empty", "missing", "stuck", "gap", "jitter", "short", "no excitation", "step")


#: Key of the finding that a record is cut off, which says nothing of the next one.
_CUT = "short record"


@dataclass(frozen=True)
class RunStatus:
    """One run of the plan, or beside it."""

    run: Run
    state: State
    findings: tuple[Finding, ...] = field(default=(), repr=False)  #: the most urgent first
    landed: str = ""
    planned: bool = True

    @property
    def counts(self) -> bool:
        """Whether the test that it stands for is done."""
        return self.state in ("good", "look")


def judge_states(
    expected: Sequence[RunStatus], observations: Sequence[Observation]
) -> tuple[list[RunStatus], list[list[Finding]]]:
    """State of every run, and the findings that so many runs share that no repeat will cure them."""
    reported = {observation.run.id: observation.report.findings for observation in observations}
    grave = [f for f in itertools.chain.from_iterable(reported.values()) if f.problem.severity != "note"]
    groups = grouped(grave, [observation.run for observation in observations])
    common = [group for group, concerned in groups if concerned]
    shared = set(map(id, itertools.chain.from_iterable(common)))
    states = []
    for status in expected:
        of_run = reported.get(status.run.id)
        if status.state == "to run" and of_run is not None:
            # what has a say in the state of a run comes first, then the gravest
            order = sorted(of_run, key=lambda f: (not _forces_repeat(f), SEVERITIES.index(f.problem.severity)))
            findings = [finding for finding in order if id(finding) not in shared]
            grave = [finding for finding in findings if finding.problem.severity != "note"]
            state: State = "repeat" if any(map(_forces_repeat, findings)) else "look" if grave else "good"
            status = replace(status, state=state, findings=tuple(findings))
        states.append(status)
    # a bad run is replaced by a later one of the same test that is better
    done = [status for status in states if status.counts]
    for number, status in enumerate(states):
        for later in done if status.state == "repeat" else ():
            if _test(later.run) == _test(status.run) and later.landed >= status.landed:
                states[number] = replace(status, state="replaced")
    return states, common


def _forces_repeat(finding: Finding) -> bool:
    severity = finding.problem.severity
    return severity == "error" or (severity == "warning" and finding.key.startswith(_LOST_SAMPLES))


def _test(run: Run) -> tuple[object, ...]:
    """What two records have in common that repeat one test."""
    return run.kind, run.point, run.excitation_direction, run.pad, run.branch


#: From so many records in a row with one fault on, the sensor is to be repaired before another one is made.
_IN_A_ROW = 2
#: Kinds of runs with a turning shaft.
_TURNING = ("dynamic", "locus")


@dataclass(frozen=True)
class Step:
    """One thing to do."""

    kind: str
    text: str
    runs: tuple[str, ...] = ()


def next_steps(
    states: Sequence[RunStatus],
    common: Sequence[Sequence[Finding]],
    points: Sequence[PointResult],
    within: float | None,
) -> list[Step]:
    """Everything to do, most urgent first."""
    stop, stopped = _stop(states)
    turning = [status for status in reversed(states) if status.landed and status.run.kind in _TURNING]
    # the running test that landed last: what the rig stands at
    at = max(turning, key=lambda status: status.landed).run if turning else None
    repairs = []
    for group in common:
        problem, runs = group[0].problem, tuple(dict.fromkeys(str(f.problem.run) for f in group))
        text = f"Look into this, it is in {len(runs)} runs alike ({listed(runs)}): {located(problem)}. {problem.cure}."
        repairs.append(Step("mend", text, runs))
    return [
        *stop,
        *_repeats([s for s in states if s.run.id not in stopped], at),
        *repairs,
        *_precision_steps(states, points, within),
        *_next(states, at),
    ]


def _set_up(run: Run) -> tuple[float, float, float]:
    """Load [N], its direction [rad] and speed [rad/s]: what takes time to change at the rig."""
    return run.point.static_load, run.point.static_load_direction, run.point.spin


def described(run: Run) -> str:
    """A test in words and units."""
    if run.kind == "dry_pivot":
        return f"dry load steps on pad #{run.pad}, {run.branch}"
    if run.kind == "clearance":
        return "clearance sweep"
    direction = run.excitation_direction
    along = "" if direction is None else f", along {math.degrees(direction):.0f} deg"
    return set_point(run.point) + along


def lacking(point: PointResult) -> str:
    """What an operating point lacks for K and C; "" where it has them."""
    if np.isfinite(point.stiffness.h).all():
        return ""
    if point.n_records == 1:
        return "no K and C yet: they take a second record, excited in another direction"
    reason = "; ".join(q.sentence() for q in point.quality) or "the records do not determine them"
    return f"no K and C from {point.n_records} records: {reason}"


def located(problem: Problem) -> str:
    """What is wrong and where, without the file's name."""
    return f"{problem.place}: {problem.what}" if problem.place else problem.what


def _stop(states: Sequence[RunStatus]) -> tuple[list[Step], set[str]]:
    """A fault of one channel in the last records in a row: the next one will have it too."""
    landed = sorted(filter(lambda s: s.landed, states), key=lambda s: s.landed)[::-1]
    steps = []
    stopped: set[str] = set()
    for finding in landed[0].findings if landed else ():
        if finding.problem.severity == "note" or finding.key == _CUT or not finding.key.startswith(_LOST_SAMPLES):
            continue
        with_it = itertools.takewhile(lambda s: finding.key in {f.key for f in s.findings}, landed)  # noqa: B023 (here)
        runs = tuple(s.run.id for s in with_it)[::-1]
        if len(runs) >= _IN_A_ROW:
            stopped.update(runs)
            p = finding.problem
            text = f"Stop: {located(p)}, in the last {len(runs)} records ({listed(runs)}). {p.cure}, then repeat them."
            steps.append(Step("stop", text, runs))
    return steps, stopped


def _repeats(states: Sequence[RunStatus], at: Run | None) -> list[Step]:
    """Runs to be made again: first what the rig stands at, then what takes another set-up."""
    steps = []
    for status in states:
        if status.state != "repeat":
            continue
        problem, run, is_later = status.findings[0].problem, status.run, False
        when = f"({described(run)})"
        if run.kind in _TURNING:
            is_later = at is not None and _set_up(run) != _set_up(at)
            back = f"when you are back at {set_point(replace(run.point, excitation=0.0))}"
            when = back if is_later else "before you change the load"
        text = f"Repeat {run.id} {when}: {located(problem)}. {problem.cure}."
        steps.append((is_later, Step("repeat", text, (run.id,))))
    return [step for _, step in sorted(steps, key=lambda pair: pair[0])]


def _precision_steps(states: Sequence[RunStatus], points: Sequence[PointResult], within: float | None) -> list[Step]:
    """Points that are measured as planned and still not as sure as wanted."""
    if within is None:
        return []
    unfinished = {s.run.point for s in states if s.state in ("to run", "being written", "repeat")}
    steps = []
    for point in points:
        direct, solved = list(_DIRECT.values()), point.stiffness
        mean = np.repeat(np.abs(solved.vector[direct]).reshape(2, 2).mean(axis=1), 2)
        # what is not known at all is told elsewhere
        widths = np.nan_to_num(solved.half_width()[direct] / mean, nan=-1.0, posinf=-1.0)
        worst = widths.argmax()
        widest, name = widths[worst], list(_DIRECT)[worst]
        random_alone = (solved.half_width(systematic=False)[direct] / mean)[worst]
        if point.point in unfinished or not widest > within:
            continue
        share = f"{point.place}: {name} is known to {100 * widest:.1f} %, {100 * within:g} % is wanted"
        random_allowed = within**2 - max(0.0, widest**2 - random_alone**2)
        if random_allowed <= 0.25 * within**2:
            steps.append(Step("more", f"{share}; calibration sets that, more records do not help."))
        else:
            count = math.ceil(point.n_records * (random_alone**2 / random_allowed - 1.0))
            many = f"about {counted(count, 'more record')} like those there would do"
            steps.append(Step("more", f"{share}; {many}.", point.runs))
    return steps


#: Direct coefficients and their places among (kxx, kxy, kyx, kyy, cxx, .. cyy).
_DIRECT = {"kxx": 0, "kyy": 3, "cxx": 4, "cyy": 7}


def _next(states: Sequence[RunStatus], at: Run | None) -> list[Step]:
    waiting = [s.run for s in states if s.state == "to run"]
    if not waiting:
        unfinished = [s for s in states if s.state in ("repeat", "being written")]
        return [] if unfinished else [Step("next", "Every run of the plan has landed.")]
    group = []
    if at is not None:
        group = [run for run in waiting if run.kind in _TURNING and _set_up(run) == _set_up(at)]
    run = (group or waiting)[0]
    remainder = f"{len(group) - 1} more at this load" if len(group) > 1 else f"{len(waiting) - 1} more in the plan"
    change = "" if group or at is None else " (new set-up)"
    return [Step("next", f"Next: {run.id}, {described(run)}{change}. After it {remainder}.", (run.id,))]


def plan_lacks(runs: Sequence[Run], n_pads: int) -> list[str]:
    """What a plan leaves out that the results will want."""
    lacks = []
    directions_of: dict[OperatingPoint, set[float | None]] = defaultdict(set)
    for run in runs:
        if run.kind == "dynamic":
            directions_of[run.point].add(run.excitation_direction)
    lonely = [p for p, directions in directions_of.items() if len(directions) == 1 and None not in directions]
    if lonely:
        first = listed([place_of(p.static_load, p.excitation_hz) for p in lonely], 3, "; ")
        lacks.append(f"{counted(len(lonely), 'operating point')} shaken in one direction ({first}): K and C need two.")
    pads = {run.pad for run in runs if run.kind == "dry_pivot"}
    without = [f"#{pad}" for pad in range(1, n_pads + 1) if pad not in pads]
    if without:
        lacks.append(f"No dry load steps on pad {', '.join(without)}: the pivot stiffness there stays unknown.")
    if not any(run.kind == "clearance" for run in runs):
        lacks.append("No clearance sweep: positions count from the probes' zero, and clearances stay the drawing's.")
    return lacks
