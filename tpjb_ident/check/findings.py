"""Findings of the check: from which answer on a question is told and in which words; what many runs share told once.

A question is one row of `questions.csv`: it compares one number with its limits; which number it is, the other files of
this folder say. An empty limit is never reached. `deviations` times the number is how uncertain a finding makes gain,
axis [rad] and low corner [Hz] of its channels: 1/1.6 of a change (`CHANGE_AS_DEVIATION`), 0.0109 of one in degrees.

Which wiring fault of two sensors (swapped, inverted, ten times off) would explain what they show goes with it.
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from rigdata.calibration import Channel
from rigdata.problem import Problem, Severity
from rigdata.run import Run
from rigdata.vector import inverse_directions
from tpjb_ident.rounding import listed

#: How the key of a finding begins that one channel reads too much or too little in one run.
RUN_GAIN = "gain "


class Question(NamedTuple):
    """Limits beyond which an answer is a note, a warning, an error; `{names}` are the channels that are asked."""

    limits: tuple[float, ...]
    place: str
    text: str
    cure: str
    of_channels: bool  #: whether it is the channels' nature, in whatever run they serve
    deviations: tuple[float, ...]


def _questions() -> dict[str, Question]:
    table = {}
    text = Path(__file__).with_name("questions.csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        limits = tuple(float(row[level] or math.inf) for level in ("note", "warning", "error"))
        more = bool(row["of_channels"]), tuple(map(float, row["deviations"].split()))
        table[row["name"]] = Question(limits, row["place"], row["text"], row["cure"], *more)
    return table


#: Every question by its name.
QUESTIONS = _questions()


def far(distances: FloatArray, least: float, many: float, count: int = 4) -> BoolArray:
    """Which of some values lie further off than the others: by `many` times their median distance, `least` at least.

    None where they are fewer than `count`.
    """
    if len(distances) < count:
        return np.zeros(len(distances), dtype=bool)
    return distances > max(least, many * float(np.median(distances)))


@dataclass(frozen=True)
class Finding:
    """A problem of one run, with a key that equal problems of other runs share."""

    problem: Problem
    key: str
    channels: tuple[str, ...] = ()  #: whose nature it is, in whatever run they serve; none: it is the run's own


@dataclass
class Reporter:
    """Gathers the findings of one run."""

    run: Run
    findings: list[Finding] = field(default_factory=list)
    cells_doubted: bool = False  #: what they show is held against nothing any more
    #: channels, with deviations of gain, axis [rad], low corner [Hz]; by channel: of its gain in this run
    doubted: list[tuple[str, FloatArray]] = field(default_factory=list)
    off: dict[str, float] = field(default_factory=dict)

    def copy(self) -> Reporter:
        """A reporter that has found the same so far."""
        return replace(self, findings=list(self.findings), doubted=list(self.doubted), off=dict(self.off))

    @property
    def keys(self) -> list[str]:
        """Keys of all findings."""
        return [finding.key for finding in self.findings]

    def ask(
        self, kind: str, size: float = 1.0, *names: str, hint: str = "", grave: Severity = "error", **words: Any
    ) -> str:
        """Note what a question of the table finds; its severity, "" where `size` is within the limits.

        `names` of channels, `hint`: the fault that would explain it, `grave`: what an error counts as.
        """
        question = QUESTIONS[kind]
        levels: tuple[Severity, ...] = ("note", "warning", grave)
        passed = [level for level, limit in zip(levels, question.limits) if size > limit]
        if not passed:
            return ""
        words |= {"names": " and ".join(names), "size": size}
        place, text = question.place.format(**words), question.text.format(**words) + hint
        key = f"{kind} {words['names']}".rstrip() + hint
        self.note(key, passed[-1], place, text, question.cure, names if question.of_channels else ())
        if question.deviations:  # independent ones, which hold what all channels are off by alike
            deviations = np.multiply(question.deviations, math.sqrt(len(names)) * size)
            self.doubted += [(name, deviations) for name in names]
        return passed[-1]

    def note(
        self, key: str, severity: Severity, place: str, what: str, cure: str, channels: Sequence[str] = ()
    ) -> None:
        """Note a finding; `key` is the same for equal findings in other runs, `channels` whose nature it is."""
        problem = Problem(severity, self.run.file, place, what, cure, self.run.id)
        self.findings.append(Finding(problem, key, tuple(channels)))

    def take(self, problems: Sequence[Problem]) -> None:
        """Note problems that a reader raised."""
        self.findings.extend(Finding(p, f"{p.place} {p.what}") for p in problems)


def is_shared(concerned: int, alike: int) -> bool:
    """Whether a finding is one of the campaign: a third of the runs alike have it, three at least."""
    return concerned >= 3 and 3 * concerned >= alike


def _alike(findings: Iterable[Finding]) -> Iterable[list[Finding]]:
    """Findings by key and severity."""
    groups = defaultdict(list)
    for finding in findings:
        groups[finding.key, finding.problem.severity].append(finding)
    return groups.values()


def grouped(findings: Iterable[Finding], runs: Sequence[Run]) -> Iterator[tuple[list[Finding], list[str]]]:
    """Equal findings, and the runs concerned where a third (three at least) of the runs of their kinds share them."""
    kind_of = {run.id: run.kind for run in runs}
    for group in _alike(findings):
        concerned = list(dict.fromkeys(f.problem.run for f in group if f.problem.run))
        kinds = {kind_of[r] for r in concerned}
        yield group, concerned if is_shared(len(concerned), sum(run.kind in kinds for run in runs)) else []


def merge(findings: Sequence[Finding], runs: Sequence[Run]) -> list[Problem]:
    """Tell a finding once that many runs share, with the file of the first."""
    merged = []
    for group, concerned in grouped(findings, runs):
        first = group[0].problem
        if concerned:
            text = f"{first.what}; and so in {len(concerned)} runs ({listed(concerned)})"
            merged.append(Problem(first.severity, first.file, first.place, text, first.cure))
        else:
            merged += [finding.problem for finding in group]
    return merged


@dataclass(frozen=True)
class Verdicts:
    """Findings by run."""

    unusable: dict[str, Problem] = field(default_factory=dict)
    shared: dict[str, list[Problem]] = field(default_factory=dict)
    doubtful: dict[str, list[Problem]] = field(default_factory=dict)
    run_gains: dict[str, list[Problem]] = field(default_factory=dict)
    doubted: list[tuple[str, FloatArray]] = field(default_factory=list)  #: as of `Reporter`
    off: dict[tuple[str, str], float] = field(default_factory=dict)  #: the same, by run and channel
    swept: dict[tuple[str, str], float] = field(default_factory=dict)  #: m: half a probe's travel, by sweep and probe


def reach(reports: Sequence[Reporter]) -> None:
    """Carry findings of static runs about channels to the dynamic runs that use these channels.

    What only one of many runs of its kind shows is that run's own: a cable was changed.
    """
    kinds = defaultdict(list)
    for report in reports:
        kinds[report.run.kind].append(report)
    dynamic = kinds.pop("dynamic", [])
    for alike in kinds.values():
        findings = []
        for report in alike:
            findings += [f for f in report.findings if f.channels]
        for group in _alike(findings):
            if len(group) < len(alike) and not is_shared(len(group), len(alike)):
                continue
            for report in dynamic:
                if set(group[0].channels) & set(report.run.channels):
                    report.findings.append(Finding(group[0].problem, group[0].key))


def verdicts(reports: Sequence[Reporter]) -> Verdicts:
    """Sort the findings of runs of one kind."""
    groups: dict[tuple[str, Severity], dict[str, Problem]] = {}
    for report in reports:
        for finding in report.findings:
            groups.setdefault((finding.key, finding.problem.severity), {}).setdefault(report.run.id, finding.problem)
    result = Verdicts()
    alike = len({report.run.id for report in reports})
    for (key, severity), concerned in groups.items():
        warnings = result.run_gains if key.startswith(RUN_GAIN) else result.doubtful
        if severity == "error" and not is_shared(len(concerned), alike):
            result.unusable.update(concerned | result.unusable)
        elif severity != "note":
            gathered = warnings if severity == "warning" else result.shared
            for run, problem in concerned.items():
                gathered.setdefault(run, []).append(problem)
    return result


def repairs(channels: Sequence[Channel], scales: bool = False) -> Iterator[tuple[str, FloatArray]]:
    """Every simple mending of two channels' readings, as a matrix on X and Y, with the fault in words."""
    if len(channels) != 2:
        return
    first, second = (c.name for c in channels)
    faults = [
        (f"{first} and {second} were swapped", np.array([[0.0, 1.0], [1.0, 0.0]])),
        (f"{first} had the wrong sign", np.diag([-1.0, 1.0])),
        (f"{second} had the wrong sign", np.diag([1.0, -1.0])),
        (f"{first} and {second} both had the wrong sign", -np.eye(2)),
    ]
    for factor, size in ((0.1, "large"), (10.0, "small")) if scales else ():
        faults.append((f"{first} read ten times too {size}", np.diag([factor, 1.0])))
        faults.append((f"{second} read ten times too {size}", np.diag([1.0, factor])))
    plane = inverse_directions(channels)
    for words, matrix in faults:
        yield words, plane @ matrix @ np.linalg.inv(plane)


