"""Looks at a campaign's folder again and again: what landed, how good it is, what it gives, what comes next."""

from __future__ import annotations

import datetime
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median

import numpy as np

from rigdata.campaign import MANIFEST_NAME, Campaign, load_campaign
from rigdata.problem import Problem, RigDataError, RigError
from rigdata.run import Run
from rigdata.safe_path import inside
from rigdata.survey.exports import records_below
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.findings import Finding
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.clearance.measure import ClearancePolygon, measure_clearance
from tpjb_ident.dynamic.results.identification import Identification
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.runs.run_store import RunStore
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.errors import TpjbError
from tpjb_ident.identification.identify import identify
from tpjb_ident.pivot import PivotSettings, fit_pivots
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.watch.landing import FileState, NewFiles, Unplanned, file_state, place_record, unplanned_problems
from tpjb_ident.watch.next_steps import RunStatus, Step, judge_states, next_steps, plan_lacks

#: A whole identification that took longer [s] is made of the points with news alone.
_PATIENCE = 30.0
#: What a record or a campaign that is not complete yet may raise.
_REFUSALS = (RigError, TpjbError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Measured:
    """Results so far."""

    identification: Identification | None = None
    curves: tuple[PivotCurve, ...] = ()
    polygon: ClearancePolygon | None = None
    refusals: tuple[str, ...] = ()

    @property
    def points(self) -> tuple[PointResult, ...]:
        """Operating points with an estimate."""
        return () if self.identification is None else self.identification.points


@dataclass
class Measuring:
    """Makes results of the runs so far, and only what has news."""

    settings: IdentifySettings
    pad_angles: tuple[float, ...] = ()
    store: RunStore | None = None
    _took: float = 0.0
    _observed: dict[str, frozenset[tuple[str, object]]] = field(default_factory=dict)
    _last: Measured = field(default_factory=Measured)

    def update(self, campaign: Campaign, marks: dict[str, object]) -> Measured:
        """Results of a campaign of the runs that count; `marks` by run change with its record."""
        refusals: list[str] = []
        last = self._last
        identification, curves, polygon = self._identify(campaign, marks, refusals), last.curves, last.polygon
        if self.pad_angles and self._news(campaign, "dry_pivot", marks):
            curves = ()
            if campaign.of_kind("dry_pivot"):
                try:
                    curves = fit_pivots(campaign, self.pad_angles, PivotSettings(on_refusal="skip"))
                except _REFUSALS as error:
                    refusals.append(f"pivots: {error}")
        if self.pad_angles and self._news(campaign, "clearance", marks):
            polygon = None
            if campaign.of_kind("clearance"):
                try:
                    polygon = measure_clearance(campaign, self.pad_angles)
                except _REFUSALS as error:
                    refusals.append(f"clearance: {error}")
        self._last = Measured(identification, curves, polygon, tuple(refusals))
        return self._last

    def _news(self, campaign: Campaign, kind: str, marks: dict[str, object]) -> set[str]:
        """Ids of runs of a kind that came, changed or went since the last time."""
        current = frozenset((run.id, marks.get(run.id)) for run in campaign.of_kind(kind))
        before = self._observed.get(kind, frozenset())
        self._observed[kind] = current
        return {run_id for run_id, _ in current ^ before}

    def _identify(self, campaign: Campaign, marks: dict[str, object], refusals: list[str]) -> Identification | None:
        """Coefficients of all points, or of those with news where all would take too long."""
        news, last = self._news(campaign, "dynamic", marks), self._last.identification
        points = {run.point for run in campaign.of_kind("dynamic")}
        if not points or not news:
            return last if points else None
        selected = campaign
        if self._took > _PATIENCE and last is not None:
            changed = {run.point for run in campaign.of_kind("dynamic") if run.id in news}
            runs = [run for run in campaign.runs if run.point in changed or run.kind != "dynamic"]
            selected = replace(campaign, runs=tuple(runs))
        began = time.monotonic()
        try:
            identification = identify(selected, self.settings, store=self.store)
        except _REFUSALS as error:
            refusals.append(f"identification: {error}")
            return last
        if selected is campaign or last is None:
            self._took = time.monotonic() - began
            return identification
        # the new points in the place of the old ones of the same set point
        joined = {p.point: p for p in (*last.points, *identification.points) if p.point in points}
        return replace(identification, points=tuple(joined[point] for point in sorted(joined)))


#: Share of the usual length below which a record was cut off.
_WHOLE = 0.8


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
class _Observed:
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
    files: NewFiles
    measuring: Measuring
    within: float | None = None
    _campaign: Campaign | None = None
    _manifest: FileState | None = None
    _observed: dict[str, _Observed] = field(default_factory=dict)
    _placed: dict[Path, tuple[FileState, Unplanned]] = field(default_factory=dict)
    _last: tuple[object, ...] = ()

    def look(self) -> Snapshot | None:
        """Look once; None where nothing has changed since the last look."""
        if not self.folder.is_dir():  # a share that is away comes back; its records are not gone
            return None
        campaign, problems = self._opened()
        planned = {run.file: self.folder / run.file for run in campaign.runs}
        listed = {path.resolve() for path in campaign.files.values()}
        unlisted = [path for path in records_below(self.folder) if path.resolve() not in listed]
        within = [path for path in (*planned.values(), *unlisted) if self._is_within(path, problems)]
        stable, written = self.files.look(within)
        state = (self._manifest, tuple(problems), tuple(stable.items()), tuple(written))
        if state == self._last:
            return None
        done = frozenset(run.id for run in campaign.runs if planned[run.file] in stable)
        placed = self._place(campaign, unlisted, stable, done)
        runs = [*campaign.runs, *(record.run for record in placed if record.run is not None)]
        new = self._observe(runs, stable)
        # a record that changed while it was read is looked at again: the next look must not take this one for it
        self._last = state if all(file_state(p) == s for p, s in stable.items()) else ()
        return self._snapshot(campaign, runs, placed, problems, {p.resolve() for p in written}, new)

    def _is_within(self, path: Path, problems: list[Problem]) -> bool:
        """Whether a record is in the folder: a link that leads out of it may appear at any time, and is not opened."""
        try:
            inside(self.folder, path.relative_to(self.folder).as_posix(), path.name, "")
        except RigDataError as error:
            problems.extend(error.problems)
            return False
        return True

    @property
    def waits(self) -> bool:
        """Whether a record was being written at the last look."""
        return not self._last or bool(self._last[3])

    def look_again(self) -> None:
        """Have the next look report everything, changed or not: the report of this one could not be written."""
        self._last = ()

    def _opened(self) -> tuple[Campaign, list[Problem]]:
        """The campaign by its manifest; by the last one that could be read while the manifest is being edited."""
        path = self.folder / MANIFEST_NAME
        state = file_state(path)
        if self._campaign is not None and state == self._manifest:
            return self._campaign, []
        try:
            self._campaign, self._manifest = load_campaign(self.folder), state
        except RigDataError as error:
            if self._campaign is None:
                raise
            what = "cannot be read as it is; the watch goes on with the last one that could be"
            problem = Problem("warning", MANIFEST_NAME, "", what, "Finish editing it")
            return self._campaign, [problem, *error.problems]
        self._placed.clear()
        return self._campaign, []

    def _place(
        self, campaign: Campaign, unlisted: list[Path], stable: dict[Path, FileState], done: frozenset[str]
    ) -> list[Unplanned]:
        placed = []
        for path in unlisted:
            state = stable.get(path)
            if state is None:
                continue
            if path not in self._placed or self._placed[path][0] != state:
                self._placed[path] = (state, place_record(campaign, path, done))
            placed.append(self._placed[path][1])
        return placed

    def _observe(self, runs: list[Run], stable: dict[Path, FileState]) -> list[str]:
        """Read what is new; forget what is gone. Ids of the runs with news."""
        new = []
        observed: dict[str, _Observed] = {}
        for run in runs:
            path = self.folder / run.file
            state = stable.get(path)
            if state is None:
                continue
            mark = (state, run.kind, run.point, run.excitation_direction, run.pad, run.branch, repr(run.channels))
            before = self._observed.get(run.id)
            if before is not None and before.mark == mark:
                observed[run.id] = before
                continue
            record = _Observed(mark, observe(run), _iso(state), _digest(path), seconds(run))
            if file_state(path) == state and self._is_within(path, []):
                observed[run.id] = record
                new.append(run.id)
        self._observed = observed
        return new

    def _snapshot(
        self,
        campaign: Campaign,
        runs: list[Run],
        placed: list[Unplanned],
        problems: list[Problem],
        written: set[Path],
        new: list[str],
    ) -> Snapshot:
        landed = tuple(run for run in runs if run.id in self._observed)
        records = [self._observed[run.id] for run in landed]
        observations, _ = judged(replace(campaign, runs=landed), [record.observation for record in records])
        _name_cut_records(observations, [record.seconds for record in records])
        when = {run.id: record.landed for run, record in zip(landed, records, strict=True)}
        planned = frozenset(run.id for run in campaign.runs)
        open_runs = frozenset(run.id for run in runs if (self.folder / run.file).resolve() in written)
        done = {record.like for record in placed if record.run is not None}
        listed = [run for run in runs if run.id in self._observed or run.id in open_runs or run.id not in done]
        states, common = judge_states(listed, observations, when, planned, open_runs)
        good = tuple(status.run for status in states if status.counts)
        marks = {run_id: record.mark for run_id, record in self._observed.items()}
        measured = self.measuring.update(replace(campaign, runs=good), marks)
        steps = next_steps(states, common, measured.points, self.within)
        lacks = plan_lacks(runs, len(self.measuring.pad_angles))
        return Snapshot(
            campaign=campaign,
            states=tuple(states),
            steps=tuple(steps),
            lacks=tuple(lacks),
            measured=measured,
            problems=(*problems, *campaign.notes, *unplanned_problems(placed)),
            new=tuple(new),
            hashes={run.file: record.digest for run, record in zip(landed, records, strict=True)},
            placed=tuple(placed),
        )


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


def _name_cut_records(observations: Sequence[Observation], lengths: Sequence[float]) -> None:
    """Note records below `_WHOLE` of the median length of their kind, before everything else that follows from it."""
    of_kind: dict[str, list[float]] = {}
    for observation, length in zip(observations, lengths, strict=True):
        if length > 0:
            of_kind.setdefault(observation.run.kind, []).append(length)
    for observation, length in zip(observations, lengths, strict=True):
        same_kind = of_kind.get(observation.run.kind, [0.0])
        usual = median(same_kind)
        if 0 < length < _WHOLE * usual and len(same_kind) > 2:
            cure = "Copy it again from the logger, or repeat the run"
            what = f"{length:.3g} s long, the others of its kind {usual:.3g} s: cut off, or not written to its end"
            observation.report.say("short record", "error", "record", what, cure)
            found: list[Finding] = observation.report.found
            found.insert(0, found.pop())
