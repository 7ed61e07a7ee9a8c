"""Looks at a campaign's folder again and again: what landed, how good it is, what it gives, what comes next."""

import contextlib
import datetime
import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.campaign import MANIFEST_NAME, Campaign, inside, load_campaign
from rigdata.problem import Problem, RigDataError, RigError
from rigdata.run import Run
from rigdata.survey.exports import records_below
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.clearance.measure import ClearancePolygon, measure_clearance
from tpjb_ident.errors import TpjbError
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.fit import fit_pivots
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.runs.run_jobs import FileState, RunStore, file_state
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.watch.landing import NewFiles, Unplanned, place_record
from tpjb_ident.watch.next_steps import RunStatus, State, Step, judge_states, next_steps, plan_lacks


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
class _Record:
    """A record as it was read; `mark` changes when its file or its description does."""

    mark: object
    observation: Observation
    landed: str
    digest: str


@dataclass
class Watcher:
    """Follows one campaign folder; what it made of files is made anew when they change."""

    folder: Path
    files: NewFiles
    bearing: Any = None
    store: RunStore | None = None
    within: float | None = None
    _campaign: Campaign | None = None
    _manifest: FileState | None = None
    _records: dict[str, _Record] = field(default_factory=dict)
    _cache: dict[object, tuple[object, Any]] = field(default_factory=dict)
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
        state = self._manifest, tuple(problems), tuple(stable.items()), tuple(written)
        if state == self._last:
            return None
        done = frozenset(run.id for run in campaign.runs if planned[run.file] in stable)
        placed = []
        for path in filter(stable.__contains__, unlisted):
            make = functools.partial(place_record, campaign, path, done)
            placed.append(self._unless_changed(path, (stable[path], self._manifest), make))
        runs = [*campaign.runs, *(record.run for record in placed if record.run is not None)]
        new = self._observe(runs, stable)
        # a record that changed while it was read is looked at again: the next look must not take this one for it
        self._last = state if {path: file_state(path) for path in stable} == stable else ()
        return self._snapshot(campaign, runs, placed, problems, {p.resolve() for p in written}, new)

    def _unless_changed(self, key: object, mark: object, make: Callable[[], Any]) -> Any:
        """What was made last time, unless its mark is another one now."""
        if key not in self._cache or self._cache[key][0] != mark:
            self._cache[key] = mark, make()
        return self._cache[key][1]

    def _is_within(self, path: Path, problems: list[Problem]) -> bool:
        """Whether a record is in the folder: a link that leads out of it may appear at any time, and is not opened."""
        try:
            inside(self.folder, path.relative_to(self.folder).as_posix(), path.name, "")
        except RigDataError as error:
            problems += error.problems
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
        state = file_state(self.folder / MANIFEST_NAME)
        if self._campaign is not None and state == self._manifest:
            return self._campaign, []
        problems = []
        try:
            self._campaign, self._manifest = load_campaign(self.folder), state
        except RigDataError as error:
            if self._campaign is None:
                raise
            fault = "cannot be read as it is; the watch goes on with the last one that could be"
            problems = [Problem("warning", MANIFEST_NAME, "", fault, "Finish editing it"), *error.problems]
        return self._campaign, problems

    def _observe(self, runs: list[Run], stable: dict[Path, FileState]) -> list[str]:
        """Read what is new; forget what is gone. Ids of the runs with news."""
        new = []
        records = {}
        for run in runs:
            path = self.folder / run.file
            state = stable.get(path)
            if state is None:
                continue
            mark = (state, run.kind, run.point, run.excitation_direction, run.pad, run.branch, repr(run.channels))
            record = self._records.get(run.id)
            if record is None or record.mark != mark:
                record = _read(run, path, mark)
                if file_state(path) != state or not self._is_within(path, []):
                    continue
                new.append(run.id)
            records[run.id] = record
        self._records = records
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
        records = {run.id: self._records[run.id] for run in runs if run.id in self._records}
        landed = tuple(run for run in runs if run.id in records)
        observations, _ = judged(replace(campaign, runs=landed), [record.observation for record in records.values()])
        planned = {run.id for run in campaign.runs}
        done = {record.like for record in placed if record.run is not None}
        expected = []
        for run in runs:
            state: State = "being written" if (self.folder / run.file).resolve() in written else "to run"
            if run.id in records or state == "being written" or run.id not in done:
                moment = records[run.id].landed if run.id in records else ""
                expected.append(RunStatus(run, state, landed=moment, planned=run.id in planned))
        states, common = judge_states(expected, observations)
        measured = self._measured(replace(campaign, runs=tuple(status.run for status in states if status.counts)))
        cure = "Add a [[runs]] table for it to campaign.toml, or move it out of the folder"
        unknown = [Problem("warning", record.file, "", record.why, cure) for record in placed if record.run is None]
        return Snapshot(
            campaign=campaign,
            states=tuple(states),
            steps=tuple(next_steps(states, common, measured.points, self.within)),
            lacks=tuple(plan_lacks(runs, 0 if self.bearing is None else len(self.bearing.pads))),
            measured=measured,
            problems=(*problems, *campaign.notes, *unknown),
            new=tuple(new),
            hashes={run.file: records[run.id].digest for run in landed},
            placed=tuple(placed),
        )

    def _measured(self, good: Campaign) -> Measured:
        """Results of the runs that count, each made anew where its runs have news."""
        angles = () if self.bearing is None else self.bearing.pivot_angles
        clearance = None if self.bearing is None else min(self.bearing.clearances)
        settings = IdentifySettings(clearance=clearance, keep_weights=False)
        measures = {
            "identification": ("dynamic", lambda: identify(good, settings, store=self.store)),
            "curves": ("dry_pivot", lambda: fit_pivots(good, angles, on_refusal="skip")),
            "polygon": ("clearance", lambda: measure_clearance(good, angles)),
        }
        results: dict[str, Any] = {}
        refusals = []
        for name, (kind, measure) in measures.items():
            runs = good.of_kind(kind)
            if runs and (angles or kind == "dynamic"):
                mark = frozenset((run.id, self._records[run.id].mark) for run in runs)
                former = self._cache.get(name, (None, (None, "")))[1][0]
                make = functools.partial(_unless_refused, f"{kind} runs", measure, former)
                result, refusal = self._unless_changed(name, mark, make)
                results |= {name: result} if result is not None else {}
                refusals += [refusal] if refusal else []
        return Measured(**results, refusals=tuple(refusals))


def _unless_refused(name: str, measure: Callable[[], Any], former: Any) -> tuple[Any, str]:
    """A result; of records that are not complete yet what they gave before, and why."""
    try:
        return measure(), ""
    except (RigError, TpjbError, np.linalg.LinAlgError) as error:
        return former, f"{name}: {error}"


def _read(run: Run, path: Path, mark: tuple[Any, ...]) -> _Record:
    """Read a record: what it shows, when it landed, in ISO form of this place, and its SHA-256."""
    changed = datetime.datetime.fromtimestamp(1e-9 * mark[0][1], datetime.UTC)
    digest = "missing"
    with contextlib.suppress(OSError):  # gone or locked again, which its state tells
        digest = sha256(path)
    return _Record(mark, observe(run), changed.astimezone().isoformat(timespec="milliseconds"), digest)