def explanation(
    tried: Iterable[tuple[str, FloatArray]], misfit: Callable[[FloatArray], float], limit: float, alike: int = 1
) -> str:
    """The fault whose mending leaves the least misfit; "" where none leaves less than `limit`.

    Where more than `alike` of them leave no more than twice the least, none is named: else the simplest, the first.
    """
    misfits = [(misfit(matrix), words) for words, matrix in tried]
    least = min((size for size, _ in misfits), default=np.inf)
    close = [words for size, words in misfits if size < limit and size <= 2 * least]
    return f"; as if {close[0]}" if 0 < len(close) <= alike else ""


def pointing(vector: FloatArray, wanted: float, within: float) -> Callable[[FloatArray], float]:
    """Angle [deg] between a vector (2,) that is mended and a direction [deg]; all `within` of it count alike."""

    def misfit(repair: FloatArray) -> float:
        mended = repair @ vector
        off = np.degrees(np.arctan2(mended[1], mended[0])) - wanted
        return max(within / 2, abs((off + 180.0) % 360.0 - 180.0))

    return misfit


def indefiniteness(matrix: FloatArray) -> float:
    """Greatest over least eigenvalue of the symmetric part; 1 is isotropic, 1e9 where a matrix is impossible."""
    low, high = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    return float(high / low) if low > 1e-9 * abs(high) else 1e9
