"""Looks at a campaign's folder again and again: what landed, how good it is, what it gives, what comes next."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median

from rigdata.campaign import MANIFEST_NAME, Campaign, load_campaign
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from rigdata.survey.exports import records_below
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.findings import Finding
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.watch.landing import FileState, Landings, Unplanned, file_state, place_record, unplanned_problem
from tpjb_ident.watch.measured import Measured, Measuring
from tpjb_ident.watch.next_steps import RunStatus, Step, judge_states, next_steps, plan_lacks

#: Share of the usual length below which a record was cut off.
WHOLE = 0.8


@dataclass(frozen=True)
class Snapshot:
    """How a campaign stands at one moment."""

    campaign: Campaign
    states: tuple[RunStatus, ...]
    steps: tuple[Step, ...]
    lacks: tuple[str, ...]
    measured: Measured
    problems: tuple[Problem, ...]
    new: tuple[str, ...]
    hashes: dict[str, str] = field(repr=False)
    placed: tuple[Unplanned, ...] = ()

    def count(self, *states: str) -> int:
        """Runs in some states."""
        return sum(s.state in states for s in self.states)


@dataclass(frozen=True)
class _Seen:
    """A record as it was read; `mark` changes when its file or its description does."""

    mark: object
    observation: Observation
    landed: str
    digest: str
    seconds: float


@dataclass
class Watcher:
    """Follows one campaign folder."""

    folder: Path
    landings: Landings
    measuring: Measuring
    within: float | None = None
    _campaign: Campaign | None = None
    _manifest: FileState | None = None
    _seen: dict[str, _Seen] = field(default_factory=dict)
    _placed: dict[Path, tuple[FileState, Unplanned]] = field(default_factory=dict)
    _last: tuple[object, ...] = ()

    def look(self) -> Snapshot | None:
        """Look once; None where nothing has changed since the last look."""
        if not self.folder.is_dir():  # a share that is away comes back; its records are not gone
            return None
        campaign, problems = self._opened()
        planned = {run.file: self.folder / run.file for run in campaign.runs}
        known = {path.resolve() for path in campaign.files.values()}
        beside = [p for p in records_below(self.folder) if p.resolve() not in known]
        resting, moving = self.landings.look([*planned.values(), *beside])
        seen = (self._manifest, tuple(problems), tuple(resting.items()), tuple(moving))
        if seen == self._last:
            return None
        placed = self._place(campaign, beside, resting, frozenset(r.id for r in campaign.runs
                                                                 if planned[r.file] in resting))  # fmt: skip
        runs = [*campaign.runs, *(one.run for one in placed if one.run is not None)]
        new = self._observe(runs, resting)
        # a record that changed while it was read is looked at again: the next look must not take this one for it
        self._last = seen if all(file_state(p) == s for p, s in resting.items()) else ()
        return self._snapshot(campaign, runs, placed, problems, {p.resolve() for p in moving}, new)

    @property
    def waits(self) -> bool:
        """Whether a record was being written at the last look."""
        return not self._last or bool(self._last[3])

    def look_again(self) -> None:
        """Have the next look tell everything, changed or not: what this one told could not be written."""
        self._last = ()

    def _opened(self) -> tuple[Campaign, list[Problem]]:
        """The campaign by its manifest; by the last one that could be read while the manifest is being edited."""
        path = self.folder / MANIFEST_NAME
        state = file_state(path)
        if self._campaign is not None and state == self._manifest:
            return self._campaign, []
        try:
            self._campaign, self._manifest = load_campaign(path), state
        except RigDataError as error:
            if self._campaign is None:
                raise
            told = Problem("warning", MANIFEST_NAME, "", "cannot be read as it is; the watch goes on with the last one "
                           "that could be", "Finish editing it")  # fmt: skip
            return self._campaign, [told, *error.problems]
        self._placed.clear()
        return self._campaign, []

    def _place(
        self, campaign: Campaign, beside: list[Path], resting: dict[Path, FileState], done: frozenset[str]
    ) -> list[Unplanned]:
        placed = []
        for path in beside:
            state = resting.get(path)
            if state is None:
                continue
            known = self._placed.get(path)
            if known is None or known[0] != state:
                self._placed[path] = known = (state, place_record(campaign, path, done))
            placed.append(known[1])
        return placed

    def _observe(self, runs: list[Run], resting: dict[Path, FileState]) -> list[str]:
        """Read what is new; forget what is gone. Ids of the runs with news."""
        new = []
        kept: dict[str, _Seen] = {}
        for run in runs:
            path = self.folder / run.file
            state = resting.get(path)
            if state is None:
                continue
            mark = (state, run.kind, run.point, run.excitation_direction, run.pad, run.branch, repr(run.channels))
            before = self._seen.get(run.id)
            if before is not None and before.mark == mark:
                kept[run.id] = before
                continue
            found = _Seen(mark, observe(run), _iso(state), _digest(path), seconds(run))
            if file_state(path) == state:
                kept[run.id] = found
                new.append(run.id)
        self._seen = kept
        return new

    def _snapshot(
        self,
        campaign: Campaign,
        runs: list[Run],
        placed: list[Unplanned],
        problems: list[Problem],
        moving: set[Path],
        new: list[str],
    ) -> Snapshot:
        landed = [run for run in runs if run.id in self._seen]
        seen = judged(replace(campaign, runs=tuple(landed)), [self._seen[run.id].observation for run in landed])
        _name_cut_records(seen, [self._seen[run.id].seconds for run in landed])
        when = {run.id: self._seen[run.id].landed for run in landed}
        planned = frozenset(run.id for run in campaign.runs)
        written = frozenset(run.id for run in runs if (self.folder / run.file).resolve() in moving)
        done = {one.like for one in placed if one.run is not None}
        listed = [r for r in runs if r.id in self._seen or r.id in written or r.id not in done]
        states, common = judge_states(listed, seen, when, planned, written)
        good = tuple(s.run for s in states if s.counts)
        marks = {run_id: one.mark for run_id, one in self._seen.items()}
        measured = self.measuring.update(replace(campaign, runs=good), marks)
        steps = next_steps(states, common, measured.points, self.within)
        lacks = plan_lacks(runs, len(self.measuring.pad_angles))
        told = [*problems, *campaign.notes, *unplanned_problem(placed)]
        return Snapshot(campaign, tuple(states), tuple(steps), tuple(lacks), measured, tuple(told), tuple(new),
                        {run.file: self._seen[run.id].digest for run in landed}, tuple(placed))  # fmt: skip


def _iso(state: FileState) -> str:
    """Time of the last change, in ISO form, of this place."""
    changed = datetime.datetime.fromtimestamp(1e-9 * state.changed, datetime.UTC)
    return changed.astimezone().isoformat(timespec="milliseconds")


def _digest(path: Path) -> str:
    try:
        return sha256(path)
    except OSError:  # gone or locked again: its state tells
        return "missing"


def seconds(run: Run) -> float:
    """Length of a record [s]; 0 where it cannot be told."""
    try:
        return run.length / run.sample_rate
    except RigDataError:
        return 0.0


def _name_cut_records(seen: Sequence[Observation], lengths: Sequence[float]) -> None:
    """Note records below `WHOLE` of the median length of their kind, before everything else that follows from it."""
    of_kind: dict[str, list[float]] = {}
    for one, length in zip(seen, lengths, strict=True):
        if length > 0:
            of_kind.setdefault(one.run.kind, []).append(length)
    for one, length in zip(seen, lengths, strict=True):
        usual = median(of_kind[one.run.kind]) if one.run.kind in of_kind else 0.0
        if 0 < length < WHOLE * usual and len(of_kind[one.run.kind]) > 2:
            what = f"{length:.3g} s long, the others of its kind {usual:.3g} s: cut off, or not written to its end"
            one.report.say("short record", "error", "record", what, "Copy it again from the logger, or repeat the run")
            found: list[Finding] = one.report.found
            found.insert(0, found.pop())
